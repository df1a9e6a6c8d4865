"""The integrated phase against a plain quadrature, the physics, and the laws of the contract."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from engine.models import MODELS, model_class
from engine.models._averaging import FIXED_POINT_STEPS
from engine.models._cubics import integrate_parabolas
from engine.models.base import Physics, count_parameters
from engine.models.configurations import IntegratedPhaseConfiguration
from engine.models.integrated_phase import GAIN_LIMIT, IntegratedPhase
from engine.resonators.sine_transform import synthesis_matrix
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver
from engine.values.string import StringParameters
from tests.engine.tensors import draw, listening_weights, solve_linear, to_grid, to_modes

SMALL = {"encoder_widths": (12,), "eigenvalue_widths": (12, 12)}
KINDS: tuple[dict, ...] = (
    {"encoder_widths": (), "eigenvalue_widths": ()},
    SMALL,
    SMALL | {"node_spacing": 7},
    SMALL | {"adiabatic": True, "second_order": True},
)


def string_model(how: str = "averaging", seed: int = 0, **sizes: object) -> IntegratedPhase:
    model = IntegratedPhase(IntegratedPhaseConfiguration(**{"state_size": 12, **SMALL, **sizes}))  # type: ignore[arg-type]
    model.initialise(
        how, Physics(resonator_of(StringParameters(), 10), 4_000, 1e-3), torch.Generator().manual_seed(seed)
    )
    return model.eval()


@torch.no_grad()
def stirred_model(**sizes: object) -> IntegratedPhase:
    """One that uses all it has: every last layer and the real part of K are away from zero."""
    model = string_model(**sizes)
    generator = torch.Generator().manual_seed(5)
    for name, parameter in model.named_parameters():
        if parameter.abs().max() == 0 and name != "K":
            parameter.normal_(0, 0.1, generator=generator)
    model.K[:12].normal_(0, 0.02, generator=generator)
    return model


def initial(batch: int = 2) -> Tensor:
    amplitudes = torch.randn(batch, 10, generator=torch.Generator().manual_seed(1))
    return to_grid(amplitudes / torch.arange(1, 11), 101)


def relative(found: Tensor, expected: Tensor) -> float:
    return float((found - expected).abs().max() / expected.abs().max())


@torch.no_grad()
@pytest.mark.parametrize("sizes", KINDS)
def test_agrees_with_a_plain_quadrature(sizes: dict) -> None:
    """The definition, with the network's integral by the trapezoid rule at every hundredth of a sample."""
    model = stirred_model(**sizes | {"node_spacing": 4}).double()
    c = model.configuration
    z = model.encode(initial(1).double()).origin[0]
    sigma, omega = model.nu_log.exp(), model.theta_log.exp()
    limit = GAIN_LIMIT

    def energies(times: Tensor) -> Tensor:
        return z.abs().square() * torch.exp(-2 * sigma * times[:, None])

    def f(times: Tensor) -> Tensor:
        reported = energies(times) * model.energy_units
        found = reported @ model.K.T
        if model.g is not None:
            network = model.g(reported) - model.g(torch.zeros(12).double())
            found = found + (network * reported.sum(-1, keepdim=True) if c.second_order else network)
        found = found * torch.cat([model.rate_units] * 2)
        if c.adiabatic:  # ω' ² = ω² + 2ωκ, κ of the amplitudes of these actions
            linear = kappa = (reported @ model.K.T)[:, 12:] * model.rate_units
            for _ in range(FIXED_POINT_STEPS):
                amplitudes = reported * omega.sqrt() / (omega + 2 * kappa).sqrt()
                kappa = (amplitudes @ model.K.T)[:, 12:] * model.rate_units
            found[:, 12:] += (omega.square() + 2 * omega * kappa).sqrt() - omega - linear
        return found

    fine = torch.arange(60 * 100 + 1, dtype=torch.float64) / 100
    integral = torch.cumulative_trapezoid(f(fine), fine, dim=0)[99::100]
    growth, turn = integral.chunk(2, dim=-1)
    times = torch.arange(1, 61, dtype=torch.float64)[:, None]
    expected = z * torch.exp(torch.complex(limit * torch.tanh(growth / limit) - sigma * times, omega * times + turn))
    assert relative(model.latents(z[None], times[:, 0])[0], expected) < 1e-6
    assert relative(model(initial(1).double(), 60)[0], model.decode(expected)) < 1e-6


@torch.no_grad()
@pytest.mark.parametrize("sizes", KINDS)
def test_any_splitting_into_blocks_is_the_same_motion(sizes: dict) -> None:
    model = stirred_model(**sizes)
    whole = model(initial(), 8000)
    state, parts = model.encode(initial()), []
    for steps in (1, 64, 65, 2047, 3, 5820):
        part, state = model.advance(state, steps)
        parts.append(part)
    assert relative(torch.cat(parts, 1), whole) < 1e-5
    assert state.time == 8000


@torch.no_grad()
@pytest.mark.parametrize("sizes", KINDS)
def test_rendering_is_random_access(sizes: dict) -> None:
    model = stirred_model(**sizes)
    whole = model(initial(), 2000)
    frames = torch.tensor([1700, 3, 40, 2000])
    z = model.latents(model.encode(initial()).origin, frames)
    assert relative(model.decode(z), whole[:, frames - 1]) < 1e-5


@torch.no_grad()
def test_phases_stay_exact_after_a_million_steps() -> None:
    """Against rational arithmetic's substitute, the phase reduced step by step in two parts; f is spent by then."""
    model = string_model("physics")
    model.nu_log.fill_(math.log(1e-7))
    state = model.encode(initial(1))
    late = type(state)(state.origin, 1_000_000, state.integral)
    omega = model.theta_log.double().exp()
    thousand = torch.remainder(1000 * omega, 2 * math.pi)
    angle = torch.remainder(1000 * thousand, 2 * math.pi) + omega
    factor = torch.polar(torch.full_like(angle, math.exp(-1e-7 * 1_000_001)), angle)
    expected = model.decode((state.origin * factor).to(state.origin.dtype))
    assert relative(model.advance(late, 1)[0][:, 0], expected) < 1e-5


@torch.no_grad()
@pytest.mark.parametrize("sizes", KINDS)
def test_listening_is_the_grid_at_that_point(sizes: dict) -> None:
    model = stirred_model(**sizes)
    weights = listening_weights([0.37, 0.123], 101)
    assert relative(model(initial(), 50, weights), model(initial(), 50) @ weights.float()) < 1e-5


def test_listening_with_gradients_is_listening_without() -> None:
    model = stirred_model()
    weights = listening_weights([0.37], 101)
    heard = model(initial(), 1000, weights)
    heard.square().sum().backward()
    assert model.K.grad is not None
    with torch.no_grad():
        assert relative(model(initial(), 1000, weights), heard.detach()) < 1e-5


@torch.no_grad()
def test_phases_stay_exact_at_a_listening_point() -> None:
    """A render a million samples on, against random access."""
    model = stirred_model(eigenvalue_widths=())  # without a network nothing was added up meanwhile
    model.nu_log.fill_(math.log(1e-7))
    state = model.encode(initial(1))
    late = type(state)(state.origin, 1_000_000, state.integral)
    weights = listening_weights([0.37], 101)
    heard, _ = model.advance(late, 300, weights)
    exact = model.decode(model.latents(state.origin, 1_000_000 + torch.arange(1, 301))) @ weights.float()
    assert relative(heard, exact) < 1e-5


@torch.no_grad()
def test_integration_is_exact_for_parabolas() -> None:
    half_nodes, times = torch.arange(7).double() / 2, torch.tensor([0, 0.3, 1, 1.5, 2.9, 3]).double()
    integral, slope = integrate_parabolas((1 + 2 * half_nodes - 3 * half_nodes**2)[None, :, None], times)
    torch.testing.assert_close(integral[0, :, 0], times + times**2 - times**3)
    torch.testing.assert_close(slope[0, :, 0], 1 + 2 * times - 3 * times**2)


@torch.no_grad()
def test_physics_initialisation_is_the_linear_string() -> None:
    string, rate_hz = StringParameters(), 4_000
    state = ModalState.at_rest(torch.randn(1, 10, dtype=torch.float64, generator=torch.Generator().manual_seed(2)))
    times_s = torch.arange(401, dtype=torch.float64) / rate_hz
    truth = to_grid(solve_linear(resonator_of(string, state.modes), state, times_s), 101)
    model = string_model("physics").double()
    assert relative(model(truth[:, 0], 400), truth[:, 1:]) < 1e-4  # the logarithms were float32


@torch.no_grad()
def test_averaging_is_nearly_the_tension_modulated_string() -> None:
    string, rate_hz, steps = StringParameters(), 4_000, 4000
    amplitudes = draw("gaussian", 8, 10)
    solver = SplittingSolver(resonator_of(string, 10), rate_hz)
    truth = solver.solve(ModalState.at_rest(amplitudes), steps) @ torch.from_numpy(synthesis_matrix(101, 10) / 1e-3)
    errors = {}
    for how in ("physics", "averaging"):
        model = IntegratedPhase(IntegratedPhaseConfiguration(state_size=10))
        model.initialise(how, Physics(resonator_of(string, 10), rate_hz, 1e-3), torch.Generator().manual_seed(0))
        difference = model(truth[:, 0].float(), steps) - truth[:, 1:]
        errors[how] = float((difference.square().sum((1, 2)) / truth[:, 1:].square().sum((1, 2))).mean())
    assert errors["averaging"] < 2e-4
    assert errors["physics"] > 0.5


@torch.no_grad()
def test_in_its_units_all_numbers_are_of_the_order_of_one() -> None:
    model = string_model()
    assert 0.1 < model.K.abs().max() < 2 and 0.01 < model.M_out.abs().max() < 20
    assert float(model.energy_units[0]) == pytest.approx(
        float(resonator_of(StringParameters(), 3).relative_tension_rise(np.array([1e-3, 0, 0]))), rel=1e-6
    )


@torch.no_grad()
@pytest.mark.parametrize("high", [3, 8])
def test_modulation_is_what_a_strong_low_mode_does_to_a_high_one_within_a_period(high: int) -> None:
    """The error of averaging alone is of first order in ΔT/T₀, with modulation of second."""
    string, rate_hz, steps = StringParameters(), 16_000, 60
    errors: dict[bool, list[float]] = {False: [], True: []}
    for strength in (1.0, 0.5):
        amplitudes = torch.zeros(1, 10, dtype=torch.float64)
        amplitudes[0, 0], amplitudes[0, high] = 8e-3 * strength, 1e-5
        truth = SplittingSolver(resonator_of(string, 10), rate_hz).solve(ModalState.at_rest(amplitudes), steps)
        for modulation in errors:
            model = IntegratedPhase(IntegratedPhaseConfiguration(state_size=10)).double()
            model.initialise(
                "averaging", Physics(resonator_of(string, 10), rate_hz, 1e-3), torch.Generator().manual_seed(0)
            )
            if not modulation:
                model.M_in.zero_()
                model.M_out.zero_()
            found = to_modes(model(to_grid(amplitudes / 1e-3, 101), steps), 10)[0, :, high] * 1e-3
            errors[modulation].append(relative(found, truth[0, 1:, high]))
    assert errors[True][0] < 0.2 * errors[False][0]
    assert 3 < errors[False][0] / errors[False][1] < 5  # ΔT/T₀ goes with the square of the strength
    assert 10 < errors[True][0] / errors[True][1] < 25


@torch.no_grad()
def test_the_action_keeps_the_phase_long_after_the_start() -> None:
    """Energies that decay from the first amplitudes, not from the actions, mistake the frequency for good."""
    string, rate_hz = StringParameters(), 4_000
    amplitudes = draw("noise", 8, 10)
    truth, _ = SplittingSolver(resonator_of(string, 10), rate_hz).advance(ModalState.at_rest(amplitudes), 5 * rate_hz)
    errors = {}
    for adiabatic in (False, True):
        model = IntegratedPhase(IntegratedPhaseConfiguration(state_size=10, adiabatic=adiabatic))
        model.initialise(
            "averaging", Physics(resonator_of(string, 10), rate_hz, 1e-3), torch.Generator().manual_seed(0)
        )
        found, _ = model.advance(model.encode(to_grid(amplitudes / 1e-3, 101).float()), 5 * rate_hz)
        late = to_modes(found[:, -rate_hz:], 10) * 1e-3 - truth[:, -rate_hz:]
        errors[adiabatic] = float(late.square().sum() / truth[:, -rate_hz:].square().sum())
    assert errors[True] < 0.3 * errors[False]


def test_averaging_of_the_linear_string_is_the_linear_string() -> None:
    model = IntegratedPhase(IntegratedPhaseConfiguration(state_size=10))
    physics = Physics(resonator_of(StringParameters(), 10, tension_modulated=False), 4_000, 1e-3)
    model.initialise("averaging", physics, torch.Generator().manual_seed(0))
    assert not model.K.any()


@torch.no_grad()
def test_no_parameters_let_it_grow() -> None:
    """|z(t)| ≤ |z(0)| e^{b - σt} whatever the weights; a render keeps to it within 8/27 of b between its segments."""
    for scale in (1.0, 30.0, 1e3):
        model = string_model("random")
        generator = torch.Generator().manual_seed(3)
        for parameter in model.parameters():
            parameter.normal_(0, scale, generator=generator)
        for logarithm in (model.nu_log, model.theta_log):
            logarithm.uniform_(-12, 3, generator=generator)
        state = model.encode(initial(1) / scale)
        model.M_out.zero_()
        model.decoder.weight.copy_(torch.eye(101, 24))
        model.decoder.bias.zero_()
        parts = model.advance(state, 3000)[0][0, :, :24].double()
        found = torch.hypot(*parts.chunk(2, dim=-1))
        b, sigma = 0.3 * math.log(10), model.nu_log.double().exp()
        bound = state.origin.abs().double() * torch.exp(35 / 27 * b - sigma * torch.arange(1, 3001)[:, None])
        assert torch.isfinite(found).all()
        assert (found <= bound * (1 + 1e-4) + 1e-30).all()
        frames = torch.tensor([1, 10, 100, 1000])
        exact = model.latents(state.origin, frames)[0].abs().double()
        assert (exact <= state.origin.abs() * torch.exp(b - sigma * frames[:, None]) * (1 + 1e-5)).all()


@pytest.mark.parametrize("how", IntegratedPhase.initialisations)
def test_the_seed_decides_all(how: str) -> None:
    first, again, other = (string_model(how, seed).state_dict() for seed in (1, 1, 2))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not torch.equal(first["nu_log"], other["nu_log"])


@pytest.mark.parametrize("sizes", KINDS)
def test_every_parameter_learns(sizes: dict) -> None:
    """Random access and rendering have the same finite gradients, also for a latent that is exactly zero."""
    model = stirred_model(**sizes).double()
    start = initial(1).double()
    frames = torch.tensor([3, 50, 200])
    with torch.no_grad():
        for network in (model.encoder, model.encoder_residual):
            for layer in network.modules() if network else ():
                if isinstance(layer, torch.nn.Linear) and layer.out_features == 24:
                    layer.weight[[4, 16]] = 0
                    layer.bias[[4, 16]] = 0
    gradients = []
    for found in (model.decode(model.latents(model.encode(start).origin, frames)), model(start, 200)[:, frames - 1]):
        model.zero_grad()
        found.square().sum().backward()
        gradients.append({name: p.grad.clone() for name, p in model.named_parameters() if p.grad is not None})
    assert gradients[0].keys() == dict(model.named_parameters()).keys()
    for name, gradient in gradients[0].items():
        assert torch.isfinite(gradient).all(), name
        assert torch.isfinite(gradients[1][name]).all(), name
        if not name.startswith("encoder"):  # the latent at zero: polar coordinates have no gradient there
            assert relative(gradients[1][name], gradient) < 1e-3, name


def test_sizes_and_name() -> None:
    assert 57_000 < count_parameters(IntegratedPhase(IntegratedPhaseConfiguration(state_size=10))) < 58_000
    assert model_class("koopman_integrated") is IntegratedPhase
    assert MODELS["koopman_integrated"][1] is IntegratedPhaseConfiguration
    with torch.device("meta"):
        assert IntegratedPhase(IntegratedPhaseConfiguration()).K.is_meta


@pytest.mark.parametrize(
    "sizes", [{"grid_points": 0}, {"state_size": -1}, {"eigenvalue_widths": (4, 0)}, {"node_spacing": 0}]
)
def test_impossible_sizes_are_named(sizes: dict) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(sizes))} must lie in 1"):
        IntegratedPhaseConfiguration(**sizes)


def test_physics_initialisation_needs_a_latent_for_each_mode() -> None:
    with pytest.raises(ValueError, match="at least the 10 modes, not 5"):
        string_model("physics", state_size=5)
    with pytest.raises(ValueError, match="'guess' is not one of random, physics, averaging"):
        string_model("guess")
