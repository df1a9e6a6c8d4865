"""Strings that ring with others: their equation, and that nothing rings up."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from engine.kernels.records import SYMPATHY
from engine.kernels.sympathy import ring
from tests.engine.sounds import RATE_HZ


def partials(omega: np.ndarray, sigma: np.ndarray, lost: np.ndarray) -> tuple[np.ndarray, ...]:
    shrunk = np.exp(-sigma / RATE_HZ)
    return shrunk * np.cos(omega / RATE_HZ), shrunk * np.sin(omega / RATE_HZ), -2 * lost / RATE_HZ


def rung(force: np.ndarray, rows: tuple[np.ndarray, ...], played: np.ndarray | None = None) -> np.ndarray:
    bank, count, out = np.zeros(1, SYMPATHY)[0], len(rows[0]), np.zeros(len(force))
    bank["partials"] = count
    for name, row in zip(("cosine", "sine", "gain"), rows, strict=True):
        bank[name][:count] = row
    if played is not None:
        bank["played"][:count] = played
    ring(bank, force, out)
    return out


def test_a_partial_is_driven_as_by_dop853() -> None:
    """q̈ + 2σ q̇ + ω² q = -2 σ_b Ḟ: what the bridge's motion drives, of a note that decays a little beside it."""
    omega, sigma, lost = 2 * np.pi * 220.0, 2.0, 0.5
    driver = complex(-3.0, 2 * np.pi * 220.4)
    time_s = np.arange(24_000) / RATE_HZ

    def right_side(t: float, y: np.ndarray) -> list[float]:
        change = (driver * np.exp(driver * t)).real
        return [y[1], -2 * sigma * y[1] - omega**2 * y[0] - 2 * lost * change]

    start = [0.0, -2 * lost]  # the force that is there at once
    wanted = solve_ivp(right_side, (0, time_s[-1]), start, "DOP853", time_s, rtol=1e-9, atol=1e-12).y[0]
    rows = partials(*(np.array([each]) for each in (omega, sigma, lost)))
    found = rung(np.exp(driver * time_s).real, rows)
    assert np.square(found - wanted).sum() < 1e-3 * np.square(wanted).sum()


def test_nothing_rings_up() -> None:
    """Not where the input is as bad as it can be: a tone of full scale at the resonance of all, for a long time."""
    draw = np.random.default_rng(1)
    sigma = draw.uniform(0.5, 4, 40)
    omega, lost = np.full(40, 2 * np.pi * 440.0), sigma * draw.uniform(0, 1, 40)
    force = np.cos(omega[0] * np.arange(5 * RATE_HZ) / RATE_HZ)
    found = rung(force, partials(omega, sigma, lost))
    assert np.abs(found).max() <= 1.001 * (lost / sigma).sum()
    rest = rung(np.concatenate([force[:RATE_HZ], np.zeros(30 * RATE_HZ)]), partials(omega, sigma, lost))
    assert np.abs(rest[-RATE_HZ:]).max() < 1e-6


@pytest.mark.parametrize("count", [1, 7])
def test_a_played_string_is_stopped(count: int) -> None:
    rows = partials(np.full(count, 2000.0), np.full(count, 1.0), np.full(count, 0.5))
    assert not rung(np.ones(480), rows, np.ones(count)).any()
