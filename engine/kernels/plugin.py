"""Entries of a native plug-in: the functions that its C shell calls, with addresses and counts as plain numbers.

They are compiled for other systems too (`app.export.plugin.objects`), so nothing here or below may need Python.
"""

from __future__ import annotations

import numpy as np
from numba import carray, njit, types

from engine.kernels import contact, kit, mixer, sympathy
from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.fourier import transform
from engine.kernels.memory import pointer
from engine.kernels.playing import events

ADDRESS = COUNT = types.int64
RENDER = types.void(ADDRESS, COUNT, ADDRESS)
BEGIN = types.void(ADDRESS)
PLAY = SOUND = SYMPATHISE = KIT_BEGIN = types.void(ADDRESS, ADDRESS)
KIT_FOLLOW = types.void(ADDRESS, COUNT, types.float64)
KIT_PREPARE = types.void(ADDRESS, ADDRESS, ADDRESS)
PARTITION = types.void(ADDRESS, COUNT, COUNT, ADDRESS, ADDRESS)


@njit(**COMPILED)
def render(mixer_at: int, frames: int, out_at: int) -> None:
    """The next frames of a mixer, float32 (frames, 2)."""
    memory = carray(pointer(mixer_at), (at.MIXER_SLOTS,), np.float64)
    mixer.render(memory, frames, carray(pointer(out_at), (2 * frames,), np.float32), 0.0)


@njit(**COMPILED)
def begin(player_at: int) -> None:
    """Puts the wheels and pedals of a new player at rest."""
    events.begin(player_at)


@njit(**COMPILED)
def play(player_at: int, mixer_at: int) -> None:
    """Play the events that are due before the mixer's next quantum."""
    events.play(player_at, mixer_at)


kit_begin, kit_follow, kit_prepare = kit.begin, kit.follow, kit.prepare


@njit(**COMPILED)
def sound(player_at: int, mixer_at: int) -> None:
    """Adds what touches strings and drums to the quantum."""
    contact.sound(player_at, mixer_at)


@njit(**COMPILED)
def sympathise(player_at: int, mixer_at: int) -> None:
    """Adds what rings along to the quantum."""
    sympathy.sympathise(player_at, mixer_at)


@njit(**COMPILED)
def partition(response_at: int, frames: int, channels: int, memory_at: int, convolver_at: int) -> None:
    """Writes an impulse response as the convolver reads it: see `engine.effects.partitions.partitioned`.

    Args:
        response_at: float64 (frames, channels).
        memory_at: room for header and spectra.
        convolver_at: whose tables and work space are used; it must not be at work.
    """
    response = carray(pointer(response_at), (1 << 40,), np.float64)
    memory = carray(pointer(memory_at), (1 << 40,), np.float64)
    convolver = carray(pointer(convolver_at), (1 << 40,), np.float64)
    early_frames = min(frames, at.EARLY * at.QUANTUM)
    early = (early_frames + at.QUANTUM - 1) // at.QUANTUM
    late = (frames - early_frames + at.WINDOW - 1) // at.WINDOW
    counts = memory.view(np.int64)
    counts[at.I_CHANNELS], counts[at.I_EARLY], counts[at.I_LATE] = channels, early, late
    place = at.I_HEADER
    for number in range(early):
        place = _spectra(response, number * at.QUANTUM, early_frames, channels, at.QUANTUM, memory, place, convolver)
    for number in range(late):
        first = early_frames + number * at.WINDOW
        place = _spectra(response, first, frames, channels, at.WINDOW, memory, place, convolver)


@njit(**COMPILED)
def _spectra(
    response: np.ndarray,
    first: int,
    end: int,
    channels: int,
    length: int,
    memory: np.ndarray,
    place: int,
    convolver: np.ndarray,
) -> int:
    """Writes the spectra (channels, 2, length + 1) of one partition; the place behind them."""
    n, wide = 2 * length, 2 * at.WINDOW
    re, im = convolver[at.C_WORK : at.C_WORK + n], convolver[at.C_WORK + wide : at.C_WORK + wide + n]
    re2 = convolver[at.C_WORK + 2 * wide : at.C_WORK + 2 * wide + n]
    im2 = convolver[at.C_WORK + 3 * wide : at.C_WORK + 3 * wide + n]
    cosines, sines = convolver[at.C_COSINES : at.C_SINES], convolver[at.C_SINES : at.C_EARLY_INPUT]
    for channel in range(channels):
        re[:], im[:] = 0.0, 0.0
        for frame in range(min(length, end - first)):
            re[frame] = response[(first + frame) * channels + channel]
        transform(re, im, re2, im2, cosines, sines)
        for frequency in range(length + 1):
            memory[place + frequency] = re[frequency] / n
            memory[place + length + 1 + frequency] = im[frequency] / n
        place += 2 * (length + 1)
    return place
