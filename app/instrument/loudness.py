"""How loud a key is, in closed form, and the gain that makes all keys of a patch equally loud.

Measured as loudness meters do: mean square after the K-weighting of ITU-R BS.1770-5, here over the first part of the
note. The quiet string's partials decay each by itself, so that the mean square is a sum over them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from app.instrument.effects import RESPONSE_HZ, Response
from engine.excitation import release_factor
from engine.pluck import FULL_SCALE_M, FULL_SCALE_M_S, Pluck
from engine.resonators.base import Resonator
from engine.voices import Ear

PART_S = 0.4  # of the note: a loudness meter's block
# The level of a note at REFERENCE_VELOCITY. Six such notes of the classical guitar, strummed, peak at -9 dBFS.
WANTED_DB = -29.0
HIGHEST_PEAK_DB = WANTED_DB + 15.0  # of such a note of any key
PEAK_BLOCKS = 54  # blocks of 54 frames: 60 ms
GAIN_RANGE_DB = (WANTED_DB - 6.0, WANTED_DB + 66.0)
# BS.1770: the shelf and the high-pass as analogue filters of second order
_SHELF_HZ, _SHELF_DB, _SHELF_Q = 1681.97, 4.0, 0.7072
_PASS_HZ, _PASS_Q = 38.135, 0.5003


def k_weight(frequencies_hz: NDArray[np.float64]) -> NDArray[np.float64]:
    """The square of the gain of K-weighting, of the shape of `frequencies_hz`."""
    s = 1j * frequencies_hz
    gain = 10 ** (_SHELF_DB / 20)
    middle = 10 ** (_SHELF_DB / 40)
    shelf = (gain * s**2 + middle / _SHELF_Q * _SHELF_HZ * s + _SHELF_HZ**2) / (
        s**2 + _SHELF_HZ / _SHELF_Q * s + _SHELF_HZ**2
    )
    high_pass = s**2 / (s**2 + _PASS_HZ / _PASS_Q * s + _PASS_HZ**2)
    return np.abs(shelf * high_pass) ** 2


def level_db(
    resonator: Resonator, pluck: Pluck, ear: Ear, response: Response | None = None, release_s: float = 0.0
) -> float:
    """The K-weighted level of a quiet pluck's first 0.4 s, in dB re full scale; -inf for silence.

    Args:
        response: of the body that the string is heard through.
        release_s: of the pluck.
    """
    amplitudes, sigma, omega = _heard(resonator, pluck, ear, release_s)
    falls = 2 * sigma * PART_S
    mean = np.where(falls > 1e-6, -np.expm1(-falls) / np.maximum(falls, 1e-6), 1.0)
    frequencies_hz = omega / (2 * np.pi)
    heard = k_weight(frequencies_hz) * (response.power_at(frequencies_hz) if response is not None else 1.0)
    squares = 0.5 * amplitudes**2 * (mean * heard)[:, None]
    total = float(squares.sum(0).mean())
    return 10 * float(np.log10(total)) if total > 0 else -float("inf")


def gain_of(
    resonator: Resonator, pluck: Pluck, ear: Ear, response: Response | None = None, release_s: float = 0.0
) -> float:
    """The factor that brings a pluck at the reference velocity to the wanted level; 1 where it is silent."""
    found = level_db(resonator, pluck, ear, response, release_s)
    if found == -math.inf:  # at a fixed end: it would be far too loud anywhere else
        return 1.0
    low, high = GAIN_RANGE_DB
    return float(10 ** (min(max(WANTED_DB - found, low), high) / 20))


def peak_db(
    resonator: Resonator, pluck: Pluck, ear: Ear, response: Response | None = None, release_s: float = 0.0
) -> float:
    """The highest sample of a quiet pluck's first 60 ms, in dB re full scale; -inf for silence."""
    amplitudes, sigma, omega = _heard(resonator, pluck, ear, release_s)
    eigenvalues = (1j * omega - sigma) / RESPONSE_HZ
    blocks = np.arange(PEAK_BLOCKS)
    begins, within = (np.exp(np.multiply.outer(steps, eigenvalues)) for steps in (blocks * PEAK_BLOCKS, blocks))
    sounds = []
    for point in amplitudes.T:
        turned = np.einsum("bm,wm->bw", begins * point, within).ravel()  # threads of a BLAS take longer
        sound = turned.imag if ear.pickup == "velocity" else turned.real
        if response is not None:
            frames, impulse = len(sound), response.impulse[: len(sound)]  # later ones are heard after it
            points = 2 ** math.ceil(math.log2(frames + len(impulse)))
            sound = np.fft.irfft(np.fft.rfft(sound, points) * np.fft.rfft(impulse, points))[:frames]
        sounds.append(float(np.abs(sound).max()))
    highest = max(sounds)
    return 20 * float(np.log10(highest)) if highest > 0 else -float("inf")


def _heard(
    resonator: Resonator, pluck: Pluck, ear: Ear, release_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The amplitudes of the partials as heard, (modes, points), re full scale; σ and ω in 1/s, (modes,)."""
    q = resonator.to_modes(pluck.displacement(resonator.points))
    if release_s:
        q = q * release_factor(resonator.omega, release_s)
    weights = resonator.shapes @ ear.weights(resonator.points, resonator.force_weights) / FULL_SCALE_M
    sigma, omega = resonator.sigma, resonator.omega
    if ear.pickup == "velocity":
        weights = weights * omega[:, None] * (FULL_SCALE_M / FULL_SCALE_M_S)
    return weights * q[:, None], sigma, omega
