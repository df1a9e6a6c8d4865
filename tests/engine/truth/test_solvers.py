"""The fast solver against the oracle, the exact linear solution and its own laws; plucks and blows of some time."""

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from engine.excitation import blow_factor, displacement
from engine.kernels.pulses import spectrum
from engine.pluck import SHAPES, Pluck
from engine.resonators.sine_transform import to_grid, to_modes
from engine.resonators.string import resonator_of, undamped_frequencies, wavenumbers
from engine.truth import ModalState, SplittingSolver, solve_dop853
from engine.values.string import StringParameters
from tests.engine.sounds import relative
from tests.engine.tensors import solve_linear
from training.data.draws import DRAWS, draw_noise

STRING = StringParameters()
PROTOCOL = [("gaussian", 4_000, 10), ("noise", 4_000, 10), ("gaussian", 16_000, 25), ("noise", 16_000, 25)]


def worst_of_protocol(initial: str, modes: int, seed: int = 0) -> ModalState:
    """The string with the largest tension rise among a thousand draws: the hardest to integrate."""
    amplitudes = to_modes(DRAWS[initial](1000, 101, torch.Generator().manual_seed(seed)), modes)
    worst = int(resonator_of(STRING, amplitudes.shape[1]).relative_tension_rise(amplitudes).argmax())
    return ModalState.at_rest(torch.from_numpy(amplitudes[worst : worst + 1]))


def random_state(batch: int, modes: int) -> ModalState:
    generator = torch.Generator().manual_seed(5)
    return ModalState(
        1e-3 * torch.randn(batch, modes, generator=generator, dtype=torch.float64),
        torch.randn(batch, modes, generator=generator, dtype=torch.float64),
    )


def test_order_of_convergence():
    """Order 4 in the perturbation at least: halving the step divides the error by 16 or more."""
    state, resonator = worst_of_protocol("noise", 25), resonator_of(STRING, 25)
    coarse, fine, truth = (SplittingSolver(resonator, 16_000, substeps=n).solve(state, 100) for n in (12, 24, 96))
    assert relative(coarse, truth) / relative(fine, truth) > 14


def test_the_linear_string_is_exact():
    state = random_state(3, 25)
    found = SplittingSolver(resonator_of(STRING, 25, tension_modulated=False), 16_000).solve(state, 2000)
    times_s = torch.arange(2001, dtype=torch.float64) / 16_000
    assert relative(found, solve_linear(resonator_of(STRING, state.modes), state, times_s)) < 1e-11


def test_without_damping_the_energy_stays():
    string = StringParameters(damping_d1_kg_m_s=0, damping_d3_kg_m_s=0)

    def energy(state: ModalState) -> float:
        q, v = state.amplitude.numpy(), state.velocity.numpy()
        stretch = float(np.square(wavenumbers(string, 10) * q).sum())
        tension = string.youngs_modulus_pa * string.area_m2 / (16 * string.mass_per_length_kg_m) * stretch**2
        return float((v**2 + (undamped_frequencies(string, 10) * q) ** 2).sum() / 2 + tension)

    amplitudes = to_modes(draw_noise(1, 101, torch.Generator().manual_seed(1)), 10)
    state = ModalState.at_rest(torch.from_numpy(amplitudes))
    _, later = SplittingSolver(resonator_of(string, 10), 16_000).advance(state, 4000)
    assert energy(later) == pytest.approx(energy(state), rel=1e-7)


@pytest.mark.parametrize(("initial", "rate_hz", "modes"), PROTOCOL)
def test_the_worst_of_the_protocol_is_the_oracles_and_modes_that_died_away_are_left_out(initial, rate_hz, modes):
    """1e-7 over 4000 samples was measured once, with the same strings; a shorter stretch keeps the suite quick."""
    state, resonator = worst_of_protocol(initial, modes), resonator_of(STRING, modes)
    truth = solve_dop853(resonator, state, rate_hz, 200)
    assert relative(SplittingSolver(resonator, rate_hz).solve(state, 200), truth) < 1e-7
    full, ended = SplittingSolver(resonator, rate_hz).advance(state, 2 * rate_hz)
    solver = SplittingSolver(resonator, rate_hz, silence=1e-9)
    found, rests = solver.advance(state, 2 * rate_hz)
    assert relative(found, full) < 1e-7
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


def test_blocks_some_frames_and_arrays_are_the_same_motion_and_a_state_stays_as_it_is(monkeypatch):
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
    monkeypatch.setattr("engine.truth.splitting._threads", lambda: 2)
    assert torch.equal(solver.advance(state, 257)[0], whole)
    assert torch.equal(state.amplitude, kept[0]) and torch.equal(state.velocity, kept[1])


@pytest.mark.parametrize("shape", SHAPES)
def test_a_pluck_peaks_where_and_as_far_as_asked(shape):
    displacement = Pluck(position=0.3, amplitude_mm=2.5, shape=shape, width=0.1).displacement(101)
    assert abs(int(displacement.argmax()) - 30) <= (2 if shape == "rounded" else 0)  # it is round where it is pulled
    assert float(displacement.max()) == pytest.approx(2.5e-3)
    assert (displacement[[0, -1]] == 0).all()


def test_a_rounded_triangle_is_the_triangle_under_a_spread_force():
    """The string's second derivative is the force: a raised cosine of that width, and none outside it."""
    points, position, width = 401, 0.3, 0.2
    shape = displacement("rounded", position, width, 2e-3, points)
    assert float(shape.max()) == pytest.approx(2e-3)
    force = -np.diff(shape, 2) * (points - 1) ** 2
    x = np.linspace(0, 1, points)[1:-1]
    wanted = np.where(np.abs(x - position) < width / 2, 1 + np.cos(2 * np.pi * (x - position) / width), 0.0)
    np.testing.assert_allclose(force / force.max(), wanted / 2, atol=2e-3, rtol=0)
    narrow, sharp = displacement("rounded", 0.3, 1e-6, 2e-3, 101), displacement("triangular", 0.3, 1.0, 2e-3, 101)
    np.testing.assert_allclose(narrow, sharp, atol=2e-5, rtol=0)  # except modes beyond the grid


@pytest.mark.parametrize("time_s", [0.5e-3, 2e-3, 6e-3])
@pytest.mark.parametrize("blow", [False, True])
def test_a_release_or_a_blow_in_a_time_is_a_smaller_one_at_its_middle(blow, time_s):
    """Against DOP853 of modes without losses under a force: amplitude and speed after it.

    The force that holds them falls as a raised cosine; that of a hammer is one, and brings speeds that are given.
    """
    omega = 2 * np.pi * np.array([110.0, 333.0, 1000.0, 2500.0])
    given = 1e-3 * omega if blow else omega**2

    def right_side(t: float, y: np.ndarray) -> np.ndarray:
        share = min(t / time_s, 1.0)
        held = 1 - share + np.sin(2 * np.pi * share) / (2 * np.pi)
        force = (1 - np.cos(2 * np.pi * share)) / time_s if blow else held
        return np.concatenate([y[4:], given * force - omega**2 * y[:4]])

    start = np.concatenate([np.full(4, 0.0 if blow else 1.0), np.zeros(4)])
    most = {"rtol": 1e-11, "atol": 1e-15, "max_step": time_s / 50}
    found = solve_ivp(right_side, (0, time_s + 0.003), start, "DOP853", **most).y[:, -1]
    left, turned = spectrum(omega * time_s / (2 * np.pi)), omega * (time_s / 2 + 0.003)
    swing = 1e-3 * np.sin(turned) if blow else np.cos(turned)
    speed = omega * (1e-3 * np.cos(turned) if blow else -np.sin(turned))
    np.testing.assert_allclose(found[:4], left * swing, atol=1e-8)
    np.testing.assert_allclose(found[4:], left * speed, atol=1e-4)


def test_a_blow_sends_out_a_wave_as_high_as_the_pluck_is():
    """On a flexible string, before it has come to an end."""
    points = 801
    shape_m = displacement("raised_cosine", 0.4, 0.06, 1e-3, points)
    omega = 2 * np.pi * 100.0 * np.arange(1, points - 1)
    swings = to_modes(shape_m, points - 2) * blow_factor(omega, shape_m / 1e-3)
    wave_m = to_grid(swings * np.sin(omega * 1e-3), points)  # after a tenth of a period it has run 0.2 to both sides
    x = np.linspace(0, 1, points)
    np.testing.assert_allclose(wave_m[(x > 0.26) & (x < 0.54)], 1e-3, rtol=5e-3)
    assert np.abs(wave_m[(x < 0.15) | (x > 0.65)]).max() < 1e-5
