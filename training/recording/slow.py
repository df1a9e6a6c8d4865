"""The decays that hardly show while they are fitted.

What lies beyond the end of the fit must not ring for ever.

Two poles of a band can follow a slow change, of level or of pitch, with one of them that does not decay at all. Its
decay is then unknown: its standard error is as large as itself. So each slow pole's log σ is averaged with that of a
pole that falls by 11 dB until the end of the fit. Each has the inverse of its variance. A decay that the recording
shows stays. Amplitudes are fitted again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from engine.resonators.base import Array
from training.recording.intervals import covariance
from training.recording.refine import FREE, Complex, Fit, Pole
from training.recording.sweeps import Takes

FALL = 1.25  # in nepers until the end of the fit, an estimate; faster poles are left alone
SPREAD = 0.5  # standard deviation of log σ, an estimate


def settle_slow(takes: Takes) -> None:
    """Settle the slow poles of takes, which share them; poles and amplitudes change in place."""
    least = FALL / max(len(fit.samples) / fit.rate_hz for fit in takes.fits)
    residuals = takes.residuals()
    for number in (*range(len(takes.damping)), FREE):
        takes.set_poles(number, _settled(takes, number, residuals, least))


def _settled(takes: Takes, number: int, residuals: Sequence[Complex], least: float) -> list[list[Pole]]:
    """The poles of a band, or the free ones, by take, with the slow ones settled and amplitudes fitted again.

    Args:
        least: σ in 1/s; faster poles stay as they are.
    """
    before, wheres = takes.poles(number), takes.bins(number)
    if not any(pole.decay < least for pole in before[0]):
        return before
    known = np.zeros(len(before[0]))
    for fit, poles, rest, where in zip(takes.fits, before, residuals, wheres, strict=True):
        known = known + _precision(fit, poles, rest[where], where)
    decays = [_decay(pole.decay, known_decay, least) for pole, known_decay in zip(before[0], known, strict=True)]
    slower = [
        [replace(pole, s=complex(-decay, pole.s.imag)) for pole, decay in zip(poles, decays, strict=True)]
        for poles in before
    ]
    return takes.solve(slower, takes.targets(before, residuals, wheres), wheres)[1]


def _decay(decay: float, known: float, least: float) -> float:
    """The settled σ in 1/s of one pole; `known`: inverse variance of its log σ by the recording."""
    if decay >= least:
        return decay
    prior = 1 / SPREAD**2
    return math.exp((known * math.log(decay) + prior * math.log(least)) / (known + prior))


def _precision(fit: Fit, poles: list[Pole], residual: Complex, where: slice) -> Array:
    """Inverse variance of each pole's log σ, (poles,); 0 of one without amplitude."""
    loud = [place for place, pole in enumerate(poles) if pole.a]
    inverse_variance = np.zeros(len(poles))
    if loud:
        columns = np.concatenate(fit.columns([poles[place] for place in loud], where), 1)
        inverse_variance[loud] = 1 / (np.diag(covariance(columns, residual))[2 * len(loud) :: 2] + 1e-9)
    return inverse_variance
