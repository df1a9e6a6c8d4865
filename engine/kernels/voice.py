"""The parts that all voices share: listening points that may move, the pick-up, the gain, and the end."""

from __future__ import annotations

import math

import numpy as np
from numba import carray, njit

from engine.kernels import javari, rendered, tension, truth
from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import fence, pointer
from engine.kernels.modes import row

MOVE_S = 0.020  # the fade to another listening point
END_S = 0.020  # the fade of a voice that has become silent
FLUX_CURVES = 2.0  # e-folds up to which the flux is a curve: its series rises everywhere
WARMED = 3  # quanta: the one that is heard, and those before and after it


@njit(**COMPILED)
def _generate(voice: np.ndarray, heard: bool, rate_hz: float, out: np.ndarray, scratch: np.ndarray) -> None:
    """The next quantum of displacement at its points, (2, QUANTUM) of `out`, on the way to other points too."""
    counts = voice.view(np.int64)
    kind = counts[at.KIND]
    program = carray(pointer(counts[at.PROGRAM]), (1 << 40,), np.float64)
    if kind == at.RENDERED:
        rendered.generate(voice, program, out)
        return
    fading = counts[at.NEXT_WEIGHTS] == 1
    fence()
    if counts[at.JAVARI_STEPS] > 0:
        javari.generate(voice, program, fading, heard, out, scratch)
    elif kind == at.TENSION:
        tension.generate(voice, program, fading, heard, out, scratch)
    else:
        truth.generate(voice, program, fading, heard, out)
    if fading:
        move_points(voice, heard, rate_hz, out)


@njit(**COMPILED)
def move_points(voice: np.ndarray, heard: bool, rate_hz: float, out: np.ndarray) -> None:
    """Fades what a quantum is at its points to what it is at others."""
    counts = voice.view(np.int64)
    n, done, frames = counts[at.MODES], counts[at.WEIGHTS_FADED], round(MOVE_S * rate_hz)
    for point in range(counts[at.POINTS]):
        for frame in range(at.QUANTUM):
            share = min((done + frame + 1) / frames, 1.0)
            out[point, frame] += share * (out[2 + point, frame] - out[point, frame])
    counts[at.WEIGHTS_FADED] = done + at.QUANTUM
    if counts[at.WEIGHTS_FADED] >= frames or not heard:
        for slot in range(4 * n):
            voice[at.HEADER + slot] = voice[at.HEADER + 4 * n + slot]
        for point in range(2):
            voice[at.bias(n, 0, point)] = voice[at.bias(n, 1, point)]
        counts[at.WEIGHTS_FADED] = 0
        fence()
        counts[at.NEXT_WEIGHTS] = 0


@njit(**COMPILED)
def _velocity(
    voice: np.ndarray, heard: bool, rate_hz: float, out: np.ndarray, scratch: np.ndarray, taps: np.ndarray
) -> None:
    """Generate the motion of `_generate`, differentiated; the voice is generated a quantum ahead for that."""
    begins = is_first(voice)
    for turn in range(2 if begins else 1):
        _generate(voice, heard, rate_hz, out, scratch)
        remember(voice, heard, begins and turn == 0, out)
    differentiate(voice, out, taps)


@njit(**COMPILED)
def is_first(voice: np.ndarray) -> bool:
    """Return True if a voice is not yet ahead of what was heard of it."""
    counts = voice.view(np.int64)
    return counts[at.GENERATED] == counts[at.FRAME]


@njit(**COMPILED)
def remember(voice: np.ndarray, heard: bool, first: bool, out: np.ndarray) -> None:
    """Keeps the quantum that was generated, and the flux that it is to a magnetic pick-up.

    That grows as (exp(x/δ) - 1) δ with the displacement x, to third order.
    What the filter needs is there when `WARM` has reached `WARMED`: at the pluck at once, else two quanta later.
    """
    counts = voice.view(np.int64)
    n, quantum = counts[at.MODES], at.QUANTUM
    if first:
        counts[at.WARM] = 0
    counts[at.WARM] = min(counts[at.WARM] + 1, WARMED) if heard else 0
    for point in range(counts[at.POINTS]):
        slot = at.history(n, point)
        past = voice[slot : slot + 3 * quantum]
        for frame in range(2 * quantum):
            past[frame] = past[frame + quantum]
        near = voice[at.NEARNESS]
        for frame in range(quantum):
            moved = min(max(near * out[point, frame], -FLUX_CURVES), FLUX_CURVES)
            curved = 1.0 + moved * (0.5 + moved / 6)
            past[2 * quantum + frame] = out[point, frame] * curved
        if first and counts[at.FRAME] == 0:
            mirrored = 1 if counts[at.JOINS] else quantum  # at rest before the pluck: the mirror of what follows
            for frame in range(1, mirrored):
                past[2 * quantum - frame] = past[2 * quantum + frame]
            counts[at.WARM] = WARMED - 1


@njit(**COMPILED)
def differentiate(voice: np.ndarray, out: np.ndarray, taps: np.ndarray) -> None:
    """The velocity of the quantum before the latest, (2, QUANTUM) of `out`."""
    counts = voice.view(np.int64)
    n, quantum = counts[at.MODES], at.QUANTUM
    for point in range(counts[at.POINTS]):
        slot = at.history(n, point)
        past = voice[slot : slot + 3 * quantum]
        for frame in range(quantum):
            total = 0.0
            for tap in range(2 * at.REACH + 1):
                total += taps[tap] * past[quantum + frame - at.REACH + tap]
            out[point, frame] = total


@njit(**COMPILED)
def take_over(voice: np.ndarray, now: int, scratch: np.ndarray) -> None:
    """Take over the string of the voice before: stop its motion as this one begins, or add this pluck to it.

    One that is to begin later, or is stopped before it has begun, is not heard at all; then the string is that of
    the voice before that one, which is left as what is to be taken over.
    """
    counts = voice.view(np.int64)
    before = carray(pointer(counts[at.PREVIOUS_VOICE]), (1 << 40,), np.float64)
    befores = before.view(np.int64)
    stops, waits, earlier = counts[at.STOPS_IN], befores[at.STATE] == at.WAITING, 0
    later = befores[at.BEGIN_AT] >= now + at.QUANTUM and befores[at.JOINS] == 0
    if waits and (later or stops > 0):
        _never_begin(before)
        earlier = befores[at.PREVIOUS_VOICE]
    elif stops == 0:
        _join(voice, before, now, scratch)
    elif befores[at.RELEASE] == 0:
        befores[at.RELEASE] = stops
    fence()
    counts[at.PREVIOUS_VOICE] = earlier


@njit(**COMPILED)
def _never_begin(voice: np.ndarray) -> None:
    """A voice that waits ends without a sound."""
    voice[at.GAIN] = voice[at.GAIN_TO] = voice[at.WANTED_GAIN] = 0.0
    voice.view(np.int64)[at.RELEASE] = 1


@njit(**COMPILED)
def _join(voice: np.ndarray, before: np.ndarray, now: int, scratch: np.ndarray) -> None:
    """The pluck is added to the motion of the voice before, which fades as this one begins.

    One that has not begun yet is not heard at all: both plucks are this voice's. Where it is over, or of another
    kind, the string is at rest.
    """
    counts, befores = voice.view(np.int64), before.view(np.int64)
    rings = befores[at.STATE] == at.SOUNDING and befores[at.GENERATED] > 0
    waits = befores[at.STATE] == at.WAITING and befores[at.PREPARED] == 0
    if (rings or waits) and befores[at.KIND] == counts[at.KIND]:
        n, m = counts[at.MODES], befores[at.MODES]
        joins = rings or befores[at.JOINS] == 1
        if joins and counts[at.VELOCITY]:
            _past(voice, before)
        q, v = scratch[:m], scratch[m : 2 * m]
        if counts[at.KIND] == at.TENSION and rings:
            tension.physical(before, q, v)
        else:
            q[:], v[:] = row(before, m, 0), row(before, m, 1)
        amplitudes, speeds = row(voice, n, 0), row(voice, n, 1)
        widest = 0.0
        for mode in range(min(n, m)):
            amplitudes[mode] += q[mode]
            speeds[mode] += v[mode]
            widest += math.sqrt(q[mode] ** 2 + v[mode] ** 2 / row(voice, n, at.OMEGA_SQUARED)[mode])
        voice[at.LIMIT] *= 1 + widest / voice[at.PEAK]
        counts[at.LATE] = befores[at.LATE]
        if waits:
            counts[at.BEGIN_AT] = max(counts[at.BEGIN_AT], befores[at.BEGIN_AT])
            _never_begin(before)
        else:  # what senses velocity has been generated further than it is heard: so much later this one begins
            counts[at.BEGIN_AT] = now + befores[at.GENERATED] - befores[at.FRAME]
            befores[at.FADE_FRAMES] = max(1, counts[at.ATTACK])
            befores[at.RELEASE_AT] = max(1, counts[at.BEGIN_AT])
        counts[at.JOINS] = joins


@njit(**COMPILED)
def _past(voice: np.ndarray, before: np.ndarray) -> None:
    """Displacement before the pluck: the motion so far, and the string held where the pluck begins."""
    counts, befores = voice.view(np.int64), before.view(np.int64)
    n = counts[at.MODES]
    pulled = row(voice, n, 0)
    for point in range(counts[at.POINTS]):
        weights = voice[at.weights(n, 0, point, 0) : at.weights(n, 0, point, 0) + n]
        held = 0.0
        for mode in range(n):
            held += weights[mode] * pulled[mode]
        own = at.history(n, point)
        other = at.history(befores[at.MODES], min(point, befores[at.POINTS] - 1))
        for frame in range(3 * at.QUANTUM):
            voice[own + frame] = before[other + frame] + held


@njit(**COMPILED)
def _eased(share: float) -> float:
    """0 … 1 as 0 … 1, without the corners at which a loud string that fades in milliseconds would click."""
    return share * share * (3 - 2 * share)


@njit(**COMPILED)
def _look_at_wishes(voice: np.ndarray, now: int) -> None:
    """Continues to the latest modes that are due. Wishes count in their order, and wait for those before them."""
    counts = voice.view(np.int64)
    latest = counts[at.RESONATOR]
    wished = counts[at.PENDING_MODES] if latest == 0 else carray(pointer(latest), (at.B_HEADER,), np.int64)[at.B_NEXT]
    while wished != 0:
        fence()
        block = carray(pointer(wished), (at.B_HEADER,), np.int64)
        if block[at.B_AT] > now:
            break
        counts[at.RESONATOR] = wished
        wished = block[at.B_NEXT]


@njit(**COMPILED)
def add(voice: np.ndarray, mixer: np.ndarray, now_s: float) -> int:
    """Adds the next quantum of a voice to the mix, (QUANTUM, 2). Returns its state, which it leaves to the caller."""
    counts = voice.view(np.int64)
    state = begin(voice, mixer)
    if state != at.SOUNDING:
        return state
    out = mixer[at.M_OUT : at.M_OUT + 4 * at.QUANTUM].reshape(4, at.QUANTUM)
    scratch, rate_hz, heard = mixer[at.M_SCRATCH : at.M_AMPLIFIER], mixer[at.M_RATE], is_heard(voice)
    was_dry, generated = counts[at.DRY], counts[at.GENERATED]
    if counts[at.VELOCITY]:
        taps = mixer[at.M_TAPS : at.M_TAPS + 2 * at.REACH + 1]
        _velocity(voice, heard, rate_hz, out, scratch, taps)
    else:
        _generate(voice, heard, rate_hz, out, scratch)
    if counts[at.DRY] and not was_dry:
        note_gap(mixer, mixer.view(np.int64)[at.M_FRAMES], 0.0, at.CAUSE_STARVED)
    return end(voice, mixer, now_s, out, counts[at.GENERATED] > generated)


@njit(**COMPILED)
def is_heard(voice: np.ndarray) -> bool:
    return voice[at.GAIN] != 0 or voice[at.GAIN_TO] != 0


@njit(**COMPILED)
def begin(voice: np.ndarray, mixer: np.ndarray) -> int:
    """Begin a voice's next quantum before it is generated.

    Returns its state where none is: it waits, or is over.
    """
    counts, quantum = voice.view(np.int64), at.QUANTUM
    mix = mixer[at.M_MIX : at.M_MIX + 2 * quantum].reshape(quantum, 2)
    now = mixer.view(np.int64)[at.M_FRAMES]
    if counts[at.STATE] == at.WAITING:
        if counts[at.BEGIN_AT] >= now + quantum:
            return at.OVER if counts[at.RELEASE] > 0 else at.WAITING
        counts[at.LATE] = max(counts[at.LATE], counts[at.BEGIN_AT] - now)
    late, left_over = counts[at.LATE], voice[at.left_over(counts[at.MODES]) : at.state(counts[at.MODES])]
    for frame in range(late):
        mix[frame, 0] += left_over[2 * frame]
        mix[frame, 1] += left_over[2 * frame + 1]
        left_over[2 * frame] = left_over[2 * frame + 1] = 0.0
    _look_at_wishes(voice, now + late)
    if counts[at.RELEASE_AT] > 0 and counts[at.RELEASE_AT] <= now and counts[at.RELEASE] == 0:
        counts[at.RELEASE] = counts[at.FADE_FRAMES]
    if counts[at.FRAME] >= counts[at.ENDS_AT] and counts[at.RELEASE] == 0:
        counts[at.RELEASE] = counts[at.ENDS_IN]
    release = counts[at.RELEASE]
    wanted = 0.0 if release > 0 else voice[at.WANTED_GAIN]
    if wanted != voice[at.GAIN_TO]:
        voice[at.GAIN_FROM], voice[at.GAIN_TO] = voice[at.GAIN], wanted
        counts[at.GAIN_DONE] = 0
        if release > 0:
            counts[at.FADE_FRAMES] = release
    return at.SOUNDING


@njit(**COMPILED)
def end(voice: np.ndarray, mixer: np.ndarray, now_s: float, out: np.ndarray, moved: bool) -> int:
    """Adds a quantum, (2, QUANTUM) of `out`, to the mix; the voice's state.

    Args:
        moved: whether it was generated, else it stands still.
    """
    counts, mix_counts, quantum = voice.view(np.int64), mixer.view(np.int64), at.QUANTUM
    mix = mixer[at.M_MIX : at.M_MIX + 2 * quantum].reshape(quantum, 2)
    now, rate_hz, points = mix_counts[at.M_FRAMES], mixer[at.M_RATE], counts[at.POINTS]
    late, release, heard = counts[at.LATE], counts[at.RELEASE], is_heard(voice)
    left_over = voice[at.left_over(counts[at.MODES]) : at.state(counts[at.MODES])]
    if heard and (not counts[at.VELOCITY] or counts[at.WARM] == WARMED):
        limit = voice[at.LIMIT]
        for point in range(points):
            for frame in range(quantum):
                if not abs(out[point, frame]) <= limit:  # also where it is not a number
                    note_gap(mixer, mix_counts[at.M_FRAMES], 0.0, at.CAUSE_RUNAWAY)
                    return at.RUNAWAY
        first, attack = counts[at.FRAME], counts[at.ATTACK]
        source, goal, done, length = (
            voice[at.GAIN_FROM],
            voice[at.GAIN_TO],
            counts[at.GAIN_DONE],
            counts[at.FADE_FRAMES],
        )
        for frame in range(quantum):
            gain = goal
            if done + frame < length:
                gain = source + (goal - source) * _eased((done + frame + 1) / length)
            if first + frame < attack:
                if counts[at.JOINS]:
                    gain *= _eased((first + frame + 1) / attack)
                else:
                    gain *= 0.5 - 0.5 * math.cos(math.pi * (first + frame + 0.5) / attack)
            place = frame + late
            if place < quantum:
                mix[place, 0] += gain * out[0, frame]
                mix[place, 1] += gain * out[points - 1, frame]
            else:
                left_over[2 * (place - quantum)] = gain * out[0, frame]
                left_over[2 * (place - quantum) + 1] = gain * out[points - 1, frame]
        counts[at.GAIN_DONE] = min(done + quantum, length)
        voice[at.GAIN] = goal
        if done + quantum < length:
            voice[at.GAIN] = source + (goal - source) * _eased((done + quantum) / length)
    if moved:
        if counts[at.BEGAN_FRAME] < 0:
            counts[at.BEGAN_FRAME] = now + late
            voice[at.BEGAN_S] = now_s
        counts[at.FRAME] += quantum
    faded = voice[at.GAIN] == 0 and voice[at.GAIN_TO] == 0 and late == 0
    if release > 0 and (not heard or faded):
        return at.OVER
    if release == 0 and voice[at.LOUDNESS] < voice[at.SILENT]:
        counts[at.RELEASE] = max(1, round(END_S * rate_hz))
    return at.SOUNDING


@njit(**COMPILED)
def note_gap(mixer: np.ndarray, frame: int, milliseconds: float, cause: int) -> None:
    """Note one more silence that nobody asked for."""
    counts = mixer.view(np.int64)
    slot = at.M_GAP_LIST + (counts[at.M_GAPS] % at.GAPS) * at.GAP_FIELDS
    mixer[slot], mixer[slot + 1], mixer[slot + 2] = frame, milliseconds, cause
    fence()
    counts[at.M_GAPS] += 1


@njit(**COMPILED)
def forward(voice: np.ndarray, mixer: np.ndarray, frames: int) -> None:
    """Lets a voice that is not yet handed over ring unheard for so many frames, rounded to quanta."""
    counts = voice.view(np.int64)
    out = mixer[at.M_OUT : at.M_OUT + 4 * at.QUANTUM].reshape(4, at.QUANTUM)
    quanta = (frames + at.QUANTUM // 2) // at.QUANTUM
    if counts[at.KIND] == at.RENDERED:  # there need not be samples yet
        counts[at.GENERATED] = quanta * at.QUANTUM
        quanta = 0
    _look_at_wishes(voice, 0)
    for _ in range(quanta):
        _generate(voice, False, mixer[at.M_RATE], out, mixer[at.M_SCRATCH : at.M_AMPLIFIER])
    counts[at.FRAME] = counts[at.GENERATED]
