"""Koopman against its reference vector, a plain recurrence, and the laws of the contract."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from engine.models.base import Physics, count_parameters
from engine.models.configurations import KoopmanConfiguration
from engine.models.koopman import SHARPEST, Koopman
from engine.resonators.string import resonator_of
from engine.truth import ModalState
from engine.values.string import StringParameters
from tests.engine.tensors import listening_weights, solve_linear, to_grid

REFERENCE = Path(__file__).parent / "references" / "koopman.npz"
PHYSICS = Physics(resonator_of(StringParameters(), 10), 4_000)


def reference_model() -> tuple[Koopman, torch.Tensor, torch.Tensor]:
    """A float64 model with the reference's weights, its input, and its exact output."""
    arrays = {name: torch.from_numpy(array) for name, array in np.load(REFERENCE).items()}
    points, width = arrays["params/encoder/Dense_0/kernel"].shape
    n = len(arrays["params/dynamics/nu_log"])
    model = Koopman(KoopmanConfiguration(points, n, (width,) * 2, (width,) * 2, mixing_layer=False)).double()
    weights = {name: arrays[f"params/dynamics/{name}"] for name in ("nu_log", "theta_log")}
    for part in ("encoder", "decoder"):
        for i in range(3):
            weights[f"{part}.{2 * i}.weight"] = arrays[f"params/{part}/Dense_{i}/kernel"].T
            weights[f"{part}.{2 * i}.bias"] = arrays[f"params/{part}/Dense_{i}/bias"]
    model.load_state_dict(weights)
    return model.eval(), arrays["input_displacement"], arrays["output_trajectory"]


def small_model(seed: int = 0, how: str = "paper", **sizes: object) -> Koopman:
    model = Koopman(KoopmanConfiguration(**{"state_size": 32, "encoder_widths": (16,), **sizes}))  # type: ignore[arg-type]
    model.initialise(how, PHYSICS, torch.Generator().manual_seed(seed))
    return model.eval()


def displacement(batch: int = 1) -> torch.Tensor:
    return torch.randn(batch, 101, generator=torch.Generator().manual_seed(1))


def test_parameter_count_is_the_papers() -> None:
    with torch.device("meta"):
        assert count_parameters(Koopman(KoopmanConfiguration())) == 191_077


@torch.no_grad()
def test_agrees_with_the_reference_vector() -> None:
    model, initial, expected = reference_model()
    torch.testing.assert_close(model(initial, expected.shape[1]), expected, rtol=0, atol=1e-12)


@torch.no_grad()
def test_agrees_with_a_plain_recurrence() -> None:
    """Every weight by its name, real and imaginary parts by hand."""
    model = small_model().double()
    weights = model.state_dict()

    def layer(name: str, x: torch.Tensor) -> torch.Tensor:
        return x @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]

    def selu(x: torch.Tensor) -> torch.Tensor:
        return 1.0507009873554805 * torch.where(x > 0, x, 1.6732632423543772 * (x.exp() - 1))

    initial = displacement(2).double()
    x, y = layer("encoder.3", layer("encoder.2", selu(layer("encoder.0", initial)))).chunk(2, dim=1)
    decay, angle = torch.exp(-weights["nu_log"].exp()), weights["theta_log"].exp()
    a, b = decay * angle.cos(), decay * angle.sin()
    for frame in model(initial, 200).unbind(1):
        x, y = a * x - b * y, b * x + a * y
        hidden = selu(layer("decoder.2", selu(layer("decoder.0", torch.cat([x, y], 1)))))
        torch.testing.assert_close(frame, layer("decoder.4", hidden), rtol=0, atol=1e-11)


@torch.no_grad()
def test_any_splitting_into_blocks_is_the_same_motion() -> None:
    model, initial = small_model(), displacement(2)
    whole = model(initial, 5000)
    state, parts = model.encode(initial), []
    for steps in (1, 64, 65, 2047, 2823):
        part, state = model.advance(state, steps)
        parts.append(part)
    torch.testing.assert_close(torch.cat(parts, 1), whole, rtol=0, atol=1e-5 * float(whole.abs().max()))


@torch.no_grad()
def test_phases_stay_exact_after_a_million_steps() -> None:
    model = small_model()
    with torch.no_grad():
        model.nu_log.fill_(-math.inf)  # no decay: only phases are left
    origin = model.encode(displacement()).origin.to(torch.complex128)
    frames = torch.arange(1_000_000, 1_000_100)
    angle = torch.remainder(frames[:, None] * model.theta_log.double().exp(), 2 * math.pi)
    expected = origin[:, None] * torch.polar(torch.ones_like(angle), angle)
    for found in (model.latents(origin, frames), model.successive_latents(origin, 1_000_000, 100)):
        torch.testing.assert_close(found, expected, rtol=0, atol=1e-8)


@torch.no_grad()
def test_random_access_is_the_sequence() -> None:
    model, initial = small_model(), displacement()
    frames = torch.tensor([17, 3, 400])
    z = model.latents(model.encode(initial).origin, frames)
    torch.testing.assert_close(model.decode(z), model(initial, 400)[:, frames - 1])


@torch.no_grad()
@pytest.mark.parametrize("decoder_widths", [(), (16,), (16, 16)])
def test_listening_is_the_grid_at_that_point(decoder_widths: tuple[int, ...]) -> None:
    model = small_model(decoder_widths=decoder_widths)
    weights = listening_weights([0.37, 0.123], 101)
    heard = model(displacement(), 50, weights)
    torch.testing.assert_close(heard, model(displacement(), 50) @ weights.float(), rtol=1e-4, atol=1e-5)


def test_initialisations_lie_where_they_should() -> None:
    radius = torch.exp(-small_model().nu_log.detach().exp())
    assert 0.99 - 1e-6 <= float(radius.min()) <= float(radius.max()) <= 1
    physical = small_model(how="physics")
    linear = torch.from_numpy(resonator_of(StringParameters(), 10).eigenvalues() / 4_000)
    torch.testing.assert_close(physical.nu_log.detach()[:10].exp().double(), -linear.real, rtol=1e-5, atol=0)
    raised = physical.theta_log.detach().exp().double() / linear.imag.repeat(4)[:32]
    torch.testing.assert_close(raised, 1 + SHARPEST * (torch.arange(32) // 10).double() / 3, rtol=1e-5, atol=0)
    weight = physical.encoder[0].weight
    torch.testing.assert_close(weight @ weight.T, torch.eye(16), rtol=0, atol=1e-5)


@torch.no_grad()
def test_physics_starts_as_the_linear_string() -> None:
    """As long as SELU is straight, which it is for the plucks of most of the data."""
    model = Koopman(KoopmanConfiguration())
    model.initialise("physics", PHYSICS, torch.Generator().manual_seed(0))
    amplitudes = torch.randn(2, 10, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    times_s = torch.arange(401).double() / PHYSICS.rate_hz
    truth = solve_linear(PHYSICS.resonator, ModalState.at_rest(0.3 * amplitudes), times_s)
    found = model(to_grid(0.3 * amplitudes, 101).float(), 400)
    wanted = to_grid(truth[:, 1:], 101)
    assert float((found - wanted).square().sum() / wanted.square().sum()) < 1e-4


def test_the_seed_decides_all() -> None:
    first, again, other = (small_model(seed).state_dict() for seed in (1, 1, 2))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not torch.equal(first["encoder.0.weight"], other["encoder.0.weight"])


@torch.no_grad()
def test_long_renders_stay_finite_and_come_to_rest() -> None:
    """|λ| < 1 for every parameter value: what is decoded in the end is decoded from 0."""
    model = small_model()
    model.nu_log.uniform_(-8, 3, generator=torch.Generator().manual_seed(0))
    origin = model.encode(displacement()).origin
    late = model.decode(model.latents(origin, torch.tensor([10_000_000])))
    torch.testing.assert_close(late, model.decode(torch.zeros_like(origin))[:, None])


@pytest.mark.parametrize("name", ["grid_points", "state_size", "encoder_widths", "decoder_widths"])
def test_impossible_sizes_are_named(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must lie in 1"):
        KoopmanConfiguration(**{name: (4, 0) if name.endswith("widths") else 0})  # type: ignore[arg-type]


def test_physics_initialisation_needs_a_state_for_each_mode() -> None:
    with pytest.raises(ValueError, match="at least the 10 modes, not 5"):
        small_model(how="physics", state_size=5)
    with pytest.raises(ValueError, match="'guess' is not one of paper, physics"):
        small_model(how="guess")
    with pytest.raises(ValueError, match="the narrowest has 9 units"):
        small_model(how="physics", encoder_widths=(24, 9))
