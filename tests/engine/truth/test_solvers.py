"""The fast solver against the oracle, the exact linear solution and its own laws."""

import math

import numpy as np
import pytest
import torch

from engine.kernels.scheme import KICKS, ROTATIONS
from engine.resonators.sine_transform import to_modes
from engine.resonators.string import resonator_of, undamped_frequencies, wavenumbers
from engine.truth import ModalState, SplittingSolver, default_substeps, solve_dop853
from engine.values.string import StringParameters
from tests.engine.tensors import solve_linear
from training.data.draws import DRAWS, draw_noise

STRING = StringParameters()
PROTOCOL = [("gaussian", 4_000, 10), ("noise", 4_000, 10), ("gaussian", 16_000, 25), ("noise", 16_000, 25)]


def worst_of_protocol(initial: str, modes: int, seed: int = 0) -> ModalState:
    """The string with the largest tension rise among a thousand draws: the hardest to integrate."""
    amplitudes = to_modes(DRAWS[initial](1000, 101, torch.Generator().manual_seed(seed)), modes)
    worst = int(resonator_of(STRING, amplitudes.shape[1]).relative_tension_rise(amplitudes).argmax())
    return ModalState.at_rest(torch.from_numpy(amplitudes[worst : worst + 1]))


def relative_l2(found: torch.Tensor, expected: torch.Tensor) -> float:
    return float((found - expected).norm() / expected.norm())


def random_state(batch: int, modes: int) -> ModalState:
    generator = torch.Generator().manual_seed(5)
    return ModalState(
        1e-3 * torch.randn(batch, modes, generator=generator, dtype=torch.float64),
        torch.randn(batch, modes, generator=generator, dtype=torch.float64),
    )


@pytest.mark.parametrize(("initial", "rate_hz", "modes"), PROTOCOL)
def test_default_accuracy_on_the_worst_of_the_protocol(initial: str, rate_hz: int, modes: int) -> None:
    """1e-7 over 4000 samples was measured once, with the same strings; a shorter stretch keeps the suite quick."""
    state = worst_of_protocol(initial, modes)
    truth = solve_dop853(resonator_of(STRING, state.modes), state, rate_hz, 600)
    found = SplittingSolver(resonator_of(STRING, modes), rate_hz).solve(state, 600)
    assert relative_l2(found, truth) < 1e-7


@pytest.mark.parametrize(("initial", "rate_hz", "modes"), PROTOCOL)
def test_modes_that_have_died_away_may_be_left_out(initial: str, rate_hz: int, modes: int) -> None:
    state = worst_of_protocol(initial, modes)
    full, ended = SplittingSolver(resonator_of(STRING, modes), rate_hz).advance(state, 2 * rate_hz)
    solver = SplittingSolver(resonator_of(STRING, modes), rate_hz, silence=1e-9)
    found, rests = solver.advance(state, 2 * rate_hz)
    assert relative_l2(found, full) < 1e-7
    moving = rests.amplitude != 0
    assert 0 < moving.sum() < modes
    assert (ended.amplitude[~moving].abs() < 1e-8 * ended.amplitude.norm()).all()
    assert (rests.velocity[~moving] == 0).all()


def test_what_is_left_out_does_not_depend_on_the_blocks() -> None:
    solver = SplittingSolver(resonator_of(STRING, 25), 16_000, silence=1e-9)
    state = worst_of_protocol("gaussian", 25)
    whole, _ = solver.advance(state, 4000)
    blocks = []
    for steps in (1, 7, 992, 3000):
        block, state = solver.advance(state, steps)
        blocks.append(block)
    torch.testing.assert_close(torch.cat(blocks, dim=1), whole, rtol=0, atol=0)


def test_a_string_at_rest_or_beyond_numbers_stays_so() -> None:
    solver = SplittingSolver(resonator_of(STRING, 5), 16_000, silence=1e-9)
    state = ModalState.at_rest(torch.stack([torch.zeros(5), torch.full((5,), torch.nan)]).double())
    rest, nan = solver.advance(state, 10)[0]
    assert (rest == 0).all()
    assert nan.isnan().all()


def test_order_of_convergence() -> None:
    """Order 4 in the perturbation at least: halving the step divides the error by 16 or more."""
    state = worst_of_protocol("noise", 25)
    truth = SplittingSolver(resonator_of(STRING, 25), 16_000, substeps=96).solve(state, 100)
    errors = [
        relative_l2(SplittingSolver(resonator_of(STRING, 25), 16_000, substeps=n).solve(state, 100), truth)
        for n in (12, 24)
    ]
    assert errors[0] / errors[1] > 14


def test_the_scheme_is_consistent_and_symmetric() -> None:
    assert math.fsum(ROTATIONS) == pytest.approx(1, abs=1e-15)
    assert math.fsum(KICKS) == pytest.approx(1, abs=1e-15)
    assert ROTATIONS[::-1] == ROTATIONS
    assert KICKS[::-1] == KICKS


def test_the_linear_string_is_exact() -> None:
    state = random_state(3, 25)
    found = SplittingSolver(resonator_of(STRING, 25, tension_modulated=False), 16_000).solve(state, 2000)
    times_s = torch.arange(2001, dtype=torch.float64) / 16_000
    assert relative_l2(found, solve_linear(resonator_of(STRING, state.modes), state, times_s)) < 1e-11


def test_the_linear_solution_agrees_with_the_oracle() -> None:
    state = random_state(1, 10)
    truth = solve_dop853(resonator_of(STRING, state.modes, tension_modulated=False), state, 4_000, 200)
    found = solve_linear(resonator_of(STRING, state.modes), state, torch.arange(201, dtype=torch.float64) / 4_000)
    assert relative_l2(found, truth) < 1e-9


def test_a_small_nonlinear_string_is_a_linear_one() -> None:
    state = ModalState.at_rest(torch.tensor([[1e-8, 0, 1e-8]]))
    linear, modulated = (
        SplittingSolver(resonator_of(STRING, 3, tension_modulated=on), 16_000).solve(state, 500)
        for on in (False, True)
    )
    assert relative_l2(modulated, linear) < 1e-6


@pytest.mark.parametrize("tension_modulated", [False, True])
def test_the_kernel_is_the_scheme(tension_modulated: bool) -> None:
    solver = SplittingSolver(resonator_of(STRING, 25, tension_modulated=tension_modulated), 16_000, substeps=2)
    state = random_state(4, 25)
    compiled, last = solver.advance(state, 20)
    q, v = state.amplitude.clone(), state.velocity.clone()
    flows, kicks, coupling, eta_squared = map(torch.from_numpy, solver.constants[:4])
    for step in range(20):
        for _ in range(solver.substeps):
            for stage, (qq, qv, vq, vv) in enumerate(flows[-1]):
                if stage:
                    v = v - kicks[-1, stage - 1] * (eta_squared * q * q).sum(-1, keepdim=True) * coupling * q
                q, v = qq * q + qv * v, vq * q + vv * v
        torch.testing.assert_close(q, compiled[:, step], rtol=1e-11, atol=1e-17)
    torch.testing.assert_close(v, last.velocity, rtol=1e-10, atol=1e-12)


def test_some_frames_are_those_of_all() -> None:
    solver, state = SplittingSolver(resonator_of(STRING, 10), 16_000, substeps=2), random_state(3, 10)
    every, last = solver.advance(state, 50)
    frames = torch.tensor([1, 2, 7, 31, 49])
    some, end = solver.sample(state, frames, 50)
    assert torch.equal(some, every[:, frames - 1])
    assert torch.equal(end.amplitude, last.amplitude)
    none, end = solver.sample(state, frames[:0], 50)
    assert none.shape == (3, 0, 10)
    assert torch.equal(end.velocity, last.velocity)


def test_arrays_move_as_tensors_do() -> None:
    solver, state = SplittingSolver(resonator_of(STRING, 10), 16_000), random_state(3, 10)
    expected, ended = solver.advance(state, 200)
    arrays = ModalState(state.amplitude.numpy(), state.velocity.numpy())
    found, end = solver.advance(arrays, 200)
    assert isinstance(found, np.ndarray) and isinstance(expected, torch.Tensor)
    assert np.array_equal(found, expected.numpy())
    assert np.array_equal(end.velocity, ended.velocity.numpy())
    assert np.array_equal(solver.solve(arrays, 200)[:, 1:], found)
    still = ModalState.at_rest(arrays.amplitude)
    oracle = solve_dop853(resonator_of(STRING, 10), still, 16_000, 20)
    np.testing.assert_allclose(solver.solve(still, 20), oracle, rtol=0, atol=1e-7 * np.abs(oracle).max())


def test_going_on_from_a_state_is_the_same_motion() -> None:
    solver = SplittingSolver(resonator_of(STRING, 25), 16_000, substeps=3)
    state = random_state(3, 25)
    before = state.amplitude.clone()
    whole, _ = solver.advance(state, 257)
    parts = []
    for steps in (1, 64, 65, 127):
        part, state = solver.advance(state, steps)
        parts.append(part)
    assert torch.equal(torch.cat(parts, 1), whole)
    assert not torch.equal(before, state.amplitude)


def test_the_callers_state_is_not_touched() -> None:
    state = random_state(2, 5)
    kept = (state.amplitude.clone(), state.velocity.clone())
    SplittingSolver(resonator_of(STRING, 5), 8_000).advance(state, 10)
    assert torch.equal(state.amplitude, kept[0])
    assert torch.equal(state.velocity, kept[1])


def test_energy_decays_as_the_damping_says() -> None:
    """Without damping the energy of the tension-modulated string stays; with it, it falls."""
    free = StringParameters(damping_d1_kg_m_s=0, damping_d3_kg_m_s=0)
    amplitudes = to_modes(draw_noise(1, 101, torch.Generator().manual_seed(1)), 10)

    def energy(string: StringParameters, state: ModalState) -> float:
        q, v = state.amplitude, state.velocity
        stretch = (torch.from_numpy(wavenumbers(string, 10)) * q).square().sum(-1)
        linear = (v.square() + (torch.from_numpy(undamped_frequencies(string, 10)) * q).square()).sum(-1) / 2
        tension = string.youngs_modulus_pa * string.area_m2 / (16 * string.mass_per_length_kg_m) * stretch**2
        return float(linear + tension)

    for string, low, high in ((free, 1 - 1e-7, 1 + 1e-7), (STRING, 0.0, 0.9)):
        state = ModalState.at_rest(torch.from_numpy(amplitudes))
        before = energy(string, state)
        _, state = SplittingSolver(resonator_of(string, 10), 16_000).advance(state, 4000)
        assert low < energy(string, state) / before < high


def test_default_substeps_follow_the_highest_mode() -> None:
    assert default_substeps(resonator_of(STRING, 25), 16_000) == 4 * default_substeps(
        resonator_of(STRING, 25), 64_000
    )
    assert default_substeps(resonator_of(STRING, 50), 16_000) > default_substeps(resonator_of(STRING, 25), 16_000)


def test_bad_requests_are_named() -> None:
    with pytest.raises(ValueError, match="sample rate must be above 0"):
        SplittingSolver(resonator_of(STRING, 5), 0)
    with pytest.raises(ValueError, match="silence"):
        SplittingSolver(resonator_of(STRING, 5), 16_000, silence=1.0)
    with pytest.raises(ValueError, match="substeps must lie in 1 … 1024"):
        SplittingSolver(resonator_of(STRING, 5), 4_000, substeps=0)
    solver = SplittingSolver(resonator_of(STRING, 5), 4_000)
    with pytest.raises(ValueError, match="holds 5 modes, the state 4"):
        solver.advance(random_state(1, 4), 3)
    with pytest.raises(ValueError, match="one shape"):
        ModalState(torch.zeros(1, 3), torch.zeros(1, 4))
