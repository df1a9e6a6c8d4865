"""Errors past the horizon of models whose errors are known: the truth itself, the linear string in closed form."""

import math
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.resonators.string import decay_rates, resonator_of
from engine.truth import ModalState, SplittingSolver
from tests.engine.tensors import to_grid, to_modes
from training.configuration import DatasetConfiguration
from training.data.dataset import Dataset, load_dataset
from training.evaluate import evaluate_model, evaluate_partials, evaluate_past_horizon

DATA = DatasetConfiguration(initial="gaussian", rate_hz=4000, modes=10, count=20, steps=100)
HORIZON_S = 0.025


class Truth(StringModel[tuple[ModalState, int]]):
    """The solver as a model, louder by `gain`; from the frame `broken` on it is not a number."""

    initialisations: ClassVar = {}

    def __init__(self, data: Dataset, gain: float = 1.0, broken: float = math.inf) -> None:
        c = data.configuration
        super().__init__(c)
        self.gain = nn.Parameter(torch.tensor(gain))
        self._broken = broken
        self._scale_m = data.scale_m
        self._solver = SplittingSolver(c.resonator, c.rate_hz)

    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        raise NotImplementedError

    def encode(self, displacement: Tensor, second: Tensor | None = None) -> tuple[ModalState, int]:
        assert not self.training
        modes = to_modes(displacement.double() * self._scale_m, self._solver.modes)
        return ModalState.at_rest(modes), 0

    def advance(
        self, state: tuple[ModalState, int], steps: int, readout: Tensor | None = None
    ) -> tuple[Tensor, tuple[ModalState, int]]:
        amplitudes, later = self._solver.advance(state[0], steps)
        frames = to_grid(amplitudes, self.grid_points) / self._scale_m
        frames = frames if readout is None else frames @ readout.double()
        frame = state[1] + steps
        frames[:, max(0, min(steps, int(min(self._broken, 1e9)) - 1 - state[1])) :] = math.nan
        return (frames * self.gain).float(), (later, frame)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return load_dataset(DATA, tmp_path_factory.mktemp("cache"))


Windows = list[tuple[float, float]]


def measured(model: StringModel[Any], data: Dataset, seconds: float, windows_s: Windows, **options: Any) -> Any:
    """The errors past the horizon, and those of partials."""
    past = evaluate_past_horizon(model, data, "test", seconds, windows_s=windows_s, **options)
    return past, evaluate_partials(model, data, "test", windows_s, **options)


def test_the_truth_has_no_error_to_any_time(data):
    model = Truth(data)
    found, partials = measured(model, data, 0.5, [(0, HORIZON_S), (HORIZON_S, 0.525)])
    for sums in (found.string, found.sound):
        assert len(sums.per_frame()[0]) == 2100
        assert len(sums.per_trajectory()[0]) == 2
        assert sums.total().rel_mse < 1e-11  # the model receives float32
    assert found.sound.total().null_depth_db < -110
    assert all(spectrum.convergence < 1e-5 for spectrum in found.spectra)
    for errors, most in ((partials.level_db, 1e-3), (partials.phase_cycles, 1e-4), (partials.cents, 1e-2)):
        assert np.nanmax(np.abs(errors)) < most
    assert [row.trajectories for row in partials.by_mode(0)] != [0] * 10
    assert model.training


def test_a_gain_is_reported_and_over_the_horizon_it_is_the_figure_of_the_tables(data):
    model = Truth(data, gain=0.97)
    whole = evaluate_past_horizon(model, data, "validation", 0.1)
    assert whole.string.total().rel_mse == pytest.approx(9e-4, rel=1e-3)
    assert whole.string.spread().rel_mse == pytest.approx(0, abs=1e-6)
    assert whole.sound.total().null_depth_db == pytest.approx(20 * math.log10(0.03), abs=0.01)
    level_db = evaluate_partials(model, data, "validation", [(0, 0.1)]).level_db
    assert level_db[~np.isnan(level_db)] == pytest.approx(20 * math.log10(0.97), abs=1e-3)
    table = evaluate_model(model, data, "validation", 60)
    for seconds in (0.0, 0.1):  # the stored truth, and the simulated one
        found = evaluate_past_horizon(model, data, "validation", seconds, horizon=60).string
        assert found.total(60).rel_mse == pytest.approx(table.total().rel_mse, rel=1e-4)
        assert found.total(60).rel_mae == pytest.approx(table.total().rel_mae, rel=1e-4)
        assert found.per_frame()[0][:60] == pytest.approx(table.per_frame()[0], rel=1e-4)


def test_any_splitting_into_blocks_gives_the_same_errors(data):
    model, windows_s = (
        Truth(replace(data, scale_m=1.01 * data.scale_m), gain=0.99),
        [(0, HORIZON_S), (HORIZON_S, 0.1)],
    )
    (whole, at_once), (parts, in_blocks) = (
        measured(model, data, 0.1, windows_s, frames_at_once=frames) for frames in (10_000, 37)
    )
    for a, b in ((whole.string, parts.string), (whole.sound, parts.sound)):
        assert b.per_frame()[0] == pytest.approx(a.per_frame()[0], rel=1e-4)
        assert b.per_trajectory()[1] == pytest.approx(a.per_trajectory()[1], rel=1e-6)
    assert [s.log_db for s in parts.spectra] == pytest.approx([s.log_db for s in whole.spectra], rel=1e-5)
    assert np.allclose(at_once.level_db, in_blocks.level_db, rtol=1e-5, equal_nan=True)
    assert np.allclose(at_once.t60_s, in_blocks.t60_s, rtol=1e-9, equal_nan=True)


def test_an_output_that_is_no_number_is_an_infinite_error(data):
    found, partials = measured(Truth(data, broken=200), data, 0.1, [(0, HORIZON_S), (0.06, 0.1)])
    assert found.string.total(199).rel_mse < 1e-11
    assert found.string.total().rel_mse == math.inf
    assert [math.isfinite(s.convergence) for s in found.spectra] == [True, False]
    assert np.nanmax(np.abs(partials.level_db[:, 0])) < 1e-3
    assert np.nanmin(partials.level_db[:, 1]) == math.inf


def test_the_linear_string_in_closed_form_holds_for_ten_seconds(tmp_path):
    c = replace(DATA, tension_modulated=False)
    data = load_dataset(c, tmp_path)
    model = build_model("koopman_integrated")
    physics = Physics(resonator_of(c.string, c.modes, tension_modulated=False), c.rate_hz, data.scale_m)
    model.initialise("physics", physics, torch.Generator().manual_seed(0))
    found = evaluate_past_horizon(model, data, "validation", 10, windows_s=[(0, HORIZON_S), (9, 10)])
    first, last = found.string.windows(c.rate_hz, [0, HORIZON_S, 9, 10])[::2]
    assert first.rel_mse < 1e-11
    assert last.rel_mse < 1e-6  # frequencies are float32: 250 Hz are known to a thousandth of a cycle in 10 s
    assert found.spectra[1].convergence < 1e-5
    partials = evaluate_partials(model, data, "validation", [(0, 1), (9, 10)])
    most = {"level_db": 1e-4, "phase_cycles": 1e-3, "cents": 1e-3, "t60_error_percent": 0.01}
    assert all(np.nanmax(np.abs(getattr(partials, name))) < bound for name, bound in most.items())
    sigma = decay_rates(c.string, c.modes)
    there = ~np.isnan(partials.t60_s[:, 0])
    expected = np.broadcast_to(3 * math.log(10) / sigma, there.shape)
    assert there.sum() > 10
    assert partials.t60_s[:, 0][there] == pytest.approx(expected[there], rel=1e-6)


@torch.no_grad()
def test_kept_frames_of_a_stride_are_measured_alone(tmp_path):
    every, some = (load_dataset(replace(DATA, stride=stride), tmp_path) for stride in (1, 5))
    physics = Physics(resonator_of(DATA.string, DATA.modes), DATA.rate_hz, every.scale_m)
    for name in ("koopman_integrated", "s5"):  # one knows any frame at once, one does not
        model = build_model(name, {"state_size": 16, "layers": 1, "hippo_blocks": 2} if name == "s5" else None)
        model.initialise(model.own_initialisation(), physics, torch.Generator().manual_seed(0))
        squared, absolute = evaluate_model(model, every, "validation").per_frame()
        kept = evaluate_model(model, replace(some, scale_m=every.scale_m), "validation").per_frame()
        np.testing.assert_allclose(kept, (squared[4::5], absolute[4::5]), rtol=1e-3)
