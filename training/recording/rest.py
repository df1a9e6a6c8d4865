"""Frequencies at rest: what is left of each partial's frequency when the glide has ended.

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
from training.recording.glide import Glide
from training.recording.refine import Pole

SECONDS, POINTS = 2.4, 1200
LAW_PARTIALS = 12  # the lowest, which have nearly all of the tension
FIT_CENTS = 2.0  # that a fit's own end of the glide is off, an estimate; on synthetic notes it is 1.2
LEAST_FALL = 0.1  # of a partial's energy: what falls less looks like a constant
LEAST_WEIGHT = 1e-3
PLACES = np.linspace(0.05, 0.5, 200)  # of plucks
OWN = 0.5  # what a partial adds to its own glide, of what it adds to all


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
    if not poles or not glide.shares.any():
        return {number: Rest(0.0, 0.0) for number in poles}
    t = np.linspace(0, SECONDS, POINTS)
    curves = {number: _energy(partial_poles, t) for number, partial_poles in poles.items()}
    low = [
        number_low
        for number_low in sorted(poles)[:LAW_PARTIALS]
        if curves[number_low][-1] < LEAST_FALL * curves[number_low][0]
    ]
    if not low:
        return {number: Rest(0.0, 0.0) for number in poles}
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
