"""Voices in the mix, alone or as strings of a course on one bridge, in step: energy passes between them, both ways.

The bridge, of conductance G, moves with the sum of the forces of all strings on it. For one partial of strings nearly
in unison that is one damper for the sum of their speeds v, in place of one for each:

    dv_i/dt = … - 2 s_i Σ_j s_j v_j,        s_i² = T_i G/ℓ_i,

s_i² being what string i alone loses to the bridge (`engine.values.string`). So n strings in phase decay n
times as fast by it, and motion in which the forces cancel loses nothing to it: two-stage decay, and an aftersound
(G. Weinreich, "Coupled piano strings", JASA 62, 1977). His bridge has a reactive part too, which is left out here, as
it is for single strings. Both directions of motion have a bridge each; octave strings are left out.

Once a frame, t, after each string's own motion, all speeds become v - f s (s·v) with f = 2t / (1 + t s·s): the
midpoint rule, which for t s·s of 1e-3 differs from the exponential by 1e-9.

Nothing rings up. The strings are nearly of one mass m, so that their kinetic energy is ½m v·v. The matrix 1 - f s sᵀ
is symmetric with the eigenvalues 1 and (1 - t s·s) / (1 + t s·s), never beyond ±1: kinetic energy does not rise,
and displacements stay as they are, so that potential energy, that of the risen tension too, does. Between, each
string moves as alone, with the rest of its losses. So the course loses energy wherever its strings alone do.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import lanes, tension, truth
from engine.kernels import voice_records as at
from engine.kernels.compiled import inlined, kernel
from engine.kernels.constants import MOST_PAIRS, QUANTUM
from engine.kernels.memory import fence, tension_program_at, truth_program_at, voice_at
from engine.kernels.mixer_records import CAUSE_STARVED, MOST_COURSE, CourseString, Mixer
from engine.kernels.modes import following, motion, row
from engine.kernels.voice import (
    begin,
    differentiate,
    end,
    generate,
    is_first,
    is_heard,
    move_points,
    note_gap,
    remember,
)

SHARED = 2 * MOST_PAIRS  # modes of a string that have a part in the bridge, at most
PARTS = lanes.PARTS * SHARED  # slots of all their parts


@kernel
def _joins(course: int, late: int, voice: at.Voice, now: int) -> bool:
    """Return True if a voice is a string of a course, and has its next quantum to come at the same frame.

    Args:
        course: the course's number, above 0.
        late: frames after the mixer's quantum begins at which the course's own does.
        now: the mixer's frame at which its quantum begins.
    """
    if voice.course != course or voice.course_done == now + 1:
        return False
    if voice.state == at.WAITING:
        begins = voice.begin_at < now + QUANTUM
        return begins and max(voice.late, voice.begin_at - now) == late
    return voice.state == at.SOUNDING and voice.late == late


@kernel
def add(mixer: Mixer, place: int, now_s: float) -> int:
    """Add the next quantum of an active voice, by its place, and of its course to the mix; return the voice's state.

    Others of the course have theirs from here on, and only give it at their own places.
    """
    first_voice, now = voice_at(mixer.voices[place]), mixer.frames
    if first_voice.course_done == now + 1:
        return first_voice.state
    state = begin(first_voice, mixer)
    if state != at.SOUNDING:
        return state
    course = first_voice.course
    late = first_voice.late
    strings = 1
    was_dry, before = first_voice.dry, first_voice.generated
    mixer.course[0].address = mixer.voices[place]
    for later_place in range(place + 1, mixer.active if course != 0 else 0):
        other = voice_at(mixer.voices[later_place])
        if strings < MOST_COURSE and _joins(course, late, other, now) and begin(other, mixer) == at.SOUNDING:
            mixer.course[strings].address = mixer.voices[later_place]
            strings += 1
    for turn in range(2):  # those first that are behind the others, as a pick-up of velocity is as it begins
        generated = 0
        for number in range(strings):
            voice = voice_at(mixer.course[number].address)
            if turn == 1 or (voice.velocity != 0 and is_first(voice)):
                mixer.generated[generated] = number
                generated += 1
        if generated > 0:
            _generate(mixer, generated, turn == 0)
    if first_voice.dry and not was_dry:
        note_gap(mixer, now, 0.0, CAUSE_STARVED)
    for number in range(strings):
        voice, out = voice_at(mixer.course[number].address), mixer.out[number]
        if voice.velocity:
            differentiate(voice, out, mixer.taps[:])
        added = end(voice, mixer, now_s, out, number > 0 or voice.generated > before)
        if course != 0:
            voice.course_done = now + 1
        if number == 0:
            state = added
        else:
            fence()
            voice.state = added
    return state


@inlined
def _string(mixer: Mixer, number: int) -> CourseString:
    """A string that is generated now, by its number."""
    return mixer.course[mixer.generated[number]]


@kernel
def _generate(mixer: Mixer, strings: int, first: bool) -> None:
    """Generate the next quantum of the first `strings` of `mixer.generated`, each into its place of `mixer.out`.

    `first`: they are voices that sense velocity, and are not yet ahead of what was heard of them.
    """
    scratch = mixer.scratch[:]
    alone = voice_at(_string(mixer, 0).address)
    if alone.course == 0:
        generate(alone, is_heard(alone), mixer.rate_hz, mixer.out[0], scratch)
        if alone.velocity:
            remember(alone, is_heard(alone), first, mixer.out[0])
        return
    sums = scratch[lanes.aligned(scratch) :][:SHARED]
    place = lanes.aligned(scratch) + SHARED
    solved = False
    shared = 0
    for number in range(strings):
        voice = voice_at(_string(mixer, number).address)
        solved = voice.kind == at.TRUTH
        place = _set_up(_string(mixer, number), voice, scratch, place, solved)
        shared = max(shared, min(voice.bridged, voice.moving))
    _take_parts(mixer, strings, shared, sums)
    if solved:
        _ring_solved(mixer, strings, shared, sums)
    else:
        _ring(mixer, strings, shared)
    for number in range(strings):
        string, out = _string(mixer, number), mixer.out[mixer.generated[number]]
        voice = voice_at(string.address)
        audible = is_heard(voice)
        if not solved:
            _put_back(string, voice, scratch)
        voice.generated += QUANTUM
        if voice.next_weights == 1:
            move_points(voice, audible, mixer.rate_hz, out)
        if voice.velocity:
            remember(voice, audible, first, out)


@kernel
def _ring(mixer: Mixer, strings: int, shared: int) -> None:
    """Write a quantum of strings that a model plays; the latents of each share its own tension.

    They meet at the bridge after each frame.

    Args:
        strings: how many of `mixer.generated`, 1 to 3 (MOST_COURSE).
        shared: their lowest modes that may have a part in the bridge.
    """
    scratch, blocks = mixer.scratch[:], lanes.blocks_of(shared)  # one mode a lane
    # `lanes.meet` takes three first slots of the scratch, and uses those of as many strings as there are.
    one = _string(mixer, 0)
    other = _string(mixer, min(1, strings - 1))
    third = _string(mixer, strings - 1)
    parts, modes = (one.parts, other.parts, third.parts), (one.first, other.first, third.first)
    for frame in range(QUANTUM):
        for number in range(strings):
            string = _string(mixer, number)
            _advance(string, voice_at(string.address), scratch, frame, mixer.out[mixer.generated[number]])
        lanes.meet(scratch, blocks, strings, modes, parts)


@kernel
def _ring_solved(mixer: Mixer, strings: int, shared: int, sums: np.ndarray) -> None:
    """Write a quantum of strings that are solved, which meet at the bridge after each frame.

    Args:
        shared: their lowest modes that may have a part in the bridge.
        sums: (SHARED,), room for the sum of all strings' parts, by mode.
    """
    scratch = mixer.scratch[:]
    for frame in range(QUANTUM):
        for number in range(strings):
            string = _string(mixer, number)
            voice, out = voice_at(string.address), mixer.out[mixer.generated[number]]
            program, fading = truth_program_at(voice.program), voice.next_weights == 1
            truth.hear(voice, program, frame, fading, is_heard(voice), out)
            truth.ring(voice, program, string.sub_steps, max(string.sub_steps, 1))
        sums[:shared] = 0.0
        for number in range(strings):
            string = _string(mixer, number)
            speeds, parts = _speeds(voice_at(string.address), shared), scratch[string.parts :]
            for mode in range(len(speeds)):
                sums[mode] += parts[mode] * speeds[mode]
        for number in range(strings):
            string = _string(mixer, number)
            speeds, parts = _speeds(voice_at(string.address), shared), scratch[string.parts + 2 * SHARED :]
            for mode in range(len(speeds)):
                speeds[mode] -= parts[mode] * sums[mode]


@inlined
def _speeds(voice: at.Voice, shared: int) -> np.ndarray:
    """Speeds of a solved string's first modes."""
    return row(voice, 1)[: min(voice.modes, shared)]


@kernel
def _set_up(string: CourseString, voice: at.Voice, scratch: np.ndarray, place: int, solved: bool) -> int:
    """Prepare a string for a quantum, its parts and modes from a slot of the scratch on; return the slot behind."""
    string.parts, string.first = place, place + PARTS
    if solved:
        string.sub_steps = truth.set_up(voice, truth_program_at(voice.program))
        return string.first
    program = tension_program_at(voice.program)
    tension.bring_up_to_date(voice, program)
    moving = voice.heard = voice.felt = voice.moving
    first, near = string.first, lanes.blocks_of(moving)
    ears = tension.take(
        voice, tension.order_of(voice)[:moving], voice.next_weights == 1, is_heard(voice), scratch, first
    )
    for number in range(lanes.LANES * near, SHARED):  # these rest
        slot = first + lanes.place(number)
        scratch[slot] = scratch[slot + lanes.LANES] = 0.0
    string.near = near
    string.moving = moving
    string.nodes = voice.steps
    string.ears = ears
    string.apart = 2 if voice.points == 1 else 1
    string.stretch, string.second = lanes.add_up(scratch, first, near, 0, ears, string.heard[:])
    string.total, string.silence = 0.0, program.silence
    return first + lanes.slots(max(voice.modes, SHARED))


@kernel
def _take_parts(mixer: Mixer, strings: int, shared: int, sums: np.ndarray) -> None:
    """Compute the parts of strings' modes in the bridge's motion, and what that takes from them in a frame.

    A mode that rests has no part, so that it is not moved; one that others have not loses as much as alone.

    The parts of a string are (PARTS, SHARED): s_i of the speed, as factors of y (of v, where solved) and of x; then
    what the bridge's motion takes from y or v.
    """
    scratch, step_s = mixer.scratch[:], 1 / mixer.rate_hz
    sums[:shared] = 0.0
    for number in range(strings):
        voice = voice_at(_string(mixer, number).address)
        lost = row(voice, at.BRIDGE)
        for mode in range(min(shared, voice.bridged, voice.moving)):
            sums[mode] += lost[mode]
    for number in range(strings):
        first = _string(mixer, number).parts
        voice = voice_at(_string(mixer, number).address)
        modes = min(shared, voice.bridged, voice.moving)
        parts = scratch[first : first + PARTS].reshape(lanes.PARTS, SHARED)
        parts[:] = 0.0
        lost = row(voice, at.BRIDGE)
        sigmas = row(voice, at.SIGMA)
        squares = following(voice)[6]
        if voice.kind == at.TRUTH:
            for mode in range(modes):
                part = math.sqrt(lost[mode])
                parts[0, mode], parts[2, mode] = part, part * (2 * step_s / (1 + step_s * sums[mode]))
        else:
            for mode in range(modes):  # v = -(ω y + σ x)
                part, omega = math.sqrt(lost[mode]), math.sqrt(squares[mode])
                parts[0, mode], parts[1, mode] = part * omega, part * sigmas[mode]
                parts[2, mode] = part / omega * (2 * step_s / (1 + step_s * sums[mode]))


@inlined
def _advance(string: CourseString, voice: at.Voice, scratch: np.ndarray, frame: int, out: np.ndarray) -> None:
    """Advance latents that share a tension by one frame, after it is heard: as `tension.generate`."""
    first = string.first
    near = string.near
    ears = string.ears
    at_points, largest = string.heard[:], voice.largest_stretch
    sums, nothing = (string.stretch, string.second), (0.0, 0.0)
    for ear in range(ears):
        out[string.apart * ear, frame] = at_points[2 * ear] - sums[0] * at_points[2 * ear + 1]
    for _ in range(string.nodes - 1):
        sums = tension.node(scratch, first, near, 0, 0, sums, nothing, largest, at_points)
    sums = tension.node(scratch, first, near, 0, ears, sums, nothing, largest, at_points)
    voice.largest_energy *= voice.decay
    if frame % 16 == 15:
        total, held = tension.hold(scratch, first, near, voice.largest_energy)
        before = string.moving
        moving = tension.trim(scratch, first, before, string.silence, total)
        near = lanes.blocks_of(moving)
        if held or moving < before or total < tension.NOTHING:
            sums = lanes.add_up(scratch, first, near, 0, ears, at_points)
        string.near = near
        string.moving = moving
        string.total = total
    string.stretch, string.second = sums


@kernel
def _put_back(string: CourseString, voice: at.Voice, scratch: np.ndarray) -> None:
    """Copy a string's latents from the scratch back to its voice after a quantum, and note its loudness."""
    x, y = motion(voice)
    tension.save(x, y, tension.order_of(voice)[: voice.heard], scratch, string.first)
    voice.moving, loudness = string.moving, tension_program_at(voice.program).loudness
    voice.loudness = (0.5 * math.log(string.total) if string.total > 0 else -1e9) + loudness
