"""Latents that share a tension: against the truth on many strings, at rest, at other rates, and for wild weights."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
import torch
from torch import Tensor

from engine.models import _tension_law, build_model
from engine.models.base import Physics
from engine.models.koopman_tension import SERIES, KoopmanTension
from engine.pluck import Pluck
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver
from engine.values.string import StringParameters
from tests.engine.tensors import displacement_of, of_tension_rise, to_grid, to_modes

NYLON = StringParameters()
STEEL = StringParameters(0.648, 5.0671e-08, 2.0432e-16, 7850.0, 2.2e11, 8e-06, 1.4e-06, 72.2016)


def made(
    string: StringParameters, modes: int, how: str, rate_hz: float = 48_000, linear: bool = False
) -> KoopmanTension:
    model = build_model("koopman_tension", {"modes": modes})
    assert isinstance(model, KoopmanTension)
    physics = Physics(resonator_of(string, modes, tension_modulated=not linear), rate_hz, 1e-3)
    model.initialise(how, physics, torch.Generator())
    return model.eval()


def pluck_m(string: StringParameters, modes: int, rise: float) -> Tensor:
    """A displacement (1, 101) in m that raises the tension by `rise`."""
    resonator = resonator_of(string, modes)
    amplitudes = to_modes(displacement_of(Pluck(0.3, 1.0, "triangular")), modes)
    return to_grid(of_tension_rise(resonator, amplitudes, rise), 101)[None]


def true_motion(string: StringParameters, displacement_m: Tensor, modes: int, rate_hz: float, steps: int) -> Tensor:
    resonator = resonator_of(string, modes)
    solver = SplittingSolver(resonator, rate_hz)
    state = ModalState.at_rest(to_modes(displacement_m, resonator.modes))
    return to_grid(solver.solve(state, steps)[:, 1:], 101)


def relative_error(model: KoopmanTension, displacement_m: Tensor, truth_m: Tensor) -> float:
    with torch.inference_mode():
        found = model((displacement_m / 1e-3).float(), truth_m.shape[1]).double() * 1e-3
    return float((found - truth_m).square().sum() / truth_m.square().sum())


@pytest.mark.parametrize(("string", "modes", "rise"), [(NYLON, 57, 0.3), (STEEL, 40, 0.3)])
def test_what_backward_error_analysis_knows_is_worth_two_orders(
    string: StringParameters, modes: int, rise: float
) -> None:
    displacement = pluck_m(string, modes, rise)
    truth = true_motion(string, displacement, modes, 48_000, 4_800)
    kicks = relative_error(made(string, modes, "kicks"), displacement, truth)
    series = relative_error(made(string, modes, "series"), displacement, truth)
    assert series < 1e-2 * kicks
    assert series < 1e-8


def test_a_linear_string_is_exact() -> None:
    displacement = pluck_m(NYLON, 25, 0.3)
    resonator = resonator_of(NYLON, 25, tension_modulated=False)
    solved = SplittingSolver(resonator, 4_000).solve(ModalState.at_rest(to_modes(displacement, resonator.modes)), 400)
    truth = to_grid(solved[:, 1:], 101)
    assert relative_error(made(NYLON, 25, "series", 4_000, linear=True), displacement, truth) < 1e-12


def test_a_quiet_string_is_the_linear_one() -> None:
    displacement = pluck_m(NYLON, 25, 1e-9)
    linear = made(NYLON, 25, "series", linear=True)
    with torch.inference_mode():
        truth = linear((displacement / 1e-3).float(), 4_800).double() * 1e-3
    assert relative_error(made(NYLON, 25, "series"), displacement, truth) < 1e-12


def test_another_string_takes_what_was_learned() -> None:
    model = made(NYLON, 25, "series")
    other = model.for_resonator(Physics(resonator_of(STEEL, 40), 48_000, 1e-3))
    displacement = pluck_m(STEEL, 40, 0.1)
    expected = made(STEEL, 40, "series")
    with torch.inference_mode():
        assert torch.equal(other(displacement.float(), 100), expected(displacement.float(), 100))
    assert torch.equal(other.r, model.r)


@pytest.mark.parametrize("rate_hz", [4_000, 16_000, 44_100, 96_000])
def test_any_rate_is_the_truth_at_that_rate(rate_hz: int) -> None:
    displacement = pluck_m(NYLON, 25, 0.2)
    model = made(NYLON, 25, "series").for_resonator(Physics(resonator_of(NYLON, 25), rate_hz, 1e-3))
    steps = rate_hz // 20
    truth = true_motion(NYLON, displacement, 25, rate_hz, steps)
    with torch.inference_mode():
        state = model.encode((displacement / 1e-3).float())
        found, _ = model.advance(state, steps)
    error = (found.double() * 1e-3 - truth).square().sum() / truth.square().sum()
    assert float(error) < 1e-8


def test_the_compiled_loop_is_the_definition() -> None:
    displacement = (pluck_m(NYLON, 25, 0.4) / 1e-3).float()
    model = made(NYLON, 25, "series")
    plain, _ = model.advance(model.encode(displacement), 300)
    with torch.no_grad():
        compiled, _ = model.advance(model.encode(displacement), 300)
    torch.testing.assert_close(compiled, plain.detach(), rtol=0, atol=1e-6)


def modes_alike_m(rise: float, modes: int = 25) -> Tensor:
    """A displacement (1, 101) in m to which all modes of the nylon string add alike, as no soft pluck's do."""
    resonator = resonator_of(NYLON, modes)
    amplitudes = torch.ones(modes, dtype=torch.float64)
    amplitudes[::2] = -1
    return to_grid(of_tension_rise(resonator, amplitudes, rise), 101)[None]


def test_a_hard_pluck_with_its_stretch_in_high_modes_takes_more_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    displacement = modes_alike_m(0.5)
    truth = true_motion(NYLON, displacement, 25, 16_000, 1_600)
    model = made(NYLON, 25, "series", 16_000)
    error = relative_error(model, displacement, truth)
    assert error < 1e-4
    monkeypatch.setattr(_tension_law, "HARDEST_KICK", math.inf)
    assert relative_error(model, displacement, truth) > 30 * error


@pytest.mark.parametrize("compiled", [True, False])
def test_soft_and_hard_plucks_go_together(compiled: bool) -> None:
    model = made(NYLON, 25, "series", 16_000)
    plucks = torch.cat([modes_alike_m(0.5), pluck_m(NYLON, 25, 0.1), modes_alike_m(0.2), pluck_m(NYLON, 25, 0.01)])
    released = (plucks / 1e-3).float()
    with torch.set_grad_enabled(not compiled):
        together, middle = model.advance(model.encode(released), 30)
        rest, state = model.advance(middle, 20)
        alone = torch.cat([model(one[None], 50) for one in released])
    with torch.no_grad():
        amplitudes = model.amplitudes(model.encode(released), 50)
    torch.testing.assert_close(torch.cat([together, rest], dim=1).detach(), alone.detach(), rtol=0, atol=1e-5)
    torch.testing.assert_close(amplitudes @ model.shapes, alone.detach(), rtol=0, atol=1e-5)
    assert state.nodes is not None
    assert state.nodes.tolist() == [5, 2, 3, 2]


LOW = StringParameters(0.65, 5e-7, 7.4e-16, 1000.0, 2e10, 1.376e-3, 2.41e-7, 3.461)  # 64 Hz


def ringing(string: StringParameters, modes: int, pluck: Pluck, rise: float, frames: int) -> tuple[Tensor, Tensor]:
    """A string so long after a pluck that raises the tension by `rise`: amplitudes in m, speeds in m a frame."""
    resonator = resonator_of(string, modes)
    amplitudes = of_tension_rise(resonator, to_modes(displacement_of(pluck), modes), rise)
    _, state = SplittingSolver(resonator, 48_000).advance(ModalState.at_rest(amplitudes[None]), frames)
    return state.amplitude, state.velocity / 48_000


@pytest.mark.parametrize(
    ("string", "modes", "pluck", "frames", "allowed"),
    [
        (LOW, 99, Pluck(0.3, 1.0, "triangular"), 301, 1e-9),
        (LOW, 99, Pluck(0.2, 1.0, "raised_cosine", 0.08), 301, 2e-7),
        (NYLON, 57, Pluck(0.3, 1.0, "triangular"), 777, 1e-11),
    ],
    ids=["low", "low and narrow", "nylon"],
)
def test_a_string_that_rings_sets_out_as_truly_as_one_at_rest(
    string: StringParameters, modes: int, pluck: Pluck, frames: int, allowed: float
) -> None:
    """Relative MSE of a second with a tension rise of 50 %; speeds as they are instead of w: 1e-7 to 1e-4."""
    resonator, model = resonator_of(string, modes), made(string, modes, "series")
    amplitudes, speeds = ringing(string, modes, pluck, 0.5, frames)
    truth, _ = SplittingSolver(resonator, 48_000).advance(ModalState(amplitudes, speeds * 48_000), 48_000)
    state = model.encode(*(to_grid(each, 101) / 1e-3 for each in (amplitudes, speeds)))
    found = model.amplitudes(state, 48_000) * 1e-3
    assert float((found - truth).square().sum() / truth.square().sum()) < allowed


def test_a_speed_of_nothing_is_rest_bit_for_bit() -> None:
    displacement = pluck_m(NYLON, 25, 0.4) / 1e-3
    model = made(NYLON, 25, "series")
    with torch.no_grad():
        moved, _ = model.advance(model.encode(displacement, torch.zeros_like(displacement)), 300)
        assert torch.equal(moved, model.advance(model.encode(displacement), 300)[0])


def test_a_string_struck_where_it_rests_takes_nodes_and_energy_of_its_speed() -> None:
    """It swings as far as one that was pulled so: what bounds it is the energy, not the displacement it begins at."""
    model = made(NYLON, 25, "series", 16_000)
    resonator = resonator_of(NYLON, 25)
    amplitudes = to_modes(modes_alike_m(0.5), resonator.modes)
    speeds = amplitudes * torch.from_numpy(resonator.eigenvalues().imag) / 16_000
    pulled = model.encode(to_grid(amplitudes, 101) / 1e-3)
    struck = model.encode(torch.zeros(1, 101).double(), to_grid(speeds, 101) / 1e-3)
    assert model._nodes(struck).tolist() == model._nodes(pulled).tolist() == [5]
    assert 0.5 < float(struck.largest_energy / pulled.largest_energy) <= 1
    truth, _ = SplittingSolver(resonator, 16_000).advance(ModalState(0 * amplitudes, speeds * 16_000), 1_600)
    found = model.amplitudes(struck, 1_600) * 1e-3
    assert float((found - truth).square().sum() / truth.square().sum()) < 1e-4


def test_the_compiled_loop_of_a_ringing_string_is_the_definition() -> None:
    model = made(NYLON, 25, "series")
    state = ringing(NYLON, 25, Pluck(0.3, 1.0, "triangular"), 0.4, 100)
    displacement, velocity = (to_grid(each, 101) / 1e-3 for each in state)
    plain, _ = model.advance(model.encode(displacement, velocity), 300)
    with torch.no_grad():
        compiled, _ = model.advance(model.encode(displacement, velocity), 300)
    torch.testing.assert_close(compiled, plain.detach(), rtol=0, atol=1e-6)


@pytest.fixture
def double_by_default() -> Iterator[None]:
    torch.set_default_dtype(torch.float64)
    yield
    torch.set_default_dtype(torch.float32)


def test_the_precision_is_the_models_own(double_by_default: None) -> None:
    """Not that of tensors that are made without one, which a program may set for itself."""
    displacement, model = pluck_m(NYLON, 25, 0.4), made(NYLON, 25, "series")
    with torch.no_grad():
        double = model(displacement / 1e-3, 10)
        torch.set_default_dtype(torch.float32)
        single = model(displacement / 1e-3, 10)
    assert double.dtype == single.dtype == model.shapes.dtype
    assert torch.equal(double, single)


def test_gradients_reach_every_curve() -> None:
    model = made(NYLON, 25, "series")
    motion, _ = model.advance(model.encode((pluck_m(NYLON, 25, 0.4) / 1e-3).float()), 50)
    motion.square().sum().backward()
    for curve in (model.A, model.r, model.p):
        assert curve.grad is not None
        assert bool((curve.grad != 0).all())


@pytest.mark.parametrize("seed", range(6))
def test_any_weights_stay_bounded_and_fall_silent(seed: int) -> None:
    model = made(NYLON, 25, "series", 4_000)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for curve in (model.A, model.r, model.p):
            curve.copy_(10.0 ** torch.randint(-2, 30, (), generator=generator) * torch.randn(4, generator=generator))
    displacement = (pluck_m(NYLON, 25, 0.5) / 1e-3).float()
    with torch.inference_mode():
        state = model.encode(displacement)
        frames, state = model.advance(state, 40_000)
        assert bool(torch.isfinite(frames).all())
        assert float(frames.abs().max()) < 20 * float(displacement.abs().max())
        for _ in range(20):
            frames, state = model.advance(state, 40_000)
    assert float(frames.abs().max()) < 1e-6 * float(displacement.abs().max())


def test_phases_are_kept_where_the_curves_were_learned() -> None:
    learned = made(NYLON, 57, "series")
    for rate_hz in (48_000, 16_000, 4_000, 44_100):
        model = learned.for_resonator(Physics(resonator_of(NYLON, 57), rate_hz, 1e-3))
        with torch.no_grad():
            _, state = model.advance(model.encode(torch.zeros(1, 101)), 1)
        assert state.nodes is not None
        phases = 1 / int(state.nodes[0]) * model.theta_log.exp()
        assert float(phases[0]) <= model.configuration.node_phase + 1e-12
        assert float(phases[-1]) <= model.configuration.highest_phase + 1e-12


def test_the_series_are_twelfths() -> None:
    with torch.no_grad():
        _, r, p = made(NYLON, 25, "series")._curves(torch.linspace(0, 1.5, 5, dtype=torch.float64))
    assert math.isclose(float(r.max()), SERIES)
    assert math.isclose(float(p.min()), SERIES)


def test_latents_to_spare_rest() -> None:
    displacement = (pluck_m(NYLON, 10, 0.3) / 1e-3).float()
    model = build_model("koopman_tension", {"modes": 25})
    model.initialise("series", Physics(resonator_of(NYLON, 10), 48_000, 1e-3), torch.Generator())
    with torch.inference_mode():
        torch.testing.assert_close(model(displacement, 100), made(NYLON, 10, "series")(displacement, 100))


def test_fewer_modes_than_the_resonator_has_are_refused() -> None:
    model = build_model("koopman_tension", {"modes": 10})
    with pytest.raises(ValueError, match=r"model_configuration\.modes is 10"):
        model.initialise("series", Physics(resonator_of(NYLON, 25), 48_000), torch.Generator())
