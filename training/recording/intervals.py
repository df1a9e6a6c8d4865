"""Intervals of what is learned of each partial: frequency at rest, decay, level.

Three variances add up:

- that of the poles. What a fit leaves is neither white nor even over a band. It is counted where it lies, bin by
  bin with its neighbours (White 1980; MacKinnon, White 1985: HC3; Newey, West 1987), not as a mean over the band;
- that of the partial's unknown share of the tension (`rest`);
- that of the model, which is not quite true (Kennedy, O'Hagan 2001): the root mean square that it is off on
  synthetic notes of the project's own solver, with body, noise and a second polarisation.

`bench.recordings.coverage` measures the last one, and tests the intervals on other notes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from engine.resonators.base import Array
from training.recording.glide import CENTS
from training.recording.refine import Complex, Fit, Pole, moments, polarisations, real_rows
from training.recording.rest import Rest, at_rest

MODEL_ERRORS = {"cents": 0.6, "decay": 0.05, "level_db": 0.35}  # cents, a share, dB
NORMAL_95 = 1.96
NEIGHBOURS = 4  # bins over which a residual counts as correlated
MOST_LEVERAGE = 0.95  # of one bin
DRAWS = 400


@dataclass(frozen=True)
class Spread:
    """The 95 % intervals of a partial: Hz at rest, σ in 1/s, dB of its level.

    `rest_cents`: of Hz, above its poles'.
    """

    hz: tuple[float, float]
    decay: tuple[float, float]
    level_db: tuple[float, float]
    rest_cents: float


def spreads(fit: Fit) -> dict[int, Spread]:
    """The spreads by the number of each partial that has poles."""
    residual = fit.data - fit.model()
    random = np.random.default_rng(0)
    by_number = {
        number + 1: polarisations([pole for pole in poles if pole.a]) for number, poles in enumerate(fit.poles)
    }
    by_number = {number: poles for number, poles in by_number.items() if poles}
    rests = at_rest(fit.glide, by_number)
    return {
        number: _spread(fit, number - 1, poles, rests[number], residual, random)
        for number, poles in by_number.items()
    }


def _spread(
    fit: Fit, band: int, pair: list[Pole], rest: Rest, residual: Complex, random: np.random.Generator
) -> Spread:
    where = fit.bands[band]
    poles = [pole for pole in fit.poles[band] if pole.a]
    spread = covariance(np.concatenate(fit.columns(poles, where), 1), residual[where])
    values, vectors = np.linalg.eigh(spread)
    draws = random.standard_normal((DRAWS, len(values))) @ (vectors * np.sqrt(np.maximum(values, 0))).T
    p, chosen = len(poles), [poles.index(pole) for pole in pair]
    a = np.array([pole.a for pole in poles]) + draws[:, 0 : 2 * p : 2] + 1j * draws[:, 1 : 2 * p : 2]
    decay = np.array([pole.decay for pole in poles]) * np.exp(np.clip(draws[:, 2 * p :: 2], -3, 3))
    omega = np.array([pole.s.imag for pole in poles]) + draws[:, 2 * p + 1 :: 2]
    hz, mean_decay, level = figures_of(a[:, chosen], decay[:, chosen], omega[:, chosen])
    columns = ([q.a for q in pair], [q.decay for q in pair], [q.s.imag for q in pair])
    value, rate, loud = (float(column[0]) for column in figures_of(*(np.array([column]) for column in columns)))
    middle = math.log(value * (1 + fit.glide.pitch)) + CENTS * rest.cents
    reach = CENTS * _reach("cents", _deviation(np.log(np.maximum(hz, 1e-9))) / CENTS, rest.error)
    decay_reach = _reach("decay", _deviation(np.log(mean_decay)))
    level_reach = _reach("level_db", _deviation(level))
    return Spread(
        (math.exp(middle - reach), math.exp(middle + reach)),
        (rate * math.exp(-decay_reach), rate * math.exp(decay_reach)),
        (loud - level_reach, loud + level_reach),
        rest.cents,
    )


def covariance(columns: Complex, residual: Complex) -> Array:
    """The covariance of the poles' numbers (n,), from their columns (bins, n), with what is left where it lies."""
    rows = real_rows(columns)
    scale = np.linalg.norm(rows, axis=0) + 1e-300
    inverse = np.linalg.pinv((rows / scale).T @ (rows / scale), rcond=1e-10, hermitian=True)
    columns = columns / scale
    leverage = 0.5 * (columns.conj() @ inverse * columns).sum(1).real
    scores = (columns.conj() * residual[:, None]).real / (1 - np.clip(leverage, 0, MOST_LEVERAGE))[:, None]
    middle = scores.T @ scores
    for apart in range(1, NEIGHBOURS):
        crossed = scores[apart:].T @ scores[:-apart]
        middle = middle + (1 - apart / NEIGHBOURS) * (crossed + crossed.T)
    return np.asarray(inverse @ middle @ inverse / np.outer(scale, scale))


def figures_of(a: Complex, decay: Array, omega: Array) -> tuple[Array, Array, Array]:
    """The figures of draws (draws, poles): mean frequency over the energy, σ, level in dB.

    σ is that of one exponential with the same centre of energy.
    """
    energy, moment, turn = moments(a, -decay + 1j * omega)
    energy = np.maximum(energy, 1e-300)
    mean = 0.5 * energy / np.maximum(moment, 1e-300)
    return turn / energy / (2 * math.pi), np.clip(mean, 1e-3, 1e4), 10 * np.log10(energy)


def _deviation(values: Array) -> float:
    """A standard deviation that bears outliers."""
    low, high = np.percentile(values, (15.87, 84.13))
    return float(high - low) / 2


def _reach(kind: str, *errors: float) -> float:
    return NORMAL_95 * math.hypot(MODEL_ERRORS[kind], *errors)
