"""Intervals of what is learned of each partial: frequency at rest, decay, level.

Three variances add up:

- that of the poles. What a fit leaves is neither white nor even over a band. It is counted where it lies, bin by
  bin with its neighbours (White 1980; MacKinnon, White 1985: HC3; Newey, West 1987), not as a mean over the band;
- that of the partial's unknown share of the tension, below;
- that of the model, which is not quite true (Kennedy, O'Hagan 2001): the root mean square that it is off on
  synthetic notes of the project's own solver, with body, noise and a second polarisation.

`bench.recordings.coverage` measures the last one, and tests the intervals on other notes.

Frequencies at rest: what is left of each partial's frequency when the glide has ended.

A fit knows the curve of pitch, but not where it ends: a glide that is slower than the note trades against f0. The
string decides. Its tension rises with its energy, so that the glide is a sum of its partials' decays of energy, with
weights above 0. The constant that such a sum leaves belongs to the frequencies at rest.

The glide of recordings follows that law less well than that of the solver. So the fit's own end and the law's are
averaged, each with the inverse of its variance; the law's is how far the curve departs from it.

A partial also bends its own pitch, by half as much again as it bends that of all others: of q³ with q = a cos, 3/4 a³
is at its frequency; of q r² with another one, 1/2 (Nayfeh, Mook 1979, ch. 6). A sound does not give its share of
the tension. A triangle pulled anywhere gives a mean and a spread.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import optimize

from engine.resonators.base import Array
from training.recording.glide import CENTS, Glide
from training.recording.refine import FREE, Complex, Fit, Pole, moments, polarisations, real_rows

MODEL_ERRORS = {"cents": 0.6, "decay": 0.05, "level_db": 0.35}  # cents, a share, dB
NORMAL_95 = 1.96  # standard deviations to either side of 95 %
NEIGHBOURS = 4  # bins over which a residual counts as correlated
MOST_LEVERAGE = 0.95  # of one bin
DRAWS = 400  # of the poles' numbers, for each partial
SECONDS, POINTS = 2.4, 1200  # of the curves of pitch and energy
LAW_PARTIALS = 12  # the lowest, which have nearly all of the tension
FIT_CENTS = 2.0  # that a fit's own end of the glide is off, an estimate; on synthetic notes it is 1.2
LEAST_FALL = 0.1  # of a partial's energy: what falls less looks like a constant
LEAST_WEIGHT = 1e-3  # of a time in the law's fit, as a share of the energy at the loudest one
PLACES = np.linspace(0.05, 0.5, 200)  # of plucks
OWN = 0.5  # what a partial adds to its own glide, of what it adds to all


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
        number + 1: polarisations([pole for pole in poles if pole.a]) for number, poles in enumerate(fit.poles[:FREE])
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
    """The spread of one partial, by random draws of the numbers of all poles in its band.

    Args:
        pair: those of the band's poles that are its polarisations, one or two.
        rest: from its poles to its frequency at rest.
        residual: what the whole fit leaves, (bins,).
    """
    where = fit.bands[band]
    poles = [pole for pole in fit.poles[band] if pole.a]
    spread = covariance(np.concatenate(fit.columns(poles, where), 1), residual[where])
    values, vectors = np.linalg.eigh(spread)
    draws = random.standard_normal((DRAWS, len(values))) @ (vectors * np.sqrt(np.maximum(values, 0))).T
    p, chosen = len(poles), [poles.index(pole) for pole in pair]
    # (draws, poles) each
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
    """Half an interval of 95 % from standard errors and the model's, in the unit that `MODEL_ERRORS` has for it."""
    return NORMAL_95 * math.hypot(MODEL_ERRORS[kind], *errors)


@dataclass(frozen=True)
class Rest:
    """The interval from a partial's poles up to its frequency at rest, in cents, and its standard error."""

    cents: float
    error: float


def at_rest(glide: Glide, poles: dict[int, list[Pole]]) -> dict[int, Rest]:
    """The interval up to the frequency at rest, by the number of each partial.

    Args:
        poles: of each partial, with amplitudes.
    """
    unknown = {number: Rest(0.0, 0.0) for number in poles}
    if not poles or not glide.shares.any():
        return unknown
    t = np.linspace(0, SECONDS, POINTS)
    curves = {number: _energy(partial_poles, t) for number, partial_poles in poles.items()}
    low = [number for number in sorted(poles)[:LAW_PARTIALS] if curves[number][-1] < LEAST_FALL * curves[number][0]]
    if not low:
        return unknown
    energies = np.stack([curves[number] / curves[number][0] for number in low], 1)
    known = np.sum([curves[number] * partial_poles[0].hz ** 2 for number, partial_poles in poles.items()], axis=0)
    weight = np.sqrt(known / known.max() + LEAST_WEIGHT)
    rows = np.column_stack([energies, np.ones(POINTS), -np.ones(POINTS)])
    curve = glide.cents(t)
    law_shares, _ = optimize.nnls(rows * weight[:, None], curve * weight)
    law = energies @ law_shares[: len(low)]
    misfit = float(np.sqrt(np.mean((curve - rows @ law_shares) ** 2)))
    trusted = FIT_CENTS**2 / (FIT_CENTS**2 + misfit**2)
    law_error = misfit * math.sqrt(trusted)
    rests = {}
    for number in poles:
        seen = curves[number] / curves[number].sum()
        share, spread = share_of_tension(number)
        own_cents = OWN * float(seen @ law)
        cents = float(seen @ (curve - law)) - share * own_cents
        rests[number] = Rest(trusted * cents, math.hypot(spread * own_cents, law_error))
    return rests


@lru_cache(maxsize=128)
def share_of_tension(number: int) -> tuple[float, float]:
    """The share that a plucked string's partial has of the tension.

    Its mean and standard deviation are over places of the pluck.

    A triangle's partials have amplitudes ∝ sin(π k p)/k² and shares of the tension ∝ the squares of k times these.
    """
    shares = np.sin(number * math.pi * PLACES) ** 2 / number**2
    shares /= 0.5 * math.pi**2 * PLACES * (1 - PLACES)  # the sum over all k
    return float(shares.mean()), float(shares.std())


def _energy(poles: list[Pole], t: Array) -> Array:
    """|Σ a exp(st)|² of a partial, with its beats."""
    s, a = np.array([pole.s for pole in poles]), np.array([pole.a for pole in poles])
    return np.asarray(np.abs(np.exp(np.outer(t, s)) @ a) ** 2, np.float64)
