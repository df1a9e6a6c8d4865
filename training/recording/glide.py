"""The glide of pitch that all partials share, and the time in which they do not glide.

dτ/dt = 1 + Σ_i c_i exp(-t/T_i): frequencies are those of the end, and τ runs faster while the string is tense. Three
time constants are fixed; the c_i are found, first from the phases of the partials, then with the poles (`refine`).
They are held firmly by a prior: freely fitted, a slow c_i trades against f0, and a fast one against a second pole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate

from engine.resonators.base import Array

TIMES_S = np.array([0.08, 0.3, 1.0])  # the T_i
CENTS = math.log(2) / 1200  # of one cent, the logarithm of the ratio
PRIOR_CENTS = np.array([10.0, 15.0, 10.0])  # standard deviation of each c_i
PRIOR_PITCH_CENTS = 10.0  # of a take's pitch, above that of the first


@dataclass(frozen=True)
class Glide:
    """A glide of pitch.

    Attributes:
        shares: the c_i of the time constants, shares of the frequency, (3,).
        pitch: share of all frequencies above those of the poles; of takes that share their poles.
    """

    shares: Array
    pitch: float = 0.0

    @staticmethod
    def none() -> Glide:
        """The glide of a linear string: constant pitch, so that τ is t."""
        return Glide(np.zeros(len(TIMES_S)))

    def tau(self, t: Array) -> Array:
        """τ of times t in s after the beginning of the fit; any t, before it too."""
        return (1 + self.pitch) * t + basis(t) @ self.shares

    def times(self, tau: Array) -> Array:
        """The t of each τ."""
        t = tau / (1 + self.pitch) - basis(tau) @ self.shares
        for _ in range(6):
            slope = 1 + self.pitch + rate_basis(t) @ self.shares
            t = t - (self.tau(t) - tau) / slope
        return t

    def cents(self, t: Array) -> Array:
        """The pitch above that of the end, in cents."""
        return np.log1p(rate_basis(t) @ self.shares) / CENTS


def basis(t: Array) -> Array:
    """The integrals φ_i(t) = T_i (1 - exp(-t/T_i)) in s, (times, 3), of times t in s."""
    return TIMES_S * -np.expm1(-np.asarray(t)[..., None] / TIMES_S)


def rate_basis(t: Array) -> Array:
    """dφ_i/dt, (times, 3)."""
    return np.exp(-np.asarray(t)[..., None] / TIMES_S)


def warped(samples: Array, rate_hz: int, glide: Glide) -> tuple[Array, Array]:
    """Samples at equal steps of τ, a sample's length each, and the time t of each in s, (frames,) both."""
    duration = (len(samples) - 1) / rate_hz
    end = float(glide.tau(np.array(duration)))
    tau = np.arange(int(end * rate_hz) + 1) / rate_hz
    if not glide.shares.any() and not glide.pitch:
        return samples, tau
    t = np.clip(glide.times(tau), 0.0, duration)
    grid = np.arange(len(samples)) / rate_hz
    return interpolate.make_interp_spline(grid, samples, k=5)(t), t


def glide_of_phases(bands: list[tuple[float, float, NDArray[np.complex128]]]) -> Glide:
    """The glide from the phases of partials, by least squares with the prior; outliers lose weight.

    Args:
        bands: of each partial its frequency in Hz, the step in s, and its complex envelope (steps,) at equal steps.
    """
    rows, values = [], []
    for hz, step, z in bands:
        turned = z[1:] * z[:-1].conj()
        off = np.angle(turned) / (2 * math.pi * hz * step)  # its frequency above hz, as a share, in each step
        weight = np.sqrt(np.abs(turned)) * hz
        # beats turn the phase where the envelope is small; a common offset is the partial's own frequency
        t = np.asarray((np.arange(len(off)) + 0.5) * step, np.float64)
        columns = np.concatenate([rate_basis(t), np.ones((len(t), 1))], 1)
        row_scale = weight / (weight.max() + 1e-30) * np.sqrt(step)
        mean = columns[:, -1:]
        projected = [v - mean * ((row_scale**2 @ v) / (row_scale**2).sum()) for v in (columns[:, :-1], off[:, None])]
        strength = math.sqrt(float(np.mean(np.abs(z) ** 2))) * hz
        rows.append(projected[0] * row_scale[:, None] * strength)
        values.append(projected[1][:, 0] * row_scale * strength)
    design, target = np.concatenate(rows), np.concatenate(values)
    for _ in range(4):
        scale = np.sqrt(np.mean(target**2) + 1e-30)
        prior = np.diag(0.3 * scale * math.sqrt(len(target)) * 0.1 / (PRIOR_CENTS * CENTS * 300))
        shares, *_ = np.linalg.lstsq(
            np.concatenate([design, prior]), np.concatenate([target, np.zeros(len(TIMES_S))]), rcond=None
        )
        residual = np.abs(target - design @ shares)
        limit = 3 * np.median(residual) + 1e-30
        keep = np.minimum(1.0, limit / (residual + 1e-30))[:, None]
        design, target = design * keep, target * keep[:, 0]
    return Glide(np.clip(shares, -0.02, 0.06))
