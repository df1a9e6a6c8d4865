"""Sounds, voices and errors that tests of kernels and voices share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from engine.effects import Effects
from engine.kernels.amplifier import amplify, drive
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import LARGEST, MIXER, SMALLEST
from engine.pluck import Pluck
from engine.presets import Preset, PresetInfo
from engine.values.effects import Amp
from engine.voices import Mixer, Voice, plain_program

RATE_HZ = 48_000

Signal = NDArray[np.float64]
Samples = NDArray[np.float32]
Rung = Callable[..., Signal]  # fixtures of `conftest.py`
Strike = Callable[..., Voice]
Shipped = Callable[[str], Preset]
Initial = Callable[[PresetInfo, Pluck], Signal]
Info = Callable[[bool], PresetInfo]


def relative(found: Signal, expected: Signal) -> float:
    assert found.shape == expected.shape
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def noise(frames: int, points: int = 2, level: float = 0.4, seed: int = 1) -> Samples:
    return np.random.default_rng(seed).uniform(-level, level, (frames, points)).astype(np.float32)


def voice_of(samples: Samples, gain: float = 1.0, rate_hz: int = RATE_HZ) -> Voice:
    """A voice of samples, which sound from the first on as they are."""
    voice = Voice.of_samples(plain_program(rate_hz), samples)
    voice.start_with_gain(gain)
    voice.record["attack"] = 0
    return voice


def mixer_of(*voices: Voice, rate_hz: int = RATE_HZ, limited: bool = False) -> Mixer:
    mixer = Mixer(rate_hz, limited=limited)
    mixer.add(*voices)
    return mixer


def faded(frames: int) -> Signal:
    """The share of a fade's way that is done, frame by frame."""
    share = np.arange(1, frames + 1) / frames
    return np.asarray(share**2 * (3 - 2 * share))


def apply(effects: Effects | None, sound: NDArray[np.floating], rate_hz: int) -> Signal:
    """Apply these effects to sound (frames, 1 or 2) as a mixer does: its first frames, as many, (frames, 2).

    Give silence after the sound where the end shall ring out, `Effects.tail_s`. Samples that are no numbers, and
    those too large or too small to be sound, are taken as silence, as the mixer does.
    """
    stereo = np.broadcast_to(sound, (len(sound), 2)).astype(np.float64)
    if effects is None or not len(stereo):
        return stereo
    wild = ~(np.abs(stereo) < LARGEST).all(1)
    stereo[wild] = 0.0
    stereo[np.abs(stereo) < SMALLEST] = 0.0
    if effects.amp is not None and effects.amp.drive_db:
        stereo = amplified(effects.amp, stereo, rate_hz, effects.level_db)
    if not effects.rings:
        return stereo
    wet: Signal = oaconvolve(stereo, effects.impulse(rate_hz), axes=0)[: len(stereo)]
    return wet


def amplified(amp: Amp, sound: Signal, rate_hz: int, level_db: float = 0.0) -> Signal:
    """The sound (frames, 2) through the amplifier of a mixer: its first frames, as many."""
    mixer = np.zeros(1, MIXER)[0]
    mix = mixer["mix"]
    mixer["rate_hz"] = rate_hz
    drive(mixer, float(amp.drive_db), float(amp.tone_db), float(level_db))
    blocks = np.zeros((-(-len(sound) // QUANTUM) * QUANTUM, 2))
    blocks[: len(sound)] = sound
    for first in range(0, len(blocks), QUANTUM):
        mix[:] = blocks[first : first + QUANTUM]
        amplify(mixer)
        blocks[first : first + QUANTUM] = mix
        mixer["frames"] += QUANTUM
    return blocks[: len(sound)]
