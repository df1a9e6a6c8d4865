"""DMD against PyDMD, the linear string, and the laws of the contract."""

import copy
from functools import cache

import numpy as np
import pydmd
import pytest
import torch

from engine.models.base import Physics, count_parameters
from engine.models.configurations import DMDConfiguration
from engine.models.dmd import DMD
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver
from engine.values.string import StringParameters
from tests.engine.tensors import listening_weights, to_grid, to_modes

STRING, MODES, RATE_HZ = StringParameters(), 25, 16_000

# PyDMD warns of every string: both of its ends are zero in all frames
as_pydmd_warns = pytest.mark.filterwarnings("ignore:Input data condition number")


@cache
def trajectories(steps: int = 1000, tension_modulated: bool = False) -> torch.Tensor:
    """Two noise-plucked strings at 16 kHz in mm, float64 (2, steps + 1, 101)."""
    noise = torch.rand(2, 101, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    solver = SplittingSolver(resonator_of(STRING, MODES, tension_modulated=tension_modulated), RATE_HZ)
    return to_grid(solver.solve(ModalState.at_rest(to_modes(noise * 5.5e-3, MODES)), steps), 101) * 1e3


@cache
def fitted(tension_modulated: bool = False, **sizes: int) -> DMD:
    """As in the paper: fitted to a single sequence."""
    data = trajectories(tension_modulated=tension_modulated)[:1]
    return DMD.fit(data, DMDConfiguration(**sizes))


def eigenvalues(model: DMD) -> np.ndarray:
    return torch.polar(model.magnitude_log.exp(), model.angle).detach().numpy()


def assert_same_set(found: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    distance = np.abs(found[:, None] - expected[None, :])
    assert len(found) == len(expected)
    assert distance.min(0).max() < tolerance
    assert distance.min(1).max() < tolerance


def relative_mse(found: torch.Tensor, truth: torch.Tensor) -> float:
    return float((found - truth).square().sum() / truth.square().sum())


def test_parameters_are_the_fitted_numbers() -> None:
    with torch.device("meta"):
        assert count_parameters(DMD(DMDConfiguration())) == 2 * 50 + 2 * 50 * 101


@as_pydmd_warns
@pytest.mark.parametrize(("lags", "rank", "tension_modulated"), [(2, 50, False), (2, 30, True), (3, 40, True)])
def test_agrees_with_pydmd(lags: int, rank: int, tension_modulated: bool) -> None:
    snapshots = trajectories(tension_modulated=tension_modulated)[0].numpy().T
    theirs = pydmd.HankelDMD(svd_rank=rank, d=lags, exact=True).fit(snapshots)
    model = fitted(tension_modulated=tension_modulated, lags=lags, rank=rank)
    assert_same_set(eigenvalues(model), theirs.eigs, 1e-8)


@as_pydmd_warns
def test_many_trajectories_agree_with_pydmd() -> None:
    """PyDMD takes one sequence, or pairs of snapshots: ours are the pairs within each trajectory."""
    data = trajectories(tension_modulated=True).numpy()
    pairs = (
        [np.concatenate([t[1:-1], t[:-2]], axis=1) for t in data],
        [np.concatenate([t[2:], t[1:-1]], axis=1) for t in data],
    )
    before, after = (np.concatenate(part).T for part in pairs)
    theirs = pydmd.DMD(svd_rank=30, exact=True).fit(before, after)
    model = DMD.fit(trajectories(tension_modulated=True), DMDConfiguration(rank=30))
    assert_same_set(eigenvalues(model), theirs.eigs, 1e-8)


def test_finds_the_linear_strings_eigenvalues() -> None:
    half = np.exp(resonator_of(STRING, MODES).eigenvalues() / RATE_HZ)
    assert_same_set(eigenvalues(fitted()), np.concatenate([half, half.conj()]), 1e-7)


@torch.no_grad()
def test_linear_motion_is_followed_as_in_the_papers_table() -> None:
    """Table 3 b: a relative MSE of 0.0000, on strings that were not fitted."""
    truth = trajectories()
    assert relative_mse(fitted()(truth[:, 0].float(), 1000), truth[:, 1:]) < 1e-9


@torch.no_grad()
def test_agrees_with_a_plain_recurrence() -> None:
    model = copy.deepcopy(fitted()).double()
    initial = trajectories()[:, 0]
    b, r = initial @ model.encoder, model.configuration.rank
    z = torch.complex(b[:, :r], b[:, r:])
    step = torch.polar(model.magnitude_log.exp(), model.angle)
    phi = torch.complex(model.modes[:, :r], model.modes[:, r:])
    for frame in model(initial, 200).unbind(1):
        z = z * step
        torch.testing.assert_close(frame, (z @ phi.T).real, rtol=0, atol=1e-10)


@torch.no_grad()
def test_any_splitting_into_blocks_is_the_same_motion() -> None:
    model, initial = fitted(), trajectories()[:, 0].float()
    whole = model(initial, 5000)
    state, parts = model.encode(initial), []
    for steps in (1, 64, 65, 2047, 2823):
        part, state = model.advance(state, steps)
        parts.append(part)
    torch.testing.assert_close(torch.cat(parts, 1), whole, rtol=0, atol=1e-5 * float(whole.abs().max()))


@torch.no_grad()
def test_listening_is_the_grid_at_that_point() -> None:
    model, initial = fitted(), trajectories()[:, 0].float()
    weights = listening_weights([0.37, 0.123], 101)
    heard = model(initial, 50, weights)
    torch.testing.assert_close(heard, model(initial, 50) @ weights.float(), rtol=1e-4, atol=1e-4)


@torch.no_grad()
def test_phases_stay_exact_after_a_million_steps() -> None:
    model = copy.deepcopy(fitted())
    frames = torch.arange(1_000_000, 1_000_100)
    angle = torch.remainder(frames[:, None] * model.angle, 2 * torch.pi)
    model.magnitude_log.zero_()
    expected = torch.polar(torch.ones_like(angle), angle)
    origin = torch.ones(1, 50, dtype=torch.complex128)
    torch.testing.assert_close(model.successive_latents(origin, 1_000_000, 100)[0], expected, rtol=0, atol=1e-8)


@torch.no_grad()
def test_physics_initialisation_is_the_linear_string() -> None:
    model = DMD(DMDConfiguration(rank=60))
    model.initialise("physics", Physics(resonator_of(STRING, MODES), RATE_HZ), torch.Generator())
    truth = trajectories()
    assert relative_mse(model(truth[:, 0].float(), 1000), truth[:, 1:]) < 1e-9


def test_a_growing_mode_is_detected() -> None:
    growing = trajectories(200) * 1.1 ** torch.arange(201, dtype=torch.float64)[:, None]
    model = DMD.fit(growing, DMDConfiguration())
    assert bool((model.magnitude_log > 0).any())
    assert not bool((fitted().magnitude_log > 0).any())
    with torch.no_grad():
        assert not torch.isfinite(model(growing[:, 0].float(), 4000)).all()  # heard of, not clipped


def test_modes_that_the_data_do_not_hold_vanish() -> None:
    """A rank of 50 on two modes: rounding is not fitted, and silence gives silence."""
    two_modes = to_grid(to_modes(trajectories()[:1], 2), 101).float()
    model = DMD.fit(two_modes, DMDConfiguration())
    assert int((model.magnitude_log > -600).sum()) == 4
    with torch.no_grad():
        assert relative_mse(model(two_modes[:, 0], 1000), two_modes[:, 1:]) < 1e-3
        silent = DMD.fit(torch.zeros(1, 10, 101), DMDConfiguration())
        assert torch.equal(silent(torch.ones(1, 101), 5), torch.zeros(1, 5, 101))


@as_pydmd_warns
def test_one_lag_is_the_plain_dmd() -> None:
    snapshots = trajectories(tension_modulated=True)[0]
    model = fitted(tension_modulated=True, lags=1, rank=10)
    theirs = pydmd.DMD(svd_rank=10, exact=True).fit(snapshots.numpy().T)
    assert_same_set(eigenvalues(model), theirs.eigs, 1e-8)


def test_impossible_sizes_are_named() -> None:
    for name in ("grid_points", "lags", "rank"):
        with pytest.raises(ValueError, match=f"{name} must lie in 1"):
            DMDConfiguration(**{name: 0})
    with pytest.raises(ValueError, match="rank must be at most lags times grid_points, 20, not 50"):
        DMDConfiguration(grid_points=10)
    with pytest.raises(ValueError, match="rank of at least 50, two a mode, not 20"):
        DMD(DMDConfiguration(rank=20)).initialise(
            "physics", Physics(resonator_of(STRING, 25), 16_000), torch.Generator()
        )


def test_impossible_data_are_reported() -> None:
    with pytest.raises(ValueError, match=r"shape \(batch, frames, 101\), not \(1, 9, 7\)"):
        DMD.fit(torch.zeros(1, 9, 7), DMDConfiguration())
    with pytest.raises(ValueError, match="lags of 2 needs more frames than 2"):
        DMD.fit(torch.zeros(1, 2, 101), DMDConfiguration())
    with pytest.raises(ValueError, match="not finite"):
        DMD.fit(torch.full((1, 9, 101), torch.nan), DMDConfiguration())
