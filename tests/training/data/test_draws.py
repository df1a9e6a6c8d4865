"""The random initial displacements of the protocol, and plucks of a musician."""

import math

import numpy as np
import pytest
import torch

from training.data import draws


@pytest.mark.parametrize("kind", ["gaussian", "noise"])
def test_draws_follow_the_protocol(kind):
    drawn = draws.DRAWS[kind](500, 101, torch.Generator().manual_seed(3))
    peaks = drawn.max(1)
    assert drawn.shape == (500, 101)
    assert (drawn[:, [0, -1]] == 0).all()
    assert drawn.min() >= 0
    # a narrow Gaussian between two grid points peaks a little below its parameter
    assert peaks.min() >= 0.9 * draws.PEAK_RANGE_M[0]
    assert peaks.max() <= draws.PEAK_RANGE_M[1]
    assert float(peaks.mean()) == pytest.approx(5.5e-3, rel=0.1)
    if kind == "gaussian":
        centres = drawn.argmax(1) / 100
        assert 0.29 <= float(centres.min()) <= 0.33 and 0.67 <= float(centres.max()) <= 0.71
    again = draws.DRAWS[kind](500, 101, torch.Generator().manual_seed(3))
    assert np.array_equal(drawn, again)


def test_random_plucks_are_a_musicians():
    drawn = draws.draw_plucks(600, 401, torch.Generator().manual_seed(0))
    peaks = drawn.max(1)
    assert drawn.shape == (600, 401) and (drawn[:, [0, -1]] == 0).all() and drawn.min() >= 0
    assert 0.9 * draws.PLUCK_PEAK_RANGE_M[0] <= peaks.min() and peaks.max() <= draws.PLUCK_PEAK_RANGE_M[1]
    assert float(np.log(peaks).mean()) == pytest.approx(0.5 * math.log(5e-4 * 1e-2), abs=0.1)
    places = drawn.argmax(1) / 400
    assert float(places.min()) < 0.08 and float(places.max()) > 0.92
    # a triangle has two slopes and nothing else; a raised cosine is zero away from its place
    bends = (np.abs(np.diff(drawn[1::3], n=2)) > 1e-9 * peaks[1::3, None]).sum(1)
    assert int(bends.max()) <= 2
    assert (drawn[2::3] == 0).mean(1).min() > 0.6
    assert np.array_equal(drawn, draws.draw_plucks(600, 401, torch.Generator().manual_seed(0)))
