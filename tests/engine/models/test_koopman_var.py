"""Koopman_var against its reference vector, a plain recurrence, and the laws of the contract."""

from pathlib import Path

import numpy as np
import pytest
import torch

from engine.models.base import Physics, count_parameters
from engine.models.configurations import KoopmanVarConfiguration
from engine.models.koopman_var import KoopmanVar
from engine.resonators.string import resonator_of
from engine.truth import ModalState
from engine.values.string import StringParameters
from tests.engine.tensors import listening_weights, solve_linear, to_grid

REFERENCE = Path(__file__).parent / "references" / "koopman_var.npz"


def reference_model() -> tuple[KoopmanVar, torch.Tensor, torch.Tensor]:
    """A float64 model with the reference's weights, its input, and its exact output."""
    arrays = {name: torch.from_numpy(array) for name, array in np.load(REFERENCE).items()}
    points, latent = arrays["params/encoder/kernel"].shape
    width = arrays["params/dynamics/model/Dense_0/bias"].shape[0]
    model = KoopmanVar(KoopmanVarConfiguration(points, latent // 2, (width,) * 3)).double()
    weights = {
        "nu_log": arrays["params/dynamics/nu_log"],
        "theta_log": arrays["params/dynamics/theta_log"],
    }
    names = {"encoder": "encoder", "decoder": "decoder"}
    names |= {f"multiplier.{2 * i}": f"dynamics/model/Dense_{i}" for i in range(4)}
    for ours, theirs in names.items():
        weights[f"{ours}.weight"] = arrays[f"params/{theirs}/kernel"].T
        weights[f"{ours}.bias"] = arrays[f"params/{theirs}/bias"]
    model.load_state_dict(weights)
    return model, arrays["input_displacement"], arrays["output_trajectory"]


def small_model(seed: int = 0, how: str = "paper") -> KoopmanVar:
    model = KoopmanVar(KoopmanVarConfiguration(101, 32, (16, 16)))
    model.initialise(how, Physics(resonator_of(StringParameters(), 10), 4_000), torch.Generator().manual_seed(seed))
    return model.eval()


def test_parameter_count_is_the_papers() -> None:
    assert count_parameters(KoopmanVar(KoopmanVarConfiguration())) == 134_885


@torch.no_grad()
def test_agrees_with_the_reference_vector() -> None:
    model, initial, expected = reference_model()
    torch.testing.assert_close(model(initial, expected.shape[1]), expected, rtol=0, atol=1e-12)


@torch.no_grad()
def test_agrees_with_a_plain_recurrence() -> None:
    model, initial, _ = reference_model()
    eigenvalue = torch.exp(torch.complex(-model.nu_log.exp(), model.theta_log.exp()))
    z = model.encode(initial).origin
    for frame in model(initial, 200).unbind(1):
        z = z * eigenvalue
        torch.testing.assert_close(frame, model.decode(z), rtol=0, atol=1e-11)


@torch.no_grad()
@pytest.mark.parametrize("readout", [None, listening_weights([0.37], 101)])
def test_any_splitting_into_blocks_is_the_same_motion(readout: torch.Tensor | None) -> None:
    model = small_model()
    initial = torch.randn(2, 101, generator=torch.Generator().manual_seed(1))
    whole = model(initial, 20_000, readout)
    state, parts = model.encode(initial), []
    for steps in (1, 64, 65, 2047, 2823, 10_000, 5000):
        part, state = model.advance(state, steps, readout)
        parts.append(part)
    torch.testing.assert_close(torch.cat(parts, 1), whole, rtol=0, atol=1e-5 * float(whole.abs().max()))


@torch.no_grad()
def test_phases_stay_exact_after_a_million_steps() -> None:
    """The latents of a render, against powers taken one by one in float64; slow decays, so that something is left."""
    model = small_model()
    model.nu_log.fill_(-16.0)
    origin = torch.ones(1, model.configuration.state_size, dtype=torch.complex64)
    found = model.successive_latents(origin, 1_000_000, 300)[0].to(torch.complex128)
    k = torch.arange(1_000_000, 1_000_300, dtype=torch.float64)[:, None]
    theta = torch.remainder(k * model.theta_log.double().exp(), 2 * torch.pi)
    expected = torch.polar(torch.exp(-k * model.nu_log.double().exp()), theta)
    assert float(expected.abs().min()) > 0.8
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-6)


@torch.no_grad()
def test_listening_is_the_grid_at_that_point() -> None:
    model = small_model()
    initial = torch.randn(2, 101, generator=torch.Generator().manual_seed(1))
    weights = listening_weights([0.37, 0.123], 101)
    heard = model(initial, 50, weights)
    torch.testing.assert_close(heard, model(initial, 50) @ weights.float(), rtol=1e-4, atol=1e-5)


@torch.no_grad()
def test_random_access_is_the_sequence() -> None:
    model = small_model()
    initial = torch.randn(1, 101, generator=torch.Generator().manual_seed(1))
    frames = torch.tensor([17, 3, 400])
    z = model.latents(model.encode(initial).origin, frames)
    torch.testing.assert_close(model.decode(z), model(initial, 400)[:, frames - 1])


@torch.no_grad()
def test_physics_initialisation_is_nearly_the_linear_string() -> None:
    string, modes, rate_hz = StringParameters(), 10, 4_000
    model = small_model(how="physics")
    amplitudes = torch.randn(1, modes, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    times_s = torch.arange(1, 401, dtype=torch.float64) / rate_hz
    truth = to_grid(
        solve_linear(resonator_of(string, amplitudes.shape[1]), ModalState.at_rest(amplitudes), times_s), 101
    ).float()
    found = model(to_grid(amplitudes, 101).float(), 400)
    assert float((found - truth).norm() / truth.norm()) < 0.1


def test_paper_initialisation_lies_in_the_ring() -> None:
    radius = torch.exp(-small_model().nu_log.detach().exp())
    assert float(radius.min()) >= 0.99 - 1e-6
    assert float(radius.max()) <= 1


def test_the_seed_decides_all() -> None:
    first, again, other = (small_model(seed).state_dict() for seed in (1, 1, 2))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not torch.equal(first["encoder.weight"], other["encoder.weight"])


def test_long_renders_stay_finite_and_decay() -> None:
    """|λ| < 1 for every parameter value: even wild ones cannot grow."""
    model = small_model()
    with torch.no_grad():
        model.nu_log.uniform_(-8, 3, generator=torch.Generator().manual_seed(0))
        latents = model.latents(model.encode(torch.randn(1, 101)).origin, torch.tensor([0, 1000, 100_000]))
    radii = latents.abs()[0]
    assert torch.isfinite(radii).all()
    assert (radii[1] <= radii[0]).all()
    assert (radii[2] <= radii[1]).all()


@pytest.mark.parametrize("sizes", [{"grid_points": 0}, {"state_size": -1}, {"multiplier_widths": (4, 0)}])
def test_impossible_sizes_are_named(sizes: dict) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(sizes))} must lie in 1"):
        KoopmanVarConfiguration(**sizes)


def test_physics_initialisation_needs_a_state_for_each_mode() -> None:
    model = KoopmanVar(KoopmanVarConfiguration(101, 5, (4,)))
    with pytest.raises(ValueError, match="at least the 10 modes, not 5"):
        model.initialise("physics", Physics(resonator_of(StringParameters(), 10), 4_000), torch.Generator())
    with pytest.raises(ValueError, match="'guess' is not one of paper, physics"):
        model.initialise("guess", Physics(resonator_of(StringParameters(), 10), 4_000), torch.Generator())
