"""The sum of all voices, and the function that a sound device calls for it.

`call` is a PortAudio callback: it takes up new voices, renders quanta, and hands them over, in compiled code, in the
device's own thread and without the interpreter. Where there is no device Python calls it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray, cfunc, types

from engine.kernels import courses
from engine.kernels import voice_records as at
from engine.kernels.amplifier import amplify
from engine.kernels.compiled import COMPILED, inlined, kernel
from engine.kernels.constants import AHEAD, QUANTUM
from engine.kernels.contact import sound
from engine.kernels.convolver import convolve
from engine.kernels.limiter import limit
from engine.kernels.memory import address_of, fence, mixer_at, voice_at
from engine.kernels.mixer_records import CAUSE_DEVICE, LARGEST, MOST_VOICES, RING, Mixer
from engine.kernels.playing.events import play
from engine.kernels.sympathy import sympathise
from engine.kernels.voice import note_gap, take_over

TONE_HZ = 440.0
TONE_LEVEL = 0.1
TONE_FADE_S = 0.020
UNDERFLOW = 4  # PortAudio's flag


@kernel
def render(mixer: Mixer, frames: int, out: np.ndarray, now_s: float) -> None:
    """Write the next frames, float32 (frames * channels,), channels side by side; `now_s`: the device clock's time.

    One channel has the mean of left and right; further channels than two are silent.
    """
    channels = mixer.channels
    mix = mixer.mix[:]
    done = 0
    while done < frames:
        if mixer.left == 0:
            _quantum(mixer, now_s)
            mixer.left = QUANTUM
        begin = QUANTUM - mixer.left
        count = min(frames - done, mixer.left)
        for frame in range(count):
            left, right = mix[begin + frame, 0], mix[begin + frame, 1]
            place = (done + frame) * channels
            out[place] = left if channels > 1 else 0.5 * (left + right)
            for channel in range(1, channels):
                out[place + channel] = right if channel == 1 else 0.0
        mixer.left -= count
        mixer.frames += count
        done += count


@inlined
def _quantum(mixer: Mixer, now_s: float) -> None:
    """Render the next quantum into the mix: events, voices, noises, sympathy, effects, then volume and limiter.

    A player before this one plays as well, so that its notes ring on. `now_s`: the device clock's time.
    """
    here = address_of(mixer)
    player = mixer.player
    before = mixer.player_before
    mixer.mix[:] = 0.0
    _take_up(mixer)
    fence()
    if before == player:
        before = 0
    if before != 0:
        play(before, here)
    if player != 0:
        play(player, here)
    for place in range(mixer.active):  # before any sounds on
        voice = voice_at(mixer.voices[place])
        while voice.previous_voice != 0 and voice.begin_at < mixer.frames + QUANTUM:
            take_over(voice, mixer.frames, mixer.scratch[:])
    given_s = now_s + AHEAD / mixer.rate_hz if mixer.limiting else now_s  # later by the limiter's delay
    _add_voices(mixer, 1, given_s)
    if before != 0:
        sound(before, here)
        sympathise(before, here)
    if player != 0:
        sound(player, here)
        sympathise(player, here)
    amplify(mixer)
    convolve(mixer)
    _add_voices(mixer, 0, given_s)
    _finish(mixer)


@kernel
def _add_voices(mixer: Mixer, of_instrument: int, given_s: float) -> None:
    """Add the next quantum of an instrument's voices (1), or of all others (0), to the mix."""
    kept = 0
    for place in range(mixer.active):
        address = mixer.voices[place]
        voice = voice_at(address)
        if voice.of_instrument == of_instrument:
            state = courses.add(mixer, place, given_s)
            fence()
            voice.state = state  # one that is over may be freed from here on
            if state != at.SOUNDING and state != at.WAITING:
                continue
        mixer.voices[kept] = address
        kept += 1
    fence()
    mixer.active = kept


@kernel
def _take_up(mixer: Mixer) -> None:
    """Move voices that were handed over from the ring to the active ones; where no place is free they are over."""
    pushed = mixer.pushed
    fence()
    while mixer.taken < pushed:
        address = mixer.ring[mixer.taken % RING]
        if mixer.active < MOST_VOICES:
            mixer.voices[mixer.active] = address
            mixer.active += 1
        else:
            voice_at(address).state = at.OVER
        fence()
        mixer.taken += 1


@kernel
def _finish(mixer: Mixer) -> None:
    """Apply volume, test tone, limiter and meter to the mix; samples that are no numbers or too large become 0."""
    mix = mixer.mix[:]
    volume = mixer.volume
    wanted = mixer.wanted_volume
    for frame in range(QUANTUM):
        if volume != wanted:
            volume = wanted + (volume - wanted) * mixer.smoothing
            if abs(volume - wanted) < 1e-7:
                volume = wanted
        left, right = mix[frame, 0] * volume, mix[frame, 1] * volume
        if mixer.tone_frame < mixer.tone_length:
            now, length = mixer.tone_frame, mixer.tone_length
            envelope = min(1.0, min(now, length - now) / (TONE_FADE_S * mixer.rate_hz))
            wave = TONE_LEVEL * envelope * math.sin(2 * math.pi * TONE_HZ * now / mixer.rate_hz)
            if mixer.tone_side & 1:
                left += wave
            if mixer.tone_side & 2:
                right += wave
            mixer.tone_frame = now + 1
        if not (abs(left) < LARGEST and abs(right) < LARGEST):  # voices are watched; this is the last line of defence
            left = right = 0.0
            mixer.non_finite += 1
        mix[frame, 0], mix[frame, 1] = left, right
    mixer.volume = volume
    if mixer.limiting:
        limit(mixer)
    peak = mixer.peak
    for frame in range(QUANTUM):
        peak = max(peak, abs(mix[frame, 0]), abs(mix[frame, 1]))
    mixer.peak = peak


@cfunc(
    types.int32(types.voidptr, types.voidptr, types.uint64, types.voidptr, types.uint64, types.voidptr),
    nopython=True,
    cache=COMPILED["cache"],
    error_model="numpy",
)
def call(_input, output, frames, times, flags, user):  # type: ignore[no-untyped-def]
    """PortAudio's callback: fill `output`, float32 (frames, channels), and return 0, to continue.

    Args:
        times: three doubles in s, of which the second is now and the third when the first sample is heard.
        user: the mixer.
    """
    mixer = mixer_at(user)
    clock = carray(times, (3,), np.float64)
    now_s = clock[1]
    dac_s = clock[2]
    count = np.int64(frames)
    missed_s = dac_s - mixer.dac_s - count / mixer.rate_hz
    if flags & UNDERFLOW and mixer.calls > 0:
        mixer.underflows += 1
        if mixer.active > 0:
            note_gap(mixer, mixer.frames, 1000 * max(missed_s, 0.0), CAUSE_DEVICE)
    mixer.now_s, mixer.dac_s = now_s, dac_s
    mixer.calls += 1
    block = carray(output, (count * mixer.channels,), np.float32)
    render(mixer, count, block, now_s)
    return 0
