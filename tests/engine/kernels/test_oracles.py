"""Kernels: compiled they are what they are in plain Python, and both are what an independent way computes."""

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core.dispatcher import Dispatcher
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.signal import freqz

from engine.kernels import compiled, fourier, javari, loudness, pulses, responses, strings, velocities
from engine.kernels import constants as of
from engine.kernels.records import SYMPATHY
from engine.kernels.rotation import rotation
from engine.kernels.sympathy import ring
from engine.resonators.losses import loss_rates
from engine.resonators.string import resonator_of
from engine.values.string import Losses, StringParameters
from tests.engine.sounds import RATE_HZ, Signal

STEEL = StringParameters(0.65, 5e-7, 2e-14, 7850.0, 2e11, 4e-4, 4e-7, 75.0)
FLEXIBLE = StringParameters(second_moment_m4=0.0, damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0)
GIVE = 3e-7  # m/N
DRAW = np.random.default_rng(1)
SIZES = (2, 4, 8, 16, 128, 1024, 2048)
TURNS = 2 * np.pi * np.arange(2048) / 2048


def pulse(turns: float) -> float:
    """∫ (1 - cos 2πx) cos 2π turns (x - ½) dx, by its middles."""
    x = (np.arange(200_000) + 0.5) / 200_000
    return float(((1 - np.cos(2 * np.pi * x)) * np.cos(2 * np.pi * turns * (x - 0.5))).mean())


def flow(sigma: float, omega: float, time_s: float) -> Signal:
    return expm(time_s * np.array([[0, 1], [-(omega**2) - sigma**2, -2 * sigma]])).ravel()


def rows(kernel: Any) -> Signal:
    found = np.empty(4 * 60)
    kernel(np.array(STEEL.row), 60, 0, 1.0, (0.0, 0.0), (0.0, 0.0, 0.0), found)
    return found


def modes_of_the_equation() -> Signal:
    eta, mass = np.arange(1, 61) * np.pi / STEEL.length_m, STEEL.density_kg_m3 * STEEL.area_m2
    bending, stiffness = STEEL.youngs_modulus_pa * STEEL.second_moment_m4, STEEL.youngs_modulus_pa * STEEL.area_m2
    squares = (bending * eta**4 + STEEL.tension_n * eta**2) / mass
    sigma = (STEEL.damping_d1_kg_m_s + STEEL.damping_d3_kg_m_s * eta**2) / (2 * mass)
    return np.concatenate([squares, sigma, stiffness * eta**2 / (4 * mass), eta**2])


def polarised_rows(kernel: Any) -> Signal:
    """Two partials of two modes and one of one, with a bridge that moves and losses by mode."""
    found = np.empty(4 * 5)
    kernel(np.array(STEEL.row), 5, 2, 1.01, (0.01, 0.002), (1.2, 1e-4, 0.02), found)
    return found


def polarised_modes() -> Signal:
    squares, sigma, coupling, stretch = modes_of_the_equation().reshape(4, -1)[:, [0, 0, 1, 1, 2]]
    losses = loss_rates(Losses(1.2, 1e-4, 0.02), STEEL, 3)[[0, 0, 1, 1, 2]]
    lost = STEEL.tension_n / STEEL.length_m * np.array([0.01, 0.002, 0.01, 0.002, 0.01])
    return np.concatenate([squares * [1, 1.01, 1, 1.01, 1], sigma + losses + lost, coupling, stretch])


SEPARATIONS = [(before, free) for before, free in DRAW.normal(0, 1e-5, (200, 2)).tolist()]
EDGES = [
    (*pair, GIVE, stiffness, loss) for pair in SEPARATIONS for stiffness in (1e3, 1e8) for loss in (0.0, 2e4, 1e6)
]


def edge_force(before: float, free: float, give: float, stiffness: float, loss: float) -> float:
    """The root of F · moved = (V(d₁) - V(d₀)) (1 + loss · moved): a discrete gradient, with loss once it touches."""
    if before <= 0 and free <= 0:
        return 0.0

    def left(force: float) -> float:
        after = free - give * force
        moved = after - before
        mean = (
            0.5 * stiffness * (max(after, 0.0) ** 2 - max(before, 0.0) ** 2) / moved if moved else stiffness * before
        )
        return force - mean * (1 + loss * moved if before > 0 else 1.0)

    largest = 1.0
    while left(largest) < 0 or left(-largest) > 0:
        largest *= 2
    return float(brentq(left, -largest, largest, xtol=1e-16, rtol=1e-15))


RATIOS = (DRAW.uniform(8_000, 384_000, 200).round() / DRAW.uniform(8_000, 384_000, 200).round()).tolist()


def nearest(ratio: float) -> tuple[int, int]:
    return Fraction(ratio).limit_denominator(responses.FINEST_RATIO).as_integer_ratio()


def k_weighting(hz: Signal) -> Signal:
    """By the filters for 48 kHz of ITU-R BS.1770, tables 1 and 2."""
    shelf = [1.53512485958697, -2.69169618940638, 1.19839281085285], [1.0, -1.69065929318241, 0.73248077421585]
    high_pass = [1.0, -2.0, 1.0], [1.0, -1.99004745483398, 0.99007225036621]
    return np.prod([np.abs(freqz(*each, worN=hz, fs=48_000)[1]) ** 2 for each in (shelf, high_pass)], axis=0)


def transformed(kernel: Any) -> Signal:
    """Of a signal forwards, and with its parts exchanged backwards: itself."""
    found = []
    for size in SIZES:
        re, im = np.random.default_rng(size).standard_normal((2, size))
        room = np.empty((2, size))
        kernel(re, im, *room, np.cos(TURNS), np.sin(TURNS))
        found += [re.copy(), im.copy()]
        kernel(im, re, room[1], room[0], np.cos(TURNS), np.sin(TURNS))
        found += [re / size, im / size]
    return np.concatenate(found)


def by_numpy(re: Signal, im: Signal, *_: Signal) -> None:
    spectrum = np.fft.fft(re + 1j * im)
    re[:], im[:] = spectrum.real, spectrum.imag


VELOCITIES = [(each, curve) for each in range(1, 128, 3) for curve in (-0.7, 0.0, 0.4)]
VALUES = [
    *((0.2, 8.0, velocities.between(0.2, 8.0, velocities.share(*each)), each[1]) for each in VELOCITIES),
    *((0.2, 8.0, value, 0.4) for value in (0.0, 0.1, 9.0)),
    (3.0, 3.0, 3.0, 0.0),
]
WANTED = [*(each for each, _ in VELOCITIES), 1, 1, 127, 1]
SINGLE = np.linspace(-12, 12, 501).astype(np.float32)
PULSES = (0.0, 0.3, 0.5, 1.0, 1 + 1e-7, 7.5)
FLOWS = [(3.0, 900.0, 0.01), (0.0, 2e4, 1e-3), (900.0, 30.0, 0.002)]
CONTACTS = [(4.0, 1.0, 0.0), (4.0, 1.0, 0.5), (4.0, 1.0, 1.0), (0.0, 1.0, 0.5), (4.0, 0.0, 0.5)]
HEARD_HZ = np.array([20.0, 100.0, 997.0, 3_000.0, 10_000.0])

# by name: the kernel, its arguments row by row or a use of it that returns numbers, these by another way, rtol, atol
KERNELS: dict[str, tuple[Any, Any, Callable[[], ArrayLike], float, float]] = {
    "tanh in single precision": (compiled.tanh, list(zip(SINGLE)), lambda: np.tanh(SINGLE.astype(float)), 0, 2e-7),
    "the spectrum of a pulse": (pulses.spectrum, list(zip(PULSES)), lambda: list(map(pulse, PULSES)), 2e-7, 1e-9),
    "the flow of a mode": (rotation, FLOWS, lambda: [flow(*each) for each in FLOWS], 1e-9, 1e-15),
    "the modes of a string": (strings.rows, rows, modes_of_the_equation, 1e-13, 1e-15),
    "both directions of its modes": (strings.rows, polarised_rows, polarised_modes, 1e-13, 1e-15),
    "the time of a contact": (velocities.contact_s, CONTACTS, lambda: [0.004, 0.002, 0.001, 0.0, 0.0], 1e-12, 1e-15),
    "a velocity from its value": (velocities.velocity, VALUES, lambda: WANTED, 1e-12, 1e-15),
    "the force of a bridge's edge": (javari.force, EDGES, lambda: [edge_force(*each) for each in EDGES], 1e-5, 1e-9),
    "a ratio of rates": (responses.fraction, list(zip(RATIOS)), lambda: list(map(nearest, RATIOS)), 1e-12, 1e-15),
    "K-weighting": (loudness.k_weight, [(HEARD_HZ,)], lambda: [k_weighting(HEARD_HZ)], 0.02, 1e-15),
    "a Fourier transform": (fourier.transform, transformed, lambda: transformed(by_numpy), 0, 1e-10),
}


@pytest.mark.parametrize("name", KERNELS)
def test_compiled_it_is_plain_python_and_the_oracle(name):
    function, use, oracle, rtol, atol = KERNELS[name]
    if isinstance(function, Dispatcher):
        fast, plain = function, function.py_func
    else:
        fast, plain = njit(error_model="numpy")(function), function
    found, slow = (
        np.asarray(use(each) if callable(use) else [each(*row) for row in use], float) for each in (fast, plain)
    )
    np.testing.assert_allclose(slow, found, rtol=1e-12, atol=atol)
    np.testing.assert_allclose(found, np.asarray(oracle(), float), rtol=rtol, atol=atol)


def test_a_string_that_is_stopped_has_its_pitch():
    """It is slackened by a fifth and stopped at 300 Hz, and has its modes below 20 kHz."""
    out = np.zeros(8)
    assert strings.stop(np.array(STEEL.row), np.ones(8), 0.9, 300.0, np.empty(8), out)
    stopped = StringParameters(*out.tolist())
    assert stopped.pitch_hz == pytest.approx(300.0, rel=1e-9)
    assert stopped.tension_n / STEEL.tension_n < 0.9 and stopped.length_m < STEEL.length_m


def touched(node: int, modes: int, pairs: int = 0) -> Signal:
    """σ in 1/s that a touch adds to modes (modes,)."""
    found, string = np.zeros(4 * modes), np.array(FLEXIBLE.row)
    strings.rows(string, modes, pairs, 1.0, (0.0, 0.0), (0.0, 0.0, 0.0), found)
    strings.touch(string, modes, pairs, node, found)
    return found[modes : 2 * modes]


@pytest.mark.parametrize("node", [2, 3, 5])
def test_a_touch_adds_the_rates_of_the_modes_that_it_couples(node):
    """q'' + 2R/(ρAℓ) φ φᵀ q' + ω² q = 0, with φ the modes at the finger: all its eigenvalues, of the lowest modes."""
    modes, mass = 80, FLEXIBLE.mass_per_length_kg_m
    omega = np.array([FLEXIBLE.undamped_frequency(mode) for mode in range(1, modes + 1)])
    at_finger = np.sin(np.arange(1, modes + 1) * np.pi / node)
    resistance = strings.TOUCH_RESISTANCE * np.sqrt(FLEXIBLE.tension_n * mass)
    coupling = 2 * resistance / (mass * FLEXIBLE.length_m) * np.outer(at_finger, at_finger)
    zero, one = np.zeros((modes, modes)), np.eye(modes)
    found = np.linalg.eigvals(np.block([[zero, one], [-np.diag(omega**2), -coupling]]))
    found = found[found.imag > omega[0] / 2]
    exact, rates = -found[np.argsort(found.imag)].real[: 2 * node], touched(node, 2 * node)
    ringing = np.arange(1, 2 * node + 1) % node == 0
    np.testing.assert_allclose([exact[ringing], rates[ringing]], 0.0, atol=1e-6 * omega[0])
    np.testing.assert_allclose(rates[~ringing], exact[~ringing], rtol=0.2)  # exact to first order
    for direction in (0, 1):  # both polarisations of a partial alike
        np.testing.assert_allclose(touched(3, 8, 4)[direction::2], touched(3, 4))


@pytest.mark.parametrize("string", [StringParameters(), STEEL, replace(STEEL, youngs_modulus_pa=0.0)])
def test_a_resonator_and_a_string_are_those_of_the_kernels(string):
    resonator, found = resonator_of(string, 60), np.empty(4 * 60)
    strings.rows(string.row, 60, 0, 1.0, (0.0, 0.0), (0.0, 0.0, 0.0), found)
    own = np.concatenate([resonator.omega**2, resonator.sigma, resonator.coupling, resonator.stretch])
    np.testing.assert_allclose(own, found, rtol=1e-13)
    eta = np.arange(1, 61) * np.pi / string.length_m
    bending = string.youngs_modulus_pa * string.second_moment_m4
    np.testing.assert_allclose(resonator.end_force, string.tension_n * eta + bending * eta**3, rtol=1e-13)
    pitch_hz = np.sqrt(found[0] - found[60] ** 2) / (2 * math.pi)
    assert string.pitch_hz == pytest.approx(pitch_hz, rel=1e-13)


@pytest.mark.parametrize(("place", "value"), [(of.LENGTH, 1e-3), (of.TENSION, 0.0), (of.D1, -1.0), (of.AREA, np.nan)])
def test_what_parameters_refuse_is_impossible_and_what_does_not_swing_is_overdamped(place, value):
    changed = np.array(STEEL.row)
    changed[[of.MOMENT, of.MODULUS, of.D1, of.D3]] = 0.0
    assert strings.possible(changed)
    changed[place] = value
    assert not strings.possible(changed)
    with pytest.raises(ValueError):
        StringParameters(*changed.tolist())
    assert not strings.overdamped(STEEL.row, 60)
    assert strings.overdamped(replace(STEEL, damping_d1_kg_m_s=100.0).row, 60)
    assert strings.overdamped(replace(STEEL, damping_d3_kg_m_s=0.05).row, 60)


def rung(force: Signal, omega: Signal, sigma: Signal, lost: Signal, played: bool = False) -> Signal:
    """The sound of strings that ring with others, by a force at the bridge."""
    bank, out = np.zeros(1, SYMPATHY)[0], np.zeros(len(force))
    turned = np.exp((1j * omega - sigma) / RATE_HZ)
    bank["partials"] = count = len(omega)
    bank["cosine"][:count], bank["sine"][:count] = turned.real, turned.imag
    bank["gain"][:count], bank["played"][:count] = -2 * lost / RATE_HZ, played
    ring(bank, force, out)
    return out


def test_a_partial_of_strings_that_ring_with_others_is_driven_as_by_dop853():
    """q̈ + 2σ q̇ + ω² q = -2 σ_b Ḟ: what the bridge's motion drives, of a note that decays a little beside it."""
    omega, sigma, lost = 2 * np.pi * 220.0, 2.0, 0.5
    driver, time_s = complex(-3.0, 2 * np.pi * 220.4), np.arange(24_000) / RATE_HZ

    def right_side(t: float, y: Signal) -> list[float]:
        change = (driver * np.exp(driver * t)).real
        return [y[1], -2 * sigma * y[1] - omega**2 * y[0] - 2 * lost * change]

    start = [0.0, -2 * lost]  # the force that is there at once
    wanted = solve_ivp(right_side, (0, time_s[-1]), start, "DOP853", time_s, rtol=1e-9, atol=1e-12).y[0]
    found = rung(np.exp(driver * time_s).real, *np.array([[omega], [sigma], [lost]]))
    assert np.square(found - wanted).sum() < 1e-3 * np.square(wanted).sum()


def test_nothing_rings_up_and_a_played_string_is_stopped():
    """Not where the input is as bad as it can be: a tone of full scale at the resonance of all, for a long time."""
    draw = np.random.default_rng(1)
    sigma = draw.uniform(0.5, 4, 40)
    strings_of = np.full(40, 2 * np.pi * 440.0), sigma, sigma * draw.uniform(0, 1, 40)
    force = np.cos(2 * np.pi * 440.0 * np.arange(5 * RATE_HZ) / RATE_HZ)
    assert np.abs(rung(force, *strings_of)).max() <= 1.001 * (strings_of[2] / sigma).sum()
    rest = rung(np.concatenate([force[:RATE_HZ], np.zeros(30 * RATE_HZ)]), *strings_of)
    assert np.abs(rest[-RATE_HZ:]).max() < 1e-6
    assert not rung(np.ones(480), *strings_of, played=True).any()
