"""The parts that all voices share: listening points that may move, the pick-up, the gain, and the end."""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import bank, javari, rendered, tension, truth
from engine.kernels import voice_records as at
from engine.kernels.compiled import kernel
from engine.kernels.constants import QUANTUM
from engine.kernels.memory import (
    bank_program_at,
    fence,
    rendered_program_at,
    tension_program_at,
    truth_program_at,
    voice_at,
    wish_at,
)
from engine.kernels.mixer_records import CAUSE_RUNAWAY, GAPS, REACH, Mixer
from engine.kernels.modes import eased, motion, row, weights

MOVE_S = 0.020  # the fade to another listening point
END_S = 0.020  # the fade of a voice that has become silent
FLUX_CURVES = 2.0  # e-folds up to which the flux is a curve: its series rises everywhere
WARMED = 3  # quanta: the one that is heard, and those before and after it


@kernel
def generate(voice: at.Voice, audible: bool, rate_hz: float, out: np.ndarray, scratch: np.ndarray) -> None:
    """Write the next quantum of displacement at a voice's points, (2, QUANTUM) of `out`, (4, QUANTUM).

    While it fades to other points, what it is there is written too, as rows 2 and 3, and mixed in.
    """
    kind = voice.kind
    if kind == at.RENDERED:
        rendered.generate(voice, rendered_program_at(voice.program), out)
        return
    fading = voice.next_weights == 1
    fence()
    if kind == at.BANK:
        bank.generate(voice, bank_program_at(voice.program), fading, audible, out, scratch)
    elif voice.javari.steps > 0:
        javari.generate(voice, fading, audible, out, scratch)
    elif kind == at.TENSION:
        tension.generate(voice, tension_program_at(voice.program), fading, audible, out, scratch)
    else:
        truth.generate(voice, truth_program_at(voice.program), fading, audible, out)
    if fading:
        move_points(voice, audible, rate_hz, out)


@kernel
def move_points(voice: at.Voice, audible: bool, rate_hz: float, out: np.ndarray) -> None:
    """Fade a quantum at a voice's points, rows 0 and 1 of `out`, to that at its next ones, rows 2 and 3, in MOVE_S.

    At the end of the fade the second set of weights becomes the first.
    """
    done, frames = voice.weights_faded, round(MOVE_S * rate_hz)
    for point in range(voice.points):
        for frame in range(QUANTUM):
            share = min((done + frame + 1) / frames, 1.0)
            out[point, frame] += share * (out[2 + point, frame] - out[point, frame])
    voice.weights_faded = done + QUANTUM
    if voice.weights_faded >= frames or not audible:
        for point in range(2):
            for part in range(2):
                weights(voice, 0, point, part)[:] = weights(voice, 1, point, part)
            voice.bias[0, point] = voice.bias[1, point]
        voice.weights_faded = 0
        fence()
        voice.next_weights = 0


@kernel
def is_first(voice: at.Voice) -> bool:
    """Return True if a voice is not yet ahead of what was heard of it."""
    return voice.generated == voice.frame


@kernel
def remember(voice: at.Voice, audible: bool, first: bool, out: np.ndarray) -> None:
    """Keep the quantum that was generated, and the flux that it is to a magnetic pick-up.

    That grows as (exp(x/δ) - 1) δ with the displacement x, to third order.
    What the filter needs is there when `warm` has reached `WARMED`: at the pluck at once, else two quanta later.

    Args:
        first: this quantum is the first one that the voice is ahead of what was heard of it: see `is_first`.
        out: displacement of full scale, (2, QUANTUM) of it.
    """
    if first:
        voice.warm = 0
    voice.warm = min(voice.warm + 1, WARMED) if audible else 0
    for point in range(voice.points):
        past = voice.history[point]
        for frame in range(2 * QUANTUM):
            past[frame] = past[frame + QUANTUM]
        near = voice.nearness
        for frame in range(QUANTUM):
            moved = min(max(near * out[point, frame], -FLUX_CURVES), FLUX_CURVES)
            curved = 1.0 + moved * (0.5 + moved / 6)
            past[2 * QUANTUM + frame] = out[point, frame] * curved
        if first and voice.frame == 0:
            mirrored = 1 if voice.joins else QUANTUM  # at rest before the pluck: the mirror of what follows
            for frame in range(1, mirrored):
                past[2 * QUANTUM - frame] = past[2 * QUANTUM + frame]
            voice.warm = WARMED - 1


@kernel
def differentiate(voice: at.Voice, out: np.ndarray, taps: np.ndarray) -> None:
    """Write the velocity in the quantum before the latest, (2, QUANTUM) of `out`; `taps`: filter (2 REACH + 1,)."""
    for point in range(voice.points):
        past = voice.history[point]
        for frame in range(QUANTUM):
            total = 0.0
            for tap in range(2 * REACH + 1):
                total += taps[tap] * past[QUANTUM + frame - REACH + tap]
            out[point, frame] = total


@kernel
def take_over(voice: at.Voice, now: int, scratch: np.ndarray) -> None:
    """Take over the string of the voice before: stop its motion as this one begins, or add this pluck to it.

    One that is to begin later, or is stopped before it has begun, is not heard at all; then the string is that of
    the voice before that one, which is left as what is to be taken over.
    """
    before, stops = voice_at(voice.previous_voice), voice.stops_in
    waits, earlier = before.state == at.WAITING, 0
    later = before.begin_at >= now + QUANTUM and before.joins == 0
    if waits and (later or stops > 0):
        _never_begin(before)
        earlier = before.previous_voice
    elif stops == 0:
        _join(voice, before, now, scratch)
    elif before.release == 0:
        before.release = stops
    fence()
    voice.previous_voice = earlier


@kernel
def _never_begin(voice: at.Voice) -> None:
    """Let a voice that waits end without a sound."""
    voice.gain = voice.gain_to = voice.wanted_gain = 0.0
    voice.release = 1


@kernel
def _join(voice: at.Voice, before: at.Voice, now: int, scratch: np.ndarray) -> None:
    """Add the motion of the voice before to this one's pluck; the voice before fades as this one begins.

    If the other has not begun yet it is not heard at all: both plucks are this voice's. Where it is over, or of
    another kind, the string is at rest.
    """
    rings = before.state == at.SOUNDING and before.generated > 0
    waits = before.state == at.WAITING and before.prepared == 0
    if (rings or waits) and before.kind == voice.kind:
        n, m = voice.modes, before.modes
        joins = rings or before.joins == 1
        if joins and voice.velocity:
            _past(voice, before)
        q, v = scratch[:m], scratch[m : 2 * m]  # amplitudes and speeds of the voice before
        if voice.kind == at.TENSION and rings:
            tension.physical(before, q, v)
        else:
            q[:], v[:] = motion(before)
        amplitudes, speeds = motion(voice)
        squares = row(voice, at.OMEGA_SQUARED)
        widest = 0.0  # m: the largest displacement that it may add
        for mode in range(min(n, m)):
            amplitudes[mode] += q[mode]
            speeds[mode] += v[mode]
            widest += math.sqrt(q[mode] ** 2 + v[mode] ** 2 / squares[mode])
        voice.limit *= 1 + widest / voice.peak
        voice.late = before.late
        if waits:
            voice.begin_at = max(voice.begin_at, before.begin_at)
            _never_begin(before)
        else:  # what senses velocity has been generated further than it is heard: so much later this one begins
            voice.begin_at = now + before.generated - before.frame
            before.fade_frames = max(1, voice.attack)
            before.release_at = max(1, voice.begin_at)
        voice.joins = joins


@kernel
def _past(voice: at.Voice, before: at.Voice) -> None:
    """Fill a voice's history, which is the displacement before its pluck, at its points.

    It is what the voice before gave so far, plus the displacement of this pluck, held until it begins.
    """
    pulled = row(voice, 0)
    for point in range(voice.points):
        weighed, held = weights(voice, 0, point, 0), 0.0
        for mode in range(voice.modes):
            held += weighed[mode] * pulled[mode]
        history, other = voice.history[point], before.history[min(point, before.points - 1)]
        for frame in range(3 * QUANTUM):
            history[frame] = other[frame] + held


@kernel
def _look_at_wishes(voice: at.Voice, now: int) -> None:
    """Let `resonator` be the latest WISH for other modes whose frame is not after `now`.

    Wishes count in their order, and wait for those before them.
    """
    latest = voice.resonator
    address = voice.pending_modes if latest == 0 else wish_at(latest).next
    while address != 0:
        fence()
        wish = wish_at(address)
        if wish.at > now:
            break
        voice.resonator = address
        address = wish.next


@kernel
def is_heard(voice: at.Voice) -> bool:
    """Return True if a voice's gain is not 0, or is about to rise from it."""
    return voice.gain != 0 or voice.gain_to != 0


@kernel
def begin(voice: at.Voice, mixer: Mixer) -> int:
    """Begin a voice's next quantum before it is generated; return the voice's state.

    That is SOUNDING where the quantum is to be generated, else WAITING or OVER. What a late voice left over of the
    quantum before is added to the mix. A release, or another wanted gain, begins a fade of the gain.
    """
    mix, now = mixer.mix[:], mixer.frames
    if voice.state == at.WAITING:
        if voice.begin_at >= now + QUANTUM:
            return at.OVER if voice.release > 0 else at.WAITING
        voice.late = max(voice.late, voice.begin_at - now)
    late, left_over = voice.late, voice.left_over[:]
    for frame in range(late):
        mix[frame, 0] += left_over[frame, 0]
        mix[frame, 1] += left_over[frame, 1]
        left_over[frame, 0] = left_over[frame, 1] = 0.0
    _look_at_wishes(voice, now + late)
    if voice.release_at > 0 and voice.release_at <= now and voice.release == 0:
        voice.release = voice.fade_frames
    if voice.frame >= voice.ends_at and voice.release == 0:
        voice.release = voice.ends_in
    release = voice.release
    wanted = 0.0 if release > 0 else voice.wanted_gain
    if wanted != voice.gain_to:
        voice.gain_from, voice.gain_to = voice.gain, wanted
        voice.gain_done = 0
        if release > 0:
            voice.fade_frames = release
    return at.SOUNDING


@kernel
def end(voice: at.Voice, mixer: Mixer, now_s: float, out: np.ndarray, moved: bool) -> int:
    """Add a generated quantum, (2, QUANTUM) of `out`, to the mix, with gain and fade-in; return the voice's state.

    Args:
        now_s: the device clock's time, noted where the voice begins.
        moved: False: the voice stands still, as it has no samples yet.
    """
    mix = mixer.mix[:]
    left_over = voice.left_over[:]
    points = voice.points
    late = voice.late
    release = voice.release
    audible = is_heard(voice)
    if audible and (not voice.velocity or voice.warm == WARMED):
        limit = voice.limit
        for point in range(points):
            for frame in range(QUANTUM):
                if not abs(out[point, frame]) <= limit:  # also where it is not a number
                    note_gap(mixer, mixer.frames, 0.0, CAUSE_RUNAWAY)
                    return at.RUNAWAY
        first, attack = voice.frame, voice.attack
        source, goal = voice.gain_from, voice.gain_to
        done, length = voice.gain_done, voice.fade_frames
        for frame in range(QUANTUM):
            gain = goal
            if done + frame < length:
                gain = source + (goal - source) * eased((done + frame + 1) / length)
            if first + frame < attack:
                if voice.joins:
                    gain *= eased((first + frame + 1) / attack)
                else:
                    gain *= 0.5 - 0.5 * math.cos(math.pi * (first + frame + 0.5) / attack)
            place = frame + late
            if place < QUANTUM:
                mix[place, 0] += gain * out[0, frame]
                mix[place, 1] += gain * out[points - 1, frame]
            else:
                left_over[place - QUANTUM, 0] = gain * out[0, frame]
                left_over[place - QUANTUM, 1] = gain * out[points - 1, frame]
        voice.gain_done = min(done + QUANTUM, length)
        voice.gain = goal
        if done + QUANTUM < length:
            voice.gain = source + (goal - source) * eased((done + QUANTUM) / length)
    if moved:
        if voice.began_frame < 0:
            voice.began_frame = mixer.frames + late
            voice.began_s = now_s
        voice.frame += QUANTUM
    faded = voice.gain == 0 and voice.gain_to == 0 and late == 0
    if release > 0 and (not audible or faded):
        return at.OVER
    if release == 0 and voice.loudness < voice.silent:
        voice.release = max(1, round(END_S * mixer.rate_hz))
    return at.SOUNDING


@kernel
def note_gap(mixer: Mixer, frame: int, milliseconds: float, cause: int) -> None:
    """Note one more silence that nobody asked for."""
    gap = mixer.gaps[mixer.gap_count % GAPS]
    gap.frame = frame
    gap.milliseconds = milliseconds
    gap.cause = cause
    fence()
    mixer.gap_count += 1


@kernel
def forward(voice: at.Voice, mixer: Mixer, frames: int) -> None:
    """Let a voice that is not yet handed over ring unheard for so many frames, rounded to quanta."""
    quanta = (frames + QUANTUM // 2) // QUANTUM
    if voice.kind == at.RENDERED:  # there need not be samples yet
        voice.generated = quanta * QUANTUM
        quanta = 0
    _look_at_wishes(voice, 0)
    for _ in range(quanta):
        generate(voice, False, mixer.rate_hz, mixer.out[0], mixer.scratch[:])
    voice.frame = voice.generated
