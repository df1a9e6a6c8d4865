"""Latents that share a tension: the laws, the truth on two strings and at any rate, pulled and struck."""

import math
from typing import Any, ClassVar

import pytest
import torch
from torch import Tensor

from engine.models import build_model
from engine.models.base import Physics
from engine.models.koopman_tension import KoopmanTension
from engine.pluck import Pluck
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver
from engine.values.string import StringParameters
from tests.engine.models.laws import ModelLaws, released
from tests.engine.sounds import relative
from tests.engine.tensors import to_grid, to_modes

NYLON = StringParameters()
STEEL = StringParameters(0.648, 5.0671e-08, 2.0432e-16, 7850.0, 2.2e11, 8e-06, 1.4e-06, 72.2016)


class TestKoopmanTension(ModelLaws):
    name = "koopman_tension"
    count = 12
    sizes: ClassVar = {"modes": 10}
    linear: ClassVar = {"series": 1e-6, "kicks": 1e-6}
    too_small: ClassVar = ({"modes": 9}, r"model_configuration\.modes is 9")
    drawn = False

    def stir(self, model: Any, generator: torch.Generator) -> None:
        """Curves of which every term counts."""
        for curve in model.parameters():
            curve.normal_(0, 0.05, generator=generator)

    @pytest.mark.parametrize("seed", range(3))
    @torch.no_grad()
    def test_any_weights_stay_bounded_and_fall_silent(self, seed):
        model, generator = self.made("series"), torch.Generator().manual_seed(seed)
        for curve in model.parameters():
            curve.copy_(10.0 ** torch.randint(-2, 30, (), generator=generator) * torch.randn(4, generator=generator))
        start = released(1)
        frames, state = model.advance(model.encode(start), 40_000)
        assert bool(torch.isfinite(frames).all())
        assert float(frames.abs().max()) < 20 * float(start.abs().max())
        for _ in range(20):
            frames, state = model.advance(state, 40_000)
        assert float(frames.abs().max()) < 1e-6 * float(start.abs().max())


def made(string: StringParameters, modes: int, how: str = "series", rate_hz: float = 48_000) -> KoopmanTension:
    model = build_model("koopman_tension", {"modes": modes})
    model.initialise(how, Physics(resonator_of(string, modes), rate_hz, 1e-3), torch.Generator())
    return model.eval()


def tense_m(string: StringParameters, rise: float, amplitudes: Tensor) -> Tensor:
    """A displacement (1, 101) in m, of modes in this ratio, that raises the tension by `rise`."""
    known = float(resonator_of(string, len(amplitudes)).relative_tension_rise(amplitudes.numpy()))
    return to_grid(amplitudes[None] * math.sqrt(rise / known), 101)


def pluck_m(string: StringParameters, modes: int, rise: float) -> Tensor:
    triangle = Pluck(0.3, 1.0, "triangular").displacement(101)
    return tense_m(string, rise, to_modes(torch.from_numpy(triangle), modes))


def modes_alike_m(rise: float) -> Tensor:
    """All modes of the nylon string add alike to it, as no soft pluck's do."""
    return tense_m(NYLON, rise, (-1.0) ** torch.arange(1, 26, dtype=torch.float64))


@torch.no_grad()
def error(model: KoopmanTension, string: StringParameters, pulled_m: Tensor, rate_hz: float, steps: int) -> float:
    """Relative MSE against the truth."""
    resonator = resonator_of(string, model.configuration.modes)
    state = ModalState.at_rest(to_modes(pulled_m, resonator.modes))
    truth_m = to_grid(SplittingSolver(resonator, rate_hz).solve(state, steps)[:, 1:], 101)
    return relative(model((pulled_m / 1e-3).float(), steps).double() * 1e-3, truth_m) ** 2


@pytest.mark.parametrize(("string", "modes"), [(NYLON, 57), (STEEL, 40)], ids=["nylon", "steel"])
def test_what_backward_error_analysis_knows_is_worth_two_orders(string, modes):
    kicks, series = (
        error(made(string, modes, how), string, pluck_m(string, modes, 0.3), 48_000, 2_400)
        for how in ("kicks", "series")
    )
    assert series < 1e-2 * kicks
    assert series < 1e-8


@pytest.mark.parametrize("rate_hz", [4_000, 16_000, 44_100, 96_000])
def test_any_rate_is_the_truth_at_that_rate(rate_hz):
    """Phases between nodes stay where the curves were learned."""
    model = made(NYLON, 25).for_resonator(Physics(resonator_of(NYLON, 25), rate_hz, 1e-3))
    assert error(model, NYLON, pluck_m(NYLON, 25, 0.2), rate_hz, rate_hz // 20) < 1e-8
    with torch.no_grad():
        _, state = model.advance(model.encode(torch.zeros(1, 101)), 1)
    phases = 1 / int(state.nodes[0]) * model.theta_log.exp()
    assert float(phases[0]) <= model.configuration.node_phase + 1e-12
    assert float(phases[-1]) <= model.configuration.highest_phase + 1e-12


@pytest.mark.parametrize("compiled", [True, False])
def test_soft_and_hard_plucks_go_together(compiled):
    model = made(NYLON, 25, rate_hz=16_000)
    plucks = torch.cat([modes_alike_m(0.5), pluck_m(NYLON, 25, 0.1), modes_alike_m(0.2), pluck_m(NYLON, 25, 0.01)])
    start = (plucks / 1e-3).float()
    with torch.set_grad_enabled(not compiled):
        together, middle = model.advance(model.encode(start), 30)
        rest, state = model.advance(middle, 20)
        alone = torch.cat([model(one[None], 50) for one in start])
    amplitudes = model.amplitudes(model.encode(start), 50)
    torch.testing.assert_close(torch.cat([together, rest], dim=1).detach(), alone.detach(), rtol=0, atol=1e-5)
    torch.testing.assert_close((amplitudes @ model.shapes).detach(), alone.detach(), rtol=0, atol=1e-5)
    assert state.nodes.tolist() == [5, 2, 3, 2]


@torch.no_grad()
def test_a_string_struck_where_it_rests_takes_nodes_and_energy_of_its_speed():
    """It swings as far as one that was pulled so: what bounds it is the energy, not the displacement it begins at."""
    model, resonator = made(NYLON, 25, rate_hz=16_000), resonator_of(NYLON, 25)
    amplitudes = to_modes(modes_alike_m(0.5), resonator.modes)
    speeds = amplitudes * torch.from_numpy(resonator.eigenvalues().imag) / 16_000
    pulled = model.encode(to_grid(amplitudes, 101) / 1e-3)
    struck = model.encode(torch.zeros(1, 101).double(), to_grid(speeds, 101) / 1e-3)
    assert [model.advance(state, 1)[1].nodes.tolist() for state in (struck, pulled)] == [[5], [5]]
    assert 0.5 < float(struck.largest_energy / pulled.largest_energy) <= 1
    truth, _ = SplittingSolver(resonator, 16_000).advance(ModalState(0 * amplitudes, speeds * 16_000), 1_600)
    assert relative(model.amplitudes(struck, 1_600) * 1e-3, truth) ** 2 < 1e-4
