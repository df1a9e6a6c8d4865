"""The integrated phase: the laws, a plain quadrature, what averaging knows, and that nothing grows."""

import copy
import math
from typing import Any, ClassVar

import pytest
import torch
from torch import Tensor

from engine.models._averaging import FIXED_POINT_STEPS
from engine.models.base import Physics
from engine.models.configurations import IntegratedPhaseConfiguration
from engine.models.integrated_phase import GAIN_LIMIT, IntegratedPhase
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver
from engine.values.string import StringParameters
from tests.engine.models.laws import PHYSICS, POINTS, ModelLaws, relative, released
from tests.engine.tensors import listening_weights, to_grid, to_modes
from training.data.draws import draw_noise

RESONATOR = resonator_of(StringParameters(), 10)


class TestIntegratedPhase(ModelLaws):
    name = "koopman_integrated"
    count = 78809
    sizes: ClassVar = {"state_size": 12, "encoder_widths": (12,), "eigenvalue_widths": (12, 12)}
    variants = (
        {"encoder_widths": (), "eigenvalue_widths": ()},
        {},
        {"node_spacing": 7},
        {"adiabatic": True, "second_order": True},
    )
    blocks = (1, 64, 65, 2047, 3, 5820)
    linear: ClassVar = {"physics": 1e-4, "averaging": 1e-4}
    too_small: ClassVar = ({"state_size": 5}, "at least the 10 modes, not 5")

    def stir(self, model: Any, generator: torch.Generator) -> None:
        """Every last layer and the real part of K are away from zero."""
        model.initialise("averaging", PHYSICS, generator)
        for name, parameter in model.named_parameters():
            if not parameter.any() and name != "K":
                parameter.normal_(0, 0.1, generator=generator)
        model.K[:12].normal_(0, 0.02, generator=generator)

    @torch.no_grad()
    @pytest.mark.parametrize("sizes", variants, ids=str)
    def test_it_is_a_plain_quadrature(self, sizes):
        """The definition, with the network's integral by the trapezoid rule at every hundredth of a sample."""
        model = self.stirred(**sizes | {"node_spacing": 4}).double()
        c, start = model.configuration, released(1).double()
        z = model.encode(start).origin[0]
        sigma, omega = model.nu_log.exp(), model.theta_log.exp()

        def f(times: Tensor) -> Tensor:
            reported = z.abs().square() * torch.exp(-2 * sigma * times[:, None]) * model.energy_units
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
        growth, turn = torch.cumulative_trapezoid(f(fine), fine, dim=0)[99::100].chunk(2, dim=-1)
        times = torch.arange(1, 61, dtype=torch.float64)[:, None]
        gain = GAIN_LIMIT * torch.tanh(growth / GAIN_LIMIT)
        expected = z * torch.exp(torch.complex(gain - sigma * times, omega * times + turn))
        latents = model.latents(z[None], times.flip(0)[:, 0])[0].flip(0)  # in any order
        assert relative(*map(torch.view_as_real, (latents, expected))) < 1e-6
        assert relative(model(start, 60)[0], model.decode(expected)) < 1e-6

    @torch.no_grad()
    def test_its_phases_stay_exact_after_a_million_steps(self):
        """Without coupling, a render there and random access against a phase reduced in two parts."""
        model = self.made("physics")
        model.nu_log.fill_(math.log(1e-7))
        state, weights = model.encode(released(1)), listening_weights([0.37], POINTS).float()
        omega, late = model.theta_log.double().exp(), 1_000_000 + torch.arange(1, 301)[:, None]
        angle = torch.remainder(1000 * torch.remainder(1000 * omega, 2 * math.pi), 2 * math.pi)
        angle = angle + omega * (late - 1_000_000)
        expected = (state.origin * torch.polar(torch.exp(-1e-7 * late) * torch.ones_like(omega), angle)).cfloat()
        latents = model.latents(state.origin, late[:, 0])[0]
        assert relative(*map(torch.view_as_real, (latents, expected))) < 1e-5
        for readout, exact in ((None, model.decode(expected)), (weights, model.decode(expected) @ weights)):
            then = type(state)(state.origin, 1_000_000, state.integral)
            assert relative(model.advance(then, 300, readout)[0][0], exact) < 1e-5

    def test_gradients_are_finite_also_for_a_latent_that_is_exactly_zero(self, motion):
        model, frames = copy.deepcopy(motion.model).double(), torch.tensor([3, 50, 200])
        start = released(1).double()
        with torch.no_grad():
            for name, parameter in model.named_parameters():
                if name.startswith("encoder") and len(parameter) == 24:
                    parameter[[4, 16]] = 0
        at_once = model.decode(model.latents(model.encode(start).origin, frames))
        for found in (at_once, model(start, 200)):
            model.zero_grad()
            found.square().sum().backward()
            assert all(parameter.grad.isfinite().all() for parameter in model.parameters())

    @torch.no_grad()
    def test_no_weights_let_it_grow(self):
        """|z(t)| ≤ |z(0)| e^{b - σt}; a render keeps to it within 8/27 of b between its segments."""
        for scale in (1.0, 30.0, 1e3):
            model = self.made("random", grid_points=101)
            generator = torch.Generator().manual_seed(3)
            for parameter in model.parameters():
                parameter.normal_(0, scale, generator=generator)
            for logarithm in (model.nu_log, model.theta_log):
                logarithm.uniform_(-12, 3, generator=generator)
            state = model.encode(released(1, 101) / scale)
            model.M_out.zero_()
            model.decoder.weight.copy_(torch.eye(101, 24))
            model.decoder.bias.zero_()
            found = torch.hypot(*model.advance(state, 3000)[0][0, :, :24].double().chunk(2, dim=-1))
            b, sigma = 0.3 * math.log(10), model.nu_log.double().exp()
            bound = state.origin.abs().double() * torch.exp(35 / 27 * b - sigma * torch.arange(1, 3001)[:, None])
            assert torch.isfinite(found).all()
            assert (found <= bound * (1 + 1e-4) + 1e-30).all()
            frames = torch.tensor([1, 10, 100, 1000])
            exact = model.latents(state.origin, frames)[0].abs().double()
            assert (exact <= state.origin.abs() * torch.exp(b - sigma * frames[:, None]) * (1 + 1e-5)).all()


def averaged(how: str = "averaging", rate_hz: int = 4_000, adiabatic: bool = False) -> IntegratedPhase:
    model = IntegratedPhase(IntegratedPhaseConfiguration(state_size=10, adiabatic=adiabatic))
    model.initialise(how, Physics(RESONATOR, rate_hz, 1e-3), torch.Generator().manual_seed(0))
    return model


@torch.no_grad()
@pytest.mark.parametrize("high", [3, 8])
def test_modulation_is_what_a_strong_low_mode_does_to_a_high_one_within_a_period(high):
    """The error of averaging alone is of first order in ΔT/T₀, with modulation of second."""
    errors: dict[bool, list[float]] = {False: [], True: []}
    for strength in (1.0, 0.5):
        amplitudes = torch.zeros(1, 10, dtype=torch.float64)
        amplitudes[0, 0], amplitudes[0, high] = 8e-3 * strength, 1e-5
        truth = SplittingSolver(RESONATOR, 16_000).solve(ModalState.at_rest(amplitudes), 60)
        for modulation in errors:
            model = averaged(rate_hz=16_000).double()
            if not modulation:
                model.M_in.zero_()
                model.M_out.zero_()
            found = to_modes(model(to_grid(amplitudes / 1e-3, 101), 60), 10)[0, :, high] * 1e-3
            errors[modulation].append(relative(found, truth[0, 1:, high]))
    assert errors[True][0] < 0.2 * errors[False][0]
    assert 3 < errors[False][0] / errors[False][1] < 5  # ΔT/T₀ goes with the square of the strength
    assert 10 < errors[True][0] / errors[True][1] < 25


@torch.no_grad()
def test_the_action_keeps_the_phase_long_after_the_start():
    """Energies that decay from the first amplitudes, not from the actions, mistake the frequency for good."""
    noise, rate_hz = draw_noise(2, 101, torch.Generator().manual_seed(0)), 4_000
    amplitudes = to_modes(torch.from_numpy(noise), 10)
    _, late = SplittingSolver(RESONATOR, rate_hz).advance(ModalState.at_rest(amplitudes), 4 * rate_hz)
    truth, _ = SplittingSolver(RESONATOR, rate_hz).advance(late, rate_hz)
    errors = {}
    for adiabatic in (False, True):
        model = averaged(adiabatic=adiabatic)
        state = model.encode(to_grid(amplitudes / 1e-3, 101).float())
        found, _ = model.sample(state, 4 * rate_hz + torch.arange(1, rate_hz + 1), 5 * rate_hz)
        errors[adiabatic] = float((to_modes(found, 10) * 1e-3 - truth).square().sum() / truth.square().sum())
    assert errors[True] < 0.3 * errors[False]
