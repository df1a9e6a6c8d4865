"""Entries of a native plug-in: the functions that its C shell calls, with addresses and counts as plain numbers.

They are compiled for other systems too (`app.export.plugin.objects`), so nothing here or below may need Python.
"""

from __future__ import annotations

import numpy as np
from numba import carray, njit, types

from engine.kernels import contact, kit, mixer, sympathy
from engine.kernels.compiled import COMPILED
from engine.kernels.constants import QUANTUM
from engine.kernels.convolver import BEHIND_IMPULSE
from engine.kernels.fourier import transform
from engine.kernels.memory import convolver_at, impulse_at, pointer, reals, shaped
from engine.kernels.memory import mixer_at as record_of_mixer
from engine.kernels.mixer_records import EARLY, WINDOW, Convolver
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
    mixer.render(record_of_mixer(mixer_at), frames, carray(pointer(out_at), (2 * frames,), np.float32), 0.0)


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
def partition(response_at: int, frames: int, channels: int, memory_at: int, work_at: int) -> None:
    """Writes an impulse response as the convolver reads it: see `engine.effects.partitions.partitioned`.

    Args:
        response_at: float64 (frames, channels).
        memory_at: room for header and spectra.
        work_at: a convolver, whose tables and work space are used; it must not be at work.
    """
    response = shaped(reals(response_at), 0, (frames, channels))
    impulse, convolver, memory = impulse_at(memory_at), convolver_at(work_at), reals(memory_at)
    early_frames = min(frames, EARLY * QUANTUM)
    impulse.channels, impulse.early = channels, (early_frames + QUANTUM - 1) // QUANTUM
    impulse.late = (frames - early_frames + WINDOW - 1) // WINDOW
    place = BEHIND_IMPULSE
    for number in range(impulse.early):
        part = response[number * QUANTUM : min((number + 1) * QUANTUM, early_frames)]
        _spectra(convolver, part, shaped(memory, place, (channels, 2, QUANTUM + 1)))
        place += channels * 2 * (QUANTUM + 1)
    for number in range(impulse.late):
        first = early_frames + number * WINDOW
        part = response[first : min(first + WINDOW, frames)]
        _spectra(convolver, part, shaped(memory, place, (channels, 2, WINDOW + 1)))
        place += channels * 2 * (WINDOW + 1)


@njit(**COMPILED)
def _spectra(convolver: Convolver, part: np.ndarray, spectra: np.ndarray) -> None:
    """Writes the spectra (channels, 2, length + 1) of a partition, (length, channels) or fewer frames."""
    length = spectra.shape[2] - 1
    n, work, cosines, sines = 2 * length, convolver.work[:], convolver.cosines[:], convolver.sines[:]
    re, im, re2, im2 = work[0, :n], work[1, :n], work[2, :n], work[3, :n]
    for channel in range(len(spectra)):
        re[:], im[:] = 0.0, 0.0
        for frame in range(len(part)):
            re[frame] = part[frame, channel]
        transform(re, im, re2, im2, cosines, sines)
        for frequency in range(length + 1):
            spectra[channel, 0, frequency] = re[frequency] / n
            spectra[channel, 1, frequency] = im[frequency] / n
