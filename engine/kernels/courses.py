"""Strings of a course that stand on one bridge, and ring in step: energy passes between them, both ways.

The bridge, of conductance G, moves with the sum of the forces of all strings on it. For the same partial of strings
that are nearly in unison that is one damper for the sum of their speeds v, in place of one for each:

    dv_i/dt = … - 2 s_i Σ_j s_j v_j,        s_i² = T_i G/ℓ_i,

s_i² being what string i alone loses to the bridge (`engine.resonators.polarised`). So n strings in phase decay n
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
from numba import njit

from engine.kernels import lanes, tension, truth, voice
from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.constants import MOST_PAIRS
from engine.kernels.memory import fence, reals, wholes
from engine.kernels.modes import following, row

MOST = at.MOST_COURSE
SHARED = 2 * MOST_PAIRS  # modes of a string that have a part in the bridge, at most
PARTS = lanes.PARTS * SHARED  # slots of all their parts

# Slots of a string that is generated, in the mixer's scratch; its parts follow, then its modes in blocks
FIRST, NEAR, MOVING, NODES, EARS, APART, SUB_STEPS = range(7)  # W
STRETCH, SECOND, TOTAL, SILENCE = range(7, 11)  # R
HEARD = 12  # R two for each ear
RECORD = HEARD + 2 * lanes.MOST_EARS


@njit(inline="always", **COMPILED)
def _out(mixer: np.ndarray, which: int) -> np.ndarray:
    """The output of a string of the course, (4, QUANTUM)."""
    first = at.M_OUT + which * 4 * at.QUANTUM
    return mixer[first : first + 4 * at.QUANTUM].reshape(4, at.QUANTUM)


@njit(**COMPILED)
def _joins(course: int, late: int, address: int, now: int) -> bool:
    """Return True if a voice is a string of a course that begins in step in the mixer's next quantum."""
    counts = wholes(address)
    if counts[at.COURSE] != course or counts[at.COURSE_DONE] == now + 1:
        return False
    if counts[at.STATE] == at.WAITING:
        begins = counts[at.BEGIN_AT] < now + at.QUANTUM
        return begins and max(counts[at.LATE], counts[at.BEGIN_AT] - now) == late
    return counts[at.STATE] == at.SOUNDING and counts[at.LATE] == late


@njit(**COMPILED)
def add(mixer: np.ndarray, place: int, now_s: float) -> int:
    """Add the next quantum of the course of an active voice, by its place, to the mix.

    Returns the state of that voice.

    Others of the course have theirs from here on, and only give it at their own places.
    """
    counts, own = mixer.view(np.int64), mixer.view(np.int64)[at.M_VOICES + place]
    now, course = counts[at.M_FRAMES], wholes(own)[at.COURSE]
    if wholes(own)[at.COURSE_DONE] == now + 1:
        return wholes(own)[at.STATE]
    state = voice.begin(reals(own), mixer)
    if state != at.SOUNDING:
        return state
    late, strings = wholes(own)[at.LATE], 1
    counts[at.M_COURSE] = own
    for each in range(place + 1, counts[at.M_ACTIVE]):
        other = counts[at.M_VOICES + each]
        if strings < MOST and _joins(course, late, other, now) and voice.begin(reals(other), mixer) == at.SOUNDING:
            counts[at.M_COURSE + strings] = other
            strings += 1
    for turn in range(2):  # those first that are behind the others, as a pick-up of velocity is as it begins
        generated = 0
        for string in range(MOST):
            address = counts[at.M_COURSE + string] if string < strings else 0
            if turn == 0 and address != 0:
                behind = wholes(address)[at.VELOCITY] != 0 and voice.is_first(reals(address))
                address = address if behind else 0
            counts[at.M_COURSE + MOST + string] = address
            generated += address != 0
        if generated > 0:
            _generate(mixer, turn == 0)
    for string in range(strings):
        address, out = counts[at.M_COURSE + string], _out(mixer, string)
        each = reals(address)
        if wholes(address)[at.VELOCITY]:
            voice.differentiate(each, out, mixer[at.M_TAPS : at.M_TAPS + 2 * at.REACH + 1])
        state = voice.end(each, mixer, now_s, out, True)
        wholes(address)[at.COURSE_DONE] = now + 1
        fence()
        wholes(address)[at.STATE] = state
    return wholes(own)[at.STATE]


@njit(**COMPILED)
def _generate(mixer: np.ndarray, first: bool) -> None:
    """The next quantum of strings whose addresses are in the second half of `M_COURSE`.

    Args:
        first: whether those that sense velocity are behind the others.
    """
    counts, scratch = mixer.view(np.int64), mixer[at.M_SCRATCH : at.M_AMPLIFIER]
    place, strings, solved, shared = lanes.aligned(scratch), 0, False, 0
    sums = scratch[place : place + SHARED]
    places = scratch.view(np.int64)[place + SHARED : place + SHARED + 2 * MOST]  # first slots, and which strings
    place += SHARED + lanes.LANES * lanes.blocks_of(2 * MOST)
    for string in range(MOST):
        address = counts[at.M_COURSE + MOST + string]
        if address == 0:
            continue
        solved = wholes(address)[at.KIND] == at.TRUTH
        places[strings], places[MOST + strings] = place, counts[at.M_COURSE + MOST + string]
        place = _set_up(reals(address), scratch, place, solved)
        shared = max(shared, min(wholes(address)[at.BRIDGED], wholes(address)[at.MOVING]))
        strings += 1
    _take_parts(places, strings, shared, 1 / mixer[at.M_RATE], scratch, sums)
    if solved:
        _ring_solved(mixer, places, strings, shared, scratch, sums)
    else:
        _ring(mixer, places, strings, shared, scratch)
    for string in range(strings):
        address, out = places[MOST + string], _out(mixer, _number(counts, places[MOST + string]))
        each, heard = reals(address), voice.is_heard(reals(address))
        if not solved:
            _put_back(each, scratch, places[string])
        wholes(address)[at.GENERATED] += at.QUANTUM
        if wholes(address)[at.NEXT_WEIGHTS] == 1:
            voice.move_points(each, heard, mixer[at.M_RATE], out)
        if wholes(address)[at.VELOCITY]:
            voice.remember(each, heard, first, out)


@njit(**COMPILED)
def _number(counts: np.ndarray, address: int) -> int:
    """The number of a voice's string in its course."""
    number = 0
    while counts[at.M_COURSE + number] != address:
        number += 1
    return number


@njit(**COMPILED)
def _ring(mixer: np.ndarray, places: np.ndarray, strings: int, shared: int, scratch: np.ndarray) -> None:
    """A quantum of latents that share a tension."""
    counts, blocks = mixer.view(np.int64), lanes.blocks_of(shared)
    one, other, third = places[0] + RECORD, places[min(1, strings - 1)] + RECORD, places[strings - 1] + RECORD
    parts, modes = (one, other, third), (one + PARTS, other + PARTS, third + PARTS)
    for frame in range(at.QUANTUM):
        for string in range(strings):
            address = places[MOST + string]
            _advance(reals(address), scratch, places[string], frame, _out(mixer, _number(counts, address)))
        if strings == 1:
            lanes.meet_1(scratch, blocks, modes[0], modes[1], modes[2], parts[0], parts[1], parts[2])
        elif strings == 2:
            lanes.meet_2(scratch, blocks, modes[0], modes[1], modes[2], parts[0], parts[1], parts[2])
        else:
            lanes.meet_3(scratch, blocks, modes[0], modes[1], modes[2], parts[0], parts[1], parts[2])


@njit(**COMPILED)
def _ring_solved(
    mixer: np.ndarray, places: np.ndarray, strings: int, shared: int, scratch: np.ndarray, sums: np.ndarray
) -> None:
    """A quantum of strings that are solved."""
    counts = mixer.view(np.int64)
    for frame in range(at.QUANTUM):
        for string in range(strings):
            address = places[MOST + string]
            each, whole, out = reals(address), wholes(address), _out(mixer, _number(counts, address))
            sub_steps, fading = scratch.view(np.int64)[places[string] + SUB_STEPS], whole[at.NEXT_WEIGHTS] == 1
            truth.advance(each, reals(whole[at.PROGRAM]), sub_steps, frame, fading, voice.is_heard(each), out)
        sums[:shared] = 0.0
        for string in range(strings):
            speeds, parts = _speeds(places[MOST + string], shared), scratch[places[string] + RECORD :]
            for mode in range(len(speeds)):
                sums[mode] += parts[mode] * speeds[mode]
        for string in range(strings):
            speeds, parts = _speeds(places[MOST + string], shared), scratch[places[string] + RECORD + 2 * SHARED :]
            for mode in range(len(speeds)):
                speeds[mode] -= parts[mode] * sums[mode]


@njit(inline="always", **COMPILED)
def _speeds(address: int, shared: int) -> np.ndarray:
    """Speeds of a solved string's first modes."""
    n = wholes(address)[at.MODES]
    return row(reals(address), n, 1)[: min(n, shared)]


@njit(**COMPILED)
def _set_up(string: np.ndarray, scratch: np.ndarray, place: int, solved: bool) -> int:
    """Prepare a string for a quantum, with its record from a slot of the scratch on.

    Returns the first slot behind it.
    """
    counts, whole = string.view(np.int64), scratch.view(np.int64)
    program, n = reals(counts[at.PROGRAM]), counts[at.MODES]
    if solved:
        whole[place + SUB_STEPS] = truth.set_up(string, program)
        return place + RECORD + PARTS
    tension.bring_up_to_date(string, program)
    moving = counts[at.MOVING]
    counts[at.HEARD] = counts[at.FELT] = moving
    x, y, rows = row(string, n, 0), row(string, n, 1), following(string, n)
    order = row(string, n, at.ORDER).view(np.int64)[:moving]
    first, near = place + RECORD + PARTS, lanes.blocks_of(moving)
    tension.load(x, y, rows, order, scratch, first)
    for number in range(lanes.LANES * near, SHARED):  # these rest
        slot = first + lanes.place(number)
        scratch[slot] = scratch[slot + lanes.LANES] = 0.0
    points = counts[at.POINTS]
    ears = (2 if counts[at.NEXT_WEIGHTS] == 1 else 1) * points if voice.is_heard(string) else 0
    for ear in range(ears):
        slot = at.weights(n, ear // points, ear % points, 0)
        tension.load_weights(string[slot : slot + n], order, scratch, first, ear)
    whole[place + FIRST], whole[place + NEAR], whole[place + MOVING] = first, near, moving
    whole[place + NODES], whole[place + EARS] = counts[at.STEPS], ears
    whole[place + APART] = 2 if points == 1 else 1
    heard = scratch[place + HEARD : place + RECORD]
    scratch[place + STRETCH], scratch[place + SECOND] = lanes.add_up(scratch, first, near, 0, ears, heard)
    scratch[place + TOTAL], scratch[place + SILENCE] = 0.0, program[at.S_SILENCE]
    return first + lanes.slots(max(n, SHARED))


@njit(**COMPILED)
def _take_parts(
    places: np.ndarray, strings: int, shared: int, step_s: float, scratch: np.ndarray, sums: np.ndarray
) -> None:
    """Compute the parts of strings' modes in the bridge's motion, and what that takes from them in a frame.

    A mode that rests has no part, so that it is not moved; one that others have not loses as much as alone.
    """
    sums[:shared] = 0.0
    for string in range(strings):
        each, whole = reals(places[MOST + string]), wholes(places[MOST + string])
        lost = row(each, whole[at.MODES], at.BRIDGE)
        for mode in range(min(shared, whole[at.BRIDGED], whole[at.MOVING])):
            sums[mode] += lost[mode]
    for string in range(strings):
        each, whole, first = reals(places[MOST + string]), wholes(places[MOST + string]), places[string] + RECORD
        n, own = whole[at.MODES], min(shared, whole[at.BRIDGED], whole[at.MOVING])
        parts = scratch[first : first + PARTS].reshape(lanes.PARTS, SHARED)
        parts[:] = 0.0
        lost, sigmas, squares = row(each, n, at.BRIDGE), row(each, n, at.SIGMA), following(each, n)[6]
        if whole[at.KIND] == at.TRUTH:
            for mode in range(own):
                part = math.sqrt(lost[mode])
                parts[0, mode], parts[2, mode] = part, part * (2 * step_s / (1 + step_s * sums[mode]))
        else:
            for mode in range(own):  # v = -(ω y + σ x)
                part, omega = math.sqrt(lost[mode]), math.sqrt(squares[mode])
                parts[0, mode], parts[1, mode] = part * omega, part * sigmas[mode]
                parts[2, mode] = part / omega * (2 * step_s / (1 + step_s * sums[mode]))


@njit(inline="always", **COMPILED)
def _advance(string: np.ndarray, scratch: np.ndarray, place: int, frame: int, out: np.ndarray) -> None:
    """Advance latents that share a tension by one frame, after it is heard: as `tension.generate`."""
    whole = scratch.view(np.int64)
    first, near, ears = whole[place + FIRST], whole[place + NEAR], whole[place + EARS]
    heard, largest = scratch[place + HEARD : place + RECORD], string[at.LARGEST_STRETCH]
    sums, nothing = (scratch[place + STRETCH], scratch[place + SECOND]), (0.0, 0.0)
    for ear in range(ears):
        out[whole[place + APART] * ear, frame] = heard[2 * ear] - sums[0] * heard[2 * ear + 1]
    for _ in range(whole[place + NODES] - 1):
        sums = tension.node(scratch, first, near, 0, 0, sums, nothing, largest, heard)
    sums = tension.node(scratch, first, near, 0, ears, sums, nothing, largest, heard)
    string[at.LARGEST_ENERGY] *= string[at.DECAY]
    if frame % 16 == 15:
        total, held = tension.hold(scratch, first, near, string[at.LARGEST_ENERGY])
        before = whole[place + MOVING]
        moving = tension.trim(scratch, first, before, scratch[place + SILENCE], total)
        near = lanes.blocks_of(moving)
        if held or moving < before or total < tension.NOTHING:
            sums = lanes.add_up(scratch, first, near, 0, ears, heard)
        whole[place + NEAR], whole[place + MOVING], scratch[place + TOTAL] = near, moving, total
    scratch[place + STRETCH], scratch[place + SECOND] = sums


@njit(**COMPILED)
def _put_back(string: np.ndarray, scratch: np.ndarray, place: int) -> None:
    """A string as it is after a quantum."""
    counts, whole = string.view(np.int64), scratch.view(np.int64)
    n, total = counts[at.MODES], scratch[place + TOTAL]
    order = row(string, n, at.ORDER).view(np.int64)[: counts[at.HEARD]]
    tension.save(row(string, n, 0), row(string, n, 1), order, scratch, whole[place + FIRST])
    counts[at.MOVING] = whole[place + MOVING]
    program = reals(counts[at.PROGRAM])
    string[at.LOUDNESS] = (0.5 * math.log(total) if total > 0 else -1e9) + program[at.S_LOUDNESS]
