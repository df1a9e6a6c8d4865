"""The map of errors: its order, that nothing is computed twice, and its figures against the plain definition."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.analysis import error_plane
from app.analysis.error_plane import AMPLITUDES_MM, POSITIONS, ErrorPlane, error_of_plucks, nearest_cell, refine
from app.shared.worker import Cancelled
from engine.compare.relative import relative_error
from engine.pluck import Pluck
from engine.presets import load_preset
from engine.resonators.sine_transform import project
from engine.sources import ModelSource, TruthSource


def test_interpolation_keeps_its_points_and_is_linear_between() -> None:
    coarse = np.array([[0.0, 4.0], [8.0, 12.0], [8.0, math.inf]])
    fine = refine(coarse, 4)
    assert fine.shape == (9, 5)
    np.testing.assert_array_equal(fine[::4, ::4], coarse)
    np.testing.assert_allclose(fine[2], [4, 5, 6, 7, 8])
    assert np.isfinite(fine[:5]).all() and not np.isnan(fine).any()


def test_coarse_first_and_nothing_twice(monkeypatch: pytest.MonkeyPatch, job: Any) -> None:
    asked: list[tuple[int, int]] = []

    def errors(plucks: list[Pluck], job: object) -> np.ndarray:
        asked.extend(nearest_cell(p.position, p.amplitude_mm) for p in plucks)
        return np.array([p.position * p.amplitude_mm for p in plucks])

    monkeypatch.setattr(error_plane, "error_of_plucks", lambda preset: errors)
    plane, preset = ErrorPlane(), Any
    assert plane.picture() is None
    job.cancel_after = 40
    with pytest.raises(Cancelled):
        plane.compute(preset, Pluck(), job)
    assert asked[:12] == [(x, y) for x in range(0, 49, 16) for y in range(0, 33, 16)]
    job.cancel_after = None
    whole = plane.compute(preset, Pluck(), job)
    assert len(asked) == len(set(asked)) == 49 * 33
    np.testing.assert_allclose(whole.error, POSITIONS[:, None] * AMPLITUDES_MM, rtol=1e-9)
    assert whole.at(POSITIONS[3] + 0.005, 1.01 * AMPLITUDES_MM[5]) == whole.error[3, 5]
    assert [found.spacing for found in job.results] == [16, 8, 4, 4, 2, 1], "the second computation finds a 4"
    assert [nearest_cell(0.5, 0.5), nearest_cell(2.0, 0.0)] == [(24, 0), (48, 0)]


def test_errors_are_those_of_the_sources_and_infinite_where_they_are_not_finite(small_preset: Path, job: Any) -> None:
    preset, plucks = load_preset(small_preset), [Pluck(0.3, 2.0), Pluck(0.62, 9.0, "triangular")]
    for pluck, error in zip(plucks, error_of_plucks(preset)(plucks, job), strict=True):
        initial = project(pluck.displacement(101), 10)[None]
        model, truth = (
            source.advance(source.start(initial), 400)[0]
            for source in (ModelSource(preset), TruthSource(preset.info))
        )
        assert error == pytest.approx(relative_error(model, truth).rel_mae, rel=1e-3)
    with torch.no_grad():
        next(preset.model.parameters()).fill_(math.inf)
    assert np.isinf(error_of_plucks(preset)(plucks, job)).all()
