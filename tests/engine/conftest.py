"""A copy of the small preset that a test may damage; voices of shipped presets, and what they sound like."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.models.koopman_var import KoopmanVar
from engine.pluck import Pluck
from engine.presets import SHIPPED, Preset, PresetInfo, TrainedRange, load_preset
from engine.resonators.base import Array
from engine.resonators.sine_transform import project
from engine.values.ear import Ear
from engine.values.string import StringParameters
from engine.voices import Mixer, Program, Voice, model_program

PLUCK, EAR = Pluck(0.3), Ear((0.37,))


@pytest.fixture
def preset_file(small_preset: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(small_preset, tmp_path))


@pytest.fixture
def model(small_preset: Path) -> KoopmanVar:
    model = load_preset(small_preset).model
    assert isinstance(model, KoopmanVar)
    return model


@cache
def _shipped(name: str) -> Preset:
    return load_preset(SHIPPED / f"{name}.safetensors")


@cache
def _bank(name: str, rate_hz: int) -> Program:
    return model_program(_shipped(name), rate_hz)


def _initial_m(info: PresetInfo, pluck: Pluck) -> Array:
    return project(pluck.displacement(info.grid_points), info.modes)


@pytest.fixture(scope="session")
def shipped() -> Callable[[str], Preset]:
    """A shipped preset by its name; nobody may change it."""
    return _shipped


@pytest.fixture(scope="session")
def initial_m() -> Callable[[PresetInfo, Pluck], Array]:
    """The displacement that a string of a preset's is released from, (grid_points,)."""
    return _initial_m


@pytest.fixture(scope="session")
def small_info() -> Callable[[bool], PresetInfo]:
    """A string of six modes at 4 kHz, tension-modulated or linear."""

    def info(tension_modulated: bool) -> PresetInfo:
        return PresetInfo(
            title="A small string",
            model="dmd",
            model_configuration={},
            string=StringParameters(),
            tension_modulated=tension_modulated,
            initial="gaussian",
            rate_hz=4000,
            modes=6,
            grid_points=41,
            horizon_steps=400,
            scale_m=1e-3,
            trained_range=TrainedRange((0.3, 0.7), {"gaussian": (0.02, 0.1)}, (1e-3, 1e-2)),
            initialisation="physics",
            seed=0,
        )

    return info


@pytest.fixture(scope="session")
def strike() -> Callable[..., Voice]:
    """A voice of a shipped preset's model: strike(name, pluck=…, rate_hz=…, ear=…, gain=…)."""

    def made(name: str, pluck: Pluck = PLUCK, rate_hz: int = 48_000, ear: Ear = EAR, gain: float = 1.0) -> Voice:
        return Voice(_bank(name, rate_hz), _initial_m(_shipped(name).info, pluck), ear, gain)

    return made


@pytest.fixture(scope="session")
def rung() -> Callable[..., NDArray[np.float64]]:
    """What voices sound like together, (frames, 2) with no limiter: rung(frames, *voices, attack=True)."""

    def rendered(frames: int, *voices: Voice, attack: bool = True) -> NDArray[np.float64]:
        mixer = Mixer(voices[0].program.rate_hz, limited=False)
        for voice in () if attack else voices:
            voice.record["attack"] = 0  # the string's own samples from the first on
        mixer.add(*voices)
        return mixer.render(frames).astype(np.float64)

    return rendered


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """The laws of motion hold for every variant of a model's sizes."""
    if "motion" in metafunc.fixturenames and metafunc.cls is not None:
        metafunc.parametrize("motion", metafunc.cls.variants, indirect=True, scope="class", ids=str)
