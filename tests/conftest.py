"""A small preset that needs no training, for every test that reads, renders or plays one."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from engine.models.base import Physics
from engine.models.configurations import KoopmanVarConfiguration
from engine.models.koopman_var import KoopmanVar
from engine.presets import PresetInfo, TrainedRange, save_preset
from engine.resonators.string import resonator_of
from engine.schema import write
from engine.values.string import StringParameters
from engine.voices.ear import REACH_FRAMES, differentiator_taps

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")  # windows need no screen, however pytest is started

SLOWEST = (  # with tests of ten seconds: one that begins last would run alone
    "test_figures.py",
    "test_heard_in_the_lab.py",
    "test_kills.py",
    "test_learn.py",
    "test_sweep.py",
    "test_without_torch.py",
)
Derivative = Callable[[NDArray[np.floating], int], NDArray[np.float64]]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the slowest files."""
    items.sort(key=lambda item: item.path.name not in SLOWEST)


@pytest.fixture(scope="session")
def derivative() -> Derivative:
    """Velocity of all of a displacement (frames, points): at rest before it, and turned about its last frame."""

    def of(signal: NDArray[np.floating], rate_hz: int) -> NDArray[np.float64]:
        before, behind = signal[REACH_FRAMES:0:-1], 2 * signal[-1:] - signal[-2 : -REACH_FRAMES - 2 : -1]
        whole = np.concatenate([before, signal, behind]).astype(np.float64)
        taps = differentiator_taps(rate_hz)[::-1]  # `np.convolve` turns them again
        return np.stack([np.convolve(column, taps, "valid") for column in whole.T], axis=1)

    return of


@pytest.fixture(scope="session")
def small_preset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Koopman_var of 16 states at 4 kHz that is nearly the linear string; horizon 400 frames (0.1 s)."""
    configuration = KoopmanVarConfiguration(state_size=16, multiplier_widths=(8,))
    model = KoopmanVar(configuration)
    string = StringParameters()
    model.initialise("physics", Physics(resonator_of(string, 10), 4000), torch.Generator().manual_seed(0))
    info = PresetInfo(
        title="A small string",
        model="koopman_var",
        model_configuration=write(configuration),
        string=string,
        tension_modulated=True,
        initial="gaussian",
        rate_hz=4000,
        modes=10,
        grid_points=101,
        horizon_steps=400,
        scale_m=1e-3,
        trained_range=TrainedRange((0.3, 0.7), {"gaussian": (0.02, 0.1)}, (1e-3, 1e-2)),
        initialisation="physics",
        seed=0,
        rel_mse=0.5,
        rel_mae=0.25,
    )
    path = tmp_path_factory.mktemp("presets") / "small.safetensors"
    save_preset(path, info, model)
    return path


@pytest.fixture(autouse=True)
def no_presets_of_ones_own(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests do not see what lies in the developer's own folder."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path_factory.getbasetemp() / "no own presets"))
    monkeypatch.setenv("LEARNED_STRINGS_RECORDINGS", str(tmp_path_factory.getbasetemp() / "unsaved recordings"))
