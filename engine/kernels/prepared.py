"""Body and room of a plug-in's instrument: their responses at its rate, in partitions, and the mix of them.

A plug-in computes the responses beside the sound, and mixes their partitions a part a quantum.
"""

from __future__ import annotations

import numpy as np
from numba import carray

from engine.kernels import bodies, responses, rooms
from engine.kernels import constants as of
from engine.kernels.bodies import given_frames, rung_frames
from engine.kernels.compiled import kernel
from engine.kernels.convolver import BEHIND_IMPULSE, convolver_slots, partition, partitioned_slots
from engine.kernels.fields import slots
from engine.kernels.fourier import COSINES, ROWS, SINES, fill_circle, power_of_two
from engine.kernels.memory import (
    address_of,
    behind,
    body_at,
    impulse_at,
    needs_at,
    part,
    pointer,
    reals,
    responses_at,
    shaped,
)
from engine.kernels.mixer_records import WINDOW
from engine.kernels.records import BODY, RESPONSES, Body
from engine.kernels.responses import curves_size, resampled_frames, work_size

NOISE_UNIT = 2.0**-28  # of the noise that rooms share, which stays below 8
CURVES_HZ = float(of.CURVES_HZ)
BODY_SLOTS, RESPONSES_SLOTS = slots(BODY), slots(RESPONSES)


@kernel
def body_frames(body: Body, size: float, rate_hz: float) -> int:
    """The length of a body's response; 0: there is none."""
    if body.frames > 0:
        return given_frames(body.frames, body.hz, size, rate_hz, body.longest_s)
    return rung_frames(body.seconds, size, rate_hz) if body.modes > 0 else 0


@kernel
def longest(body: Body, rate_hz: float, size: float, t60_s: float) -> int:
    """The length of body and room in series."""
    room = resampled_frames(rooms.room_frames(t60_s), of.ROOM_HZ, rate_hz)
    return room + max(body_frames(body, size, rate_hz) - 1, 0)


@kernel
def width(body: Body, rate_hz: float, size: float, t60_s: float) -> int:
    """The width of a work space for responses of a body and a room."""
    slots = max(2 * WINDOW, int(rate_hz), longest(body, rate_hz, size, t60_s))
    slots = max(slots, work_size(rooms.room_frames(t60_s), of.ROOM_HZ, rate_hz))
    for hz in (rate_hz, CURVES_HZ):
        frames = body_frames(body, size, hz)
        slots = max(slots, curves_size(frames), 2 * frames)
        if body.frames > 0:
            slots = max(slots, work_size(body.frames, body.hz / size, hz))
    return power_of_two(slots)


@kernel
def measure(body_address: int, rate_hz: float, size: float, t60_s: float, needs_address: int) -> None:
    """Write into NEEDS the slots of memory that `prepare` and a convolver need for a body and a room."""
    body, needs = body_at(body_address), needs_at(needs_address)
    needs.frames = longest(body, rate_hz, size, t60_s)
    needs.part = partitioned_slots(needs.frames, 2)
    needs.found = RESPONSES_SLOTS + 3 * needs.part
    sounds = max(rooms.room_frames(t60_s), body.frames) + body_frames(body, size, CURVES_HZ) + 2 * needs.frames + 1
    needs.memory = ROWS * width(body, rate_hz, size, t60_s) + 2 * sounds
    needs.convolver = convolver_slots(needs.frames)


@kernel
def prepare(
    body_address: int,
    noise_address: int,
    rate_hz: float,
    size: float,
    t60_s: float,
    found_address: int,
    memory_address: int,
) -> None:
    """Write RESPONSES of a body and a room, and behind them the responses in partitions: body, room, both.

    Each argument stands for itself in C.

    Args:
        rate_hz: of the responses.
        size: of the body, a factor of its lengths.
        t60_s: of the room.
        noise_address: 32-bit whole numbers (frames, 2), of NOISE_UNIT.
        found_address: all 0, as many slots as `measure` found.
        memory_address: room to work in, as many slots as `measure` found.
    """
    body = body_at(body_address)
    prepared = responses_at(found_address)
    memory = reals(memory_address)
    wide = width(body, rate_hz, size, t60_s)
    work = shaped(memory, 0, (ROWS, wide))
    fill_circle(work[COSINES], work[SINES])
    body_part, frames = body_frames(body, size, rate_hz), longest(body, rate_hz, size, t60_s)
    first, room_frames = ROWS * wide, rooms.room_frames(t60_s)
    one = shaped(memory, first, (body_part, 2))
    other = shaped(memory, first + 2 * body_part, (frames - max(body_part - 1, 0), 2))
    both = shaped(memory, first + 2 * (frames + 1), (frames, 2))
    scratch = part(memory, first + 2 * (2 * frames + 1), 1 << 40)
    if body_part > 0:
        _respond(work, body, size, rate_hz, scratch, one)
    noise, made = carray(pointer(noise_address), (room_frames, 2), np.int32), shaped(scratch, 0, (room_frames, 2))
    for frame in range(room_frames):
        made[frame, 0], made[frame, 1] = NOISE_UNIT * noise[frame, 0], NOISE_UNIT * noise[frame, 1]
    rooms.respond(work, t60_s, made, rate_hz, other)
    if body_part > 0:
        responses.series(work, one, other, both)
    responses.all_powers(work, one, other, rate_hz, prepared.powers)
    prepared.part = partitioned_slots(frames, 2)
    for number in range(3):
        response = one if number == 0 else other if number == 1 else both
        if number == 1 or body_part > 0:
            place = address_of(prepared) + 8 * (RESPONSES_SLOTS + number * prepared.part)
            partition(work, response, frames, impulse_at(place))
    curve_frames = body_frames(body, size, CURVES_HZ)
    if curve_frames > 0:
        response = shaped(scratch, 2 * body.frames, (curve_frames, 2))
        _respond(work, body, size, CURVES_HZ, scratch, response)
        responses.curves(work, response, prepared.curves)


@kernel
def _respond(
    work: np.ndarray, body: Body, size: float, rate_hz: float, scratch: np.ndarray, response: np.ndarray
) -> None:
    """Write the response of a body; `scratch` has room for the samples of one that is given."""
    if body.frames == 0:
        modes = shaped(reals(address_of(body)), BODY_SLOTS, (4, body.modes))
        bodies.respond(work, modes, body.subsonic_hz, size, rate_hz, response)
        return
    samples = carray(pointer(address_of(body) + 8 * BODY_SLOTS), (body.frames, body.channels), np.int32)
    recorded = shaped(scratch, 0, (body.frames, 2))
    for frame in range(body.frames):
        recorded[frame, 0] = body.unit * samples[frame, 0]
        recorded[frame, 1] = body.unit * samples[frame, body.channels - 1]
    bodies.respond_as(work, recorded, body.hz, size, rate_hz, response)


@kernel
def weigh(found_address: int, body_mix: float, room_mix: float, weights_address: int) -> None:
    """Write the weights (4,) of a mix of nothing, body, room and both, of which body and room are heard 0 … 1."""
    responses.weigh(responses_at(found_address).powers, body_mix, room_mix, part(reals(weights_address), 0, 4))


@kernel
def mix(found_address: int, weights_address: int, into_address: int, first: int, count: int) -> None:
    """Write `count` slots, from `first` on, of a mix of the responses as the convolver reads it.

    Its weights (4,) are those of `weigh`; that of nothing, the direct sound, is a sample at the beginning.
    """
    prepared = responses_at(found_address)
    weights, into = reals(weights_address), reals(into_address)
    end = min(first + count, prepared.part)
    for place in range(first, end):
        into[place] = 0.0
    for number in range(3):
        weight, part_slot = weights[1 + number], RESPONSES_SLOTS + number * prepared.part
        response = behind(prepared, part_slot, prepared.part)
        if weight != 0.0:
            for place in range(first, end):
                into[place] += weight * response[place]
    for channel in range(2):  # a single sample at the beginning: the same at all frequencies
        begin = BEHIND_IMPULSE + channel * 2 * (of.QUANTUM + 1)
        for place in range(max(begin, first), min(begin + of.QUANTUM + 1, end)):
            into[place] += weights[0] / (2 * of.QUANTUM)
    if first == 0:
        room = behind(prepared, RESPONSES_SLOTS + prepared.part, BEHIND_IMPULSE)
        into.view(np.int64)[:BEHIND_IMPULSE] = room.view(np.int64)
