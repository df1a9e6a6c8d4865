"""Shipped presets, voices, what they sound like, and errors, for tests of kernels, voices and effects."""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from engine.effects import Effects
from engine.pluck import Pluck
from engine.presets import SHIPPED, Preset, PresetInfo, load_preset
from engine.resonators.sine_transform import project
from engine.values.ear import Ear
from engine.voices import Mixer, Program, Voice, model_program, plain_program

RATE_HZ = 48_000
KNOWING = "nylon_nonlinear_gaussian_4k_koopman_integrated"
STEEL = "studio_steel_e4"
PLUCK, EAR = Pluck(0.3), Ear((0.37,))

Signal = NDArray[np.float64]
Samples = NDArray[np.float32]


@cache
def shipped(name: str) -> Preset:
    """A shipped preset by its name; nobody may change it."""
    return load_preset(SHIPPED / f"{name}.safetensors")


@cache
def program_of(name: str, rate_hz: int) -> Program:
    return model_program(shipped(name), rate_hz)


def small(tension_modulated: bool) -> PresetInfo:
    """A string of six modes at 4 kHz, tension-modulated or linear."""
    plain = replace(shipped(KNOWING).info, model="dmd", model_configuration={}, modes=6, grid_points=41)
    return replace(plain, tension_modulated=tension_modulated)


def initial_m(info: PresetInfo, pluck: Pluck) -> Signal:
    """The displacement that a string of a preset's is released from, (grid_points,)."""
    return project(pluck.displacement(info.grid_points), info.modes)


def strike(name: str, pluck: Pluck = PLUCK, rate_hz: int = RATE_HZ, ear: Ear = EAR, gain: float = 1.0) -> Voice:
    """A voice of a shipped preset's model."""
    return Voice(program_of(name, rate_hz), initial_m(shipped(name).info, pluck), ear, gain)


def rung(frames: int, *voices: Voice, attack: bool = True) -> Signal:
    """What voices sound like together, (frames, 2), with no limiter."""
    for voice in () if attack else voices:
        voice.record["attack"] = 0  # the string's own samples from the first on
    return mixer_of(*voices, rate_hz=voices[0].program.rate_hz).render(frames).astype(np.float64)


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


def wet(samples: Samples, gain: float = 1.0, rate_hz: int = RATE_HZ) -> Voice:
    """A voice that sounds through the effects."""
    voice = voice_of(samples, gain, rate_hz)
    voice.sound_through_effects()
    return voice


def through(effects: Effects | None, samples: Samples, rate_hz: int = RATE_HZ) -> Samples:
    """Samples as they sound through the effects of a mixer: as many."""
    mixer = Mixer(rate_hz, limited=False)
    mixer.set_effects(effects)
    mixer.add(wet(samples, rate_hz=rate_hz))
    return mixer.render(len(samples))
