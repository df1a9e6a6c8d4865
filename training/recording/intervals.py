"""Intervals of what is learned of each partial: frequency at rest, decay, level.

The covariance of a band's poles follows from its Jacobian and the residual in it, that of the glide from the border
of all bands. Draws from both give the spread of any figure of a partial. What a fit leaves is not white, and models
are never quite true: factors and floors widen the intervals. They were set, and are tested, on synthetic notes of the
project's own solver with body, noise and a second polarisation (`synthetic`, `coverage`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.recording.glide import TIMES_S
from training.recording.refine import Fit, real_rows

Array = NDArray[np.float64]

FACTORS = {"cents": 28.0, "decay": 13.0, "level_db": 18.0}  # of the standard error, for 95 %
FLOORS = {"cents": 4.2, "decay": 0.034, "level_db": 0.3}  # cents; a share; dB: of notes without noise
DRAWS = 400


@dataclass(frozen=True)
class Spread:
    """95 % intervals of a partial: Hz, σ in 1/s, dB of its level."""

    hz: tuple[float, float]
    decay: tuple[float, float]
    level_db: tuple[float, float]


def spreads(fit: Fit) -> dict[int, Spread]:
    """By the number of each partial that has poles."""
    residual = fit.data - fit.model()
    glide = fit.glide_covariance()
    random = np.random.default_rng(0)
    found = {}
    for number, where in enumerate(fit.bands):
        poles = [pole for pole in fit.poles[number] if pole.a]
        if not poles:
            continue
        linear, bent = fit.columns(poles, where)
        rows = real_rows(np.concatenate([linear, bent], 1))
        rest = real_rows(residual[where])
        scale = np.linalg.norm(rows, axis=0) + 1e-300
        square = (rows / scale).T @ (rows / scale)
        variance = float(rest @ rest) / max(1, len(rest) - rows.shape[1])
        covariance = variance * np.linalg.pinv(square, rcond=1e-10, hermitian=True) / np.outer(scale, scale)
        values = np.linalg.eigh(covariance)
        draws = random.standard_normal((DRAWS, len(covariance))) @ (values[1] * np.sqrt(np.maximum(values[0], 0))).T
        p = len(poles)
        a = np.array([pole.a for pole in poles]) + draws[:, 0 : 2 * p : 2] + 1j * draws[:, 1 : 2 * p : 2]
        decay = np.array([pole.decay for pole in poles]) * np.exp(np.clip(draws[:, 2 * p :: 2], -3, 3))
        omega = np.array([pole.s.imag for pole in poles]) + draws[:, 2 * p + 1 :: 2]
        hz, mean_decay, level = figures_of(a, decay, omega)
        centre = figures_of(
            *(
                np.array([values])
                for values in ([q.a for q in poles], [q.decay for q in poles], [q.s.imag for q in poles])
            )
        )
        seen = 2 * centre[1][0] / (2 * centre[1][0] + 1 / TIMES_S)  # the mean of each rise over the partial's energy
        hz_error = math.hypot(_spread(hz), centre[0][0] * math.sqrt(float(seen @ glide @ seen)))
        cents = math.log(2) / 1200
        value, rate, loud = (float(each[0]) for each in centre)
        octaves = _interval(math.log(value), hz_error / value / cents, "cents", cents)
        decays = _interval(math.log(rate), _spread(np.log(mean_decay)), "decay")
        found[number + 1] = Spread(
            (math.exp(octaves[0]), math.exp(octaves[1])),
            (math.exp(decays[0]), math.exp(decays[1])),
            _interval(loud, _spread(level), "level_db"),
        )
    return found


def figures_of(a: NDArray[np.complex128], decay: Array, omega: Array) -> tuple[Array, Array, Array]:
    """Of draws (draws, poles): mean frequency over the energy, σ of the same centre of energy, level in dB."""
    s = -decay + 1j * omega
    sums = s[:, :, None] + s[:, None].conj()
    pairs = a[:, :, None] * a[:, None].conj()
    energy = (-pairs / sums).sum((1, 2)).real
    moment = (pairs / sums**2).sum((1, 2)).real
    hz = (-pairs * s[:, :, None] / sums).sum((1, 2)).imag / np.maximum(energy, 1e-300) / (2 * math.pi)
    mean = 0.5 * np.maximum(energy, 1e-300) / np.maximum(moment, 1e-300)
    return hz, np.clip(mean, 1e-3, 1e4), 10 * np.log10(np.maximum(energy, 1e-300))


def _spread(values: Array) -> float:
    """A standard deviation that bears outliers."""
    low, high = np.percentile(values, (15.87, 84.13))
    return float(high - low) / 2


def _interval(value: float, error: float, kind: str, unit: float = 1.0) -> tuple[float, float]:
    """`error` and the floor in units of `unit`, which is of the value's."""
    reach = unit * math.hypot(FACTORS[kind] * error, FLOORS[kind])
    return value - reach, value + reach
