"""The fast solver against the oracle, the exact linear solution and its own laws."""

import numpy as np
import pytest
import torch

from engine.resonators.sine_transform import to_modes
from engine.resonators.string import resonator_of, undamped_frequencies, wavenumbers
from engine.truth import ModalState, SplittingSolver, solve_dop853
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


def test_order_of_convergence() -> None:
    """Order 4 in the perturbation at least: halving the step divides the error by 16 or more."""
    state, resonator = worst_of_protocol("noise", 25), resonator_of(STRING, 25)
    coarse, fine, truth = (SplittingSolver(resonator, 16_000, substeps=n).solve(state, 100) for n in (12, 24, 96))
    assert relative_l2(coarse, truth) / relative_l2(fine, truth) > 14


def test_the_linear_string_is_exact() -> None:
    state = random_state(3, 25)
    found = SplittingSolver(resonator_of(STRING, 25, tension_modulated=False), 16_000).solve(state, 2000)
    times_s = torch.arange(2001, dtype=torch.float64) / 16_000
    assert relative_l2(found, solve_linear(resonator_of(STRING, state.modes), state, times_s)) < 1e-11


@pytest.mark.parametrize(
    ("string", "low", "high"),
    [(StringParameters(damping_d1_kg_m_s=0, damping_d3_kg_m_s=0), 1 - 1e-7, 1 + 1e-7), (STRING, 0.0, 0.9)],
)
def test_without_damping_the_energy_stays_and_with_it_it_falls(
    string: StringParameters, low: float, high: float
) -> None:
    def energy(state: ModalState) -> float:
        q, v = state.amplitude.numpy(), state.velocity.numpy()
        stretch = float(np.square(wavenumbers(string, 10) * q).sum())
        tension = string.youngs_modulus_pa * string.area_m2 / (16 * string.mass_per_length_kg_m) * stretch**2
        return float((v**2 + (undamped_frequencies(string, 10) * q) ** 2).sum() / 2 + tension)

    amplitudes = to_modes(draw_noise(1, 101, torch.Generator().manual_seed(1)), 10)
    state = ModalState.at_rest(torch.from_numpy(amplitudes))
    _, later = SplittingSolver(resonator_of(string, 10), 16_000).advance(state, 4000)
    assert low < energy(later) / energy(state) < high


@pytest.mark.parametrize(("initial", "rate_hz", "modes"), PROTOCOL)
def test_the_worst_of_the_protocol_is_the_oracles_and_modes_that_died_away_are_left_out(
    initial: str, rate_hz: int, modes: int
) -> None:
    """1e-7 over 4000 samples was measured once, with the same strings; a shorter stretch keeps the suite quick."""
    state, resonator = worst_of_protocol(initial, modes), resonator_of(STRING, modes)
    truth = solve_dop853(resonator, state, rate_hz, 200)
    assert relative_l2(SplittingSolver(resonator, rate_hz).solve(state, 200), truth) < 1e-7
    full, ended = SplittingSolver(resonator, rate_hz).advance(state, 2 * rate_hz)
    solver = SplittingSolver(resonator, rate_hz, silence=1e-9)
    found, rests = solver.advance(state, 2 * rate_hz)
    assert relative_l2(found, full) < 1e-7
    moving = rests.amplitude != 0
    assert 0 < moving.sum() < modes
    assert (ended.amplitude[~moving].abs() < 1e-8 * ended.amplitude.norm()).all()
    assert (rests.velocity[~moving] == 0).all()
    assert torch.equal(in_blocks(solver, state, (1, 7, 992, 2 * rate_hz - 1000)), found)
    broken = ModalState.at_rest(torch.stack([torch.zeros(modes), torch.full((modes,), torch.nan)]).double())
    rest, nan = solver.advance(broken, 10)[0]
    assert (rest == 0).all() and nan.isnan().all()


def in_blocks(solver: SplittingSolver, state: ModalState, blocks: tuple[int, ...]) -> torch.Tensor:
    parts = []
    for steps in blocks:
        part, state = solver.advance(state, steps)
        parts.append(part)
    return torch.cat(parts, 1)


def test_blocks_some_frames_and_arrays_are_the_same_motion_and_a_state_stays_as_it_is() -> None:
    solver, state = SplittingSolver(resonator_of(STRING, 10), 16_000, substeps=2), random_state(3, 10)
    kept = state.amplitude.clone(), state.velocity.clone()
    whole, last = solver.advance(state, 257)
    assert torch.equal(in_blocks(solver, state, (1, 64, 65, 127)), whole)
    for frames in (torch.tensor([1, 2, 7, 31, 256]), torch.tensor([], dtype=torch.int64)):
        some, end = solver.sample(state, frames, 257)
        assert torch.equal(some, whole[:, frames - 1])
        assert torch.equal(end.velocity, last.velocity)
    arrays = ModalState(state.amplitude.numpy(), state.velocity.numpy())
    found, end = solver.advance(arrays, 257)
    assert isinstance(found, np.ndarray) and np.array_equal(found, whole.numpy())
    assert np.array_equal(end.velocity, last.velocity.numpy())
    assert np.array_equal(solver.solve(arrays, 257)[:, 1:], found)
    assert torch.equal(state.amplitude, kept[0]) and torch.equal(state.velocity, kept[1])
