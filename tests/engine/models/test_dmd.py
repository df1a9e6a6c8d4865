"""DMD: the laws, and its fit against PyDMD and the linear string."""

from functools import cache
from typing import ClassVar

import numpy as np
import pytest
import torch

from engine.models.configurations import DMDConfiguration
from engine.models.dmd import DMD
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver
from engine.values.string import StringParameters
from tests.engine.models.laws import ModelLaws
from tests.engine.sounds import relative
from tests.engine.tensors import to_grid, to_modes

STRING, MODES, RATE_HZ = StringParameters(), 25, 16_000


class TestDMD(ModelLaws):
    name = "dmd"
    count = 2 * 50 + 2 * 50 * 101
    sizes: ClassVar = {"rank": 20}
    variants = ({}, {"lags": 1}, {"lags": 3})
    linear: ClassVar = {"physics": 1e-4}
    too_small: ClassVar = ({"rank": 18}, "rank of at least 20, two a mode, not 18")
    drawn = False
    stable = False  # a fit may find a mode that grows


@cache
def trajectories(steps: int = 1000, tension_modulated: bool = False) -> torch.Tensor:
    """Two noise-plucked strings at 16 kHz in mm, float64 (2, steps + 1, 101)."""
    noise = torch.rand(2, 101, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    solver = SplittingSolver(resonator_of(STRING, MODES, tension_modulated=tension_modulated), RATE_HZ)
    return to_grid(solver.solve(ModalState.at_rest(to_modes(noise * 5.5e-3, MODES)), steps), 101) * 1e3


@cache
def fitted(tension_modulated: bool = False, **sizes: int) -> DMD:
    """As in the paper: fitted to a single sequence."""
    return DMD.fit(trajectories(tension_modulated=tension_modulated)[:1], DMDConfiguration(**sizes))


def assert_same_eigenvalues(model: DMD, expected: np.ndarray, tolerance: float) -> None:
    found = torch.polar(model.magnitude_log.exp(), model.angle).detach().numpy()
    distance = np.abs(found[:, None] - expected[None, :])
    assert len(found) == len(expected)
    assert max(distance.min(0).max(), distance.min(1).max()) < tolerance


# PyDMD warns of every string: both of its ends are zero in all frames
@pytest.mark.filterwarnings("ignore:Input data condition number")
@pytest.mark.parametrize(
    ("lags", "rank", "tension_modulated"), [(1, 10, True), (2, 50, False), (2, 30, True), (3, 40, True)]
)
def test_it_is_pydmds(lags, rank, tension_modulated):
    """PyDMD takes one sequence, or pairs of snapshots: ours of many trajectories are the pairs within each."""
    import pydmd  # which loads pandas and more, as not every worker needs

    data = trajectories(tension_modulated=tension_modulated)
    theirs = pydmd.HankelDMD(svd_rank=rank, d=lags, exact=True).fit(data[0].numpy().T)
    assert_same_eigenvalues(fitted(tension_modulated, lags=lags, rank=rank), theirs.eigs, 1e-8)
    if (lags, rank) == (2, 30):
        before, after = (
            np.concatenate(
                [np.concatenate([t[1 + k : len(t) - 1 + k], t[k : len(t) - 2 + k]], axis=1) for t in data]
            ).T
            for k in (0, 1)
        )
        theirs = pydmd.DMD(svd_rank=rank, exact=True).fit(before, after)
        assert_same_eigenvalues(DMD.fit(data, DMDConfiguration(rank=rank)), theirs.eigs, 1e-8)


@torch.no_grad()
def test_it_finds_the_linear_string_and_follows_others_of_it():
    """Table 3 b: a relative MSE of 0.0000, on strings that were not fitted."""
    half = np.exp(resonator_of(STRING, MODES).eigenvalues() / RATE_HZ)
    assert_same_eigenvalues(fitted(), np.concatenate([half, half.conj()]), 1e-7)
    truth = trajectories()
    assert relative(fitted()(truth[:, 0].float(), 1000), truth[:, 1:]) ** 2 < 1e-9


@torch.no_grad()
def test_a_growing_mode_is_found_and_not_clipped():
    growing = trajectories(200) * 1.1 ** torch.arange(201, dtype=torch.float64)[:, None]
    model = DMD.fit(growing, DMDConfiguration())
    assert float(model.log_eigenvalues()[0].real.max()) > 0 > float(fitted().log_eigenvalues()[0].real.max())
    assert not torch.isfinite(model(growing[:, 0].float(), 4000)).all()


@torch.no_grad()
def test_modes_that_the_data_do_not_hold_vanish():
    """A rank of 50 on two modes: rounding is not fitted, and silence gives silence."""
    two_modes = to_grid(to_modes(trajectories()[:1], 2), 101).float()
    model = DMD.fit(two_modes, DMDConfiguration())
    assert int((model.magnitude_log > -600).sum()) == 4
    assert relative(model(two_modes[:, 0], 1000), two_modes[:, 1:]) ** 2 < 1e-3
    silent = DMD.fit(torch.zeros(1, 10, 101), DMDConfiguration())
    assert torch.equal(silent(torch.ones(1, 101), 5), torch.zeros(1, 5, 101))
