"""Sounds, voices and errors that tests of kernels and voices share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from engine.pluck import Pluck
from engine.presets import Preset, PresetInfo
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
