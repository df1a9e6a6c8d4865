"""The sum of all voices, and the function that a sound device calls for it.

`call` is a PortAudio callback: it takes up new voices, renders quanta, and hands them over, in compiled code, in the
device's own thread and without the interpreter. `render` does the same where there is no device.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray, cfunc, njit, types

from engine.kernels import courses
from engine.kernels import layout as at
from engine.kernels.amplifier import amplify
from engine.kernels.compiled import COMPILED
from engine.kernels.contact import sound
from engine.kernels.convolver import convolve
from engine.kernels.limiter import limit
from engine.kernels.memory import fence, pointer
from engine.kernels.playing.events import play
from engine.kernels.sympathy import sympathise
from engine.kernels.voice import add, note_gap, take_over

TONE_HZ, TONE_LEVEL, TONE_FADE_S = 440.0, 0.1, 0.020
UNDERFLOW = 4  # PortAudio's flag


@njit(**COMPILED)
def render(mixer: np.ndarray, frames: int, out: np.ndarray, now_s: float) -> None:
    """The next frames, float32 (frames * channels,)."""
    counts = mixer.view(np.int64)
    channels = counts[at.M_CHANNELS]
    done = 0
    while done < frames:
        if counts[at.M_LEFT] == 0:
            _quantum(mixer, now_s)
            counts[at.M_LEFT] = at.QUANTUM
        begin = at.QUANTUM - counts[at.M_LEFT]
        count = min(frames - done, counts[at.M_LEFT])
        for frame in range(count):
            left, right = mixer[at.M_MIX + 2 * (begin + frame)], mixer[at.M_MIX + 2 * (begin + frame) + 1]
            if channels == 1:
                out[done + frame] = 0.5 * (left + right)
            else:
                out[(done + frame) * channels] = left
                out[(done + frame) * channels + 1] = right
                for channel in range(2, channels):
                    out[(done + frame) * channels + channel] = 0.0
        counts[at.M_LEFT] -= count
        counts[at.M_FRAMES] += count
        done += count


@njit(inline="always", **COMPILED)
def _quantum(mixer: np.ndarray, now_s: float) -> None:
    counts = mixer.view(np.int64)
    mixer[at.M_MIX : at.M_MIX + 2 * at.QUANTUM] = 0.0
    _take_up(counts)
    player, before = counts[at.M_PLAYER], counts[at.M_PLAYER_BEFORE]
    fence()
    if before == player:
        before = 0
    if before != 0:
        play(before, counts[at.M_ADDRESS])
    if player != 0:
        play(player, counts[at.M_ADDRESS])
    for place in range(counts[at.M_ACTIVE]):  # before any sounds on
        voice = carray(pointer(counts[at.M_VOICES + place]), (1 << 40,), np.float64)
        whole = voice.view(np.int64)
        while whole[at.PREVIOUS_VOICE] != 0 and whole[at.BEGIN_AT] < counts[at.M_FRAMES] + at.QUANTUM:
            take_over(voice, counts[at.M_FRAMES], mixer[at.M_SCRATCH : at.M_AMPLIFIER])
    given_s = now_s + at.AHEAD / mixer[at.M_RATE] if counts[at.M_LIMITING] else now_s
    _add_voices(mixer, 1, given_s)
    if before != 0:
        sound(before, counts[at.M_ADDRESS])
        sympathise(before, counts[at.M_ADDRESS])
    if player != 0:
        sound(player, counts[at.M_ADDRESS])
        sympathise(player, counts[at.M_ADDRESS])
    amplify(mixer)
    convolve(mixer)
    _add_voices(mixer, 0, given_s)
    _finish(mixer)


@njit(**COMPILED)
def _add_voices(mixer: np.ndarray, of_instrument: int, given_s: float) -> None:
    """Adds the next quantum of an instrument's voices (1), or of all others (0), to the mix."""
    counts, kept = mixer.view(np.int64), 0
    for place in range(counts[at.M_ACTIVE]):
        address = counts[at.M_VOICES + place]
        voice = carray(pointer(address), (1 << 40,), np.float64)
        if voice.view(np.int64)[at.OF_INSTRUMENT] == of_instrument:
            if voice.view(np.int64)[at.COURSE] != 0:
                state = courses.add(mixer, place, given_s)
            else:
                state = add(voice, mixer, given_s)
            fence()
            voice.view(np.int64)[at.STATE] = state  # one that is over may be freed from here on
            if state != at.SOUNDING and state != at.WAITING:
                continue
        counts[at.M_VOICES + kept] = address
        kept += 1
    fence()
    counts[at.M_ACTIVE] = kept


@njit(**COMPILED)
def _take_up(counts: np.ndarray) -> None:
    """Voices that were handed over; beyond the last place they are refused, and over."""
    pushed = counts[at.M_PUSHED]
    fence()
    while counts[at.M_TAKEN] < pushed:
        address = counts[at.M_RING + counts[at.M_TAKEN] % at.RING]
        if counts[at.M_ACTIVE] < at.MOST_VOICES:
            counts[at.M_VOICES + counts[at.M_ACTIVE]] = address
            counts[at.M_ACTIVE] += 1
        else:
            voice = carray(pointer(address), (1 << 40,), np.int64)
            voice[at.STATE] = at.OVER
        fence()
        counts[at.M_TAKEN] += 1


@njit(**COMPILED)
def _finish(mixer: np.ndarray) -> None:
    """Volume, test tone, limiter and meter."""
    counts = mixer.view(np.int64)
    volume, wanted, smoothing = mixer[at.M_VOLUME], mixer[at.M_WANTED_VOLUME], mixer[at.M_SMOOTHING]
    for frame in range(at.QUANTUM):
        if volume != wanted:
            volume = wanted + (volume - wanted) * smoothing
            if abs(volume - wanted) < 1e-7:
                volume = wanted
        left = mixer[at.M_MIX + 2 * frame] * volume
        right = mixer[at.M_MIX + 2 * frame + 1] * volume
        if counts[at.M_TONE_FRAME] < counts[at.M_TONE_LENGTH]:
            now, length = counts[at.M_TONE_FRAME], counts[at.M_TONE_LENGTH]
            envelope = min(1.0, min(now, length - now) / (TONE_FADE_S * mixer[at.M_RATE]))
            wave = TONE_LEVEL * envelope * math.sin(2 * math.pi * TONE_HZ * now / mixer[at.M_RATE])
            if counts[at.M_TONE_SIDE] & 1:
                left += wave
            if counts[at.M_TONE_SIDE] & 2:
                right += wave
            counts[at.M_TONE_FRAME] = now + 1
        if not (abs(left) < 1e6 and abs(right) < 1e6):  # voices are watched; this is the last line of defence
            left = right = 0.0
            counts[at.M_NON_FINITE] += 1
        mixer[at.M_MIX + 2 * frame], mixer[at.M_MIX + 2 * frame + 1] = left, right
    mixer[at.M_VOLUME] = volume
    if counts[at.M_LIMITING]:
        limit(mixer)
    peak = mixer[at.M_PEAK]
    for slot in range(at.M_MIX, at.M_MIX + 2 * at.QUANTUM):
        peak = max(peak, abs(mixer[slot]))
    mixer[at.M_PEAK] = peak


@cfunc(
    types.int32(types.voidptr, types.voidptr, types.uint64, types.voidptr, types.uint64, types.voidptr),
    nopython=True,
    cache=COMPILED["cache"],
    error_model="numpy",
)
def call(_input, output, frames, times, flags, user):  # type: ignore[no-untyped-def]
    """PaStreamCallback; `user` is the mixer."""
    mixer = carray(user, (at.MIXER_SLOTS,), np.float64)
    counts = mixer.view(np.int64)
    clock = carray(times, (3,), np.float64)
    now_s, dac_s, count = clock[1], clock[2], np.int64(frames)
    sounding = counts[at.M_ACTIVE] > 0
    length_s = count / mixer[at.M_RATE]
    missed_s = dac_s - mixer[at.M_DAC_S] - length_s
    if flags & UNDERFLOW and counts[at.M_CALLS] > 0:
        counts[at.M_UNDERFLOWS] += 1
        if sounding:
            note_gap(mixer, counts[at.M_FRAMES], 1000 * max(missed_s, 0.0), at.CAUSE_DEVICE)
    mixer[at.M_NOW_S], mixer[at.M_DAC_S] = now_s, dac_s
    counts[at.M_CALLS] += 1
    block = carray(output, (count * counts[at.M_CHANNELS],), np.float32)
    render(mixer, count, block, now_s)
    return 0
