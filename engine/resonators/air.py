"""Air at a membrane: its mass lowers the low modes, and what it radiates damps them, most of all (0,1).

A mode moves the air on both sides of an infinite baffle, in which the membrane lies. D(s) is the share of the mode's
square at a wavenumber s. The pressure that a plane wave of velocity v makes is iωρv/√(s² - k²), k = ω/c: a mass
where s > k, a resistance where s < k. In modes above `EXACT` radians of κa, D is concentrated at κ, so that the mass
is ρ/√(κ² - k²) a side. Couplings between modes by the air are left out (Christian et al., JASA 76 (1984), 1336).

In an open shell the air that a mode moves as a whole, its plane wave, is a column: an unflanged pipe, whose end
reflects exp(-(ka)²/2) at 0.6133 a beyond it (Levine and Schwinger, Phys. Rev. 73 (1948), 383; the magnitude for
ka < 1). It takes the place of a piston in a baffle (Morse and Ingard, Theoretical Acoustics (1968), 7.4).
"""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from engine.resonators.base import Array
from engine.resonators.surface import Surface

DENSITY_KG_M3, SPEED_M_S = 1.2, 343.0
SIDES = 2
EXACT = 16.0  # radians of κ√(A/π), above which waves are nearly plane
POINTS = 256  # of an integral; of a bar it converges to 0.1 %, of others to 3e-5
ROUNDS, EXACT_ROUNDS = 4, 2  # the mass depends on the frequency, a little
COLUMN_ROUNDS = 40  # by halves: more than a little near a resonance of the column
BEYOND_THE_END = 0.6133  # of a radius
LEAST_VOLUME = 1e-6  # square of a mode's mean, below which it moves no column


def loaded(
    surface: Surface,
    stiffness: Array,
    mass_kg_m2: float,
    density_kg_m3: float = DENSITY_KG_M3,
    shell_m: float = 0.0,
) -> tuple[Array, Array]:
    """Mass a unit of area (modes,) in kg/m² with the air's, and the decay rates (modes,) in 1/s that it adds.

    Args:
        stiffness: Tκ² + Dκ⁴ in N/m³, (modes,).
        shell_m: depth of an open shell under the head; 0: a baffle there too.
    """
    size_m = math.sqrt(surface.area_m2 / math.pi)
    low = np.flatnonzero(surface.wavenumber * size_m < EXACT)
    first, place = surface.picked(low).distinct
    each = low[first]
    distinct = surface.picked(each)
    mass, sigma = np.full(len(stiffness), mass_kg_m2), np.zeros(len(stiffness))
    for turn in range(ROUNDS):
        k = np.sqrt(stiffness / mass) / SPEED_M_S
        below = np.maximum(surface.wavenumber**2 - k**2, (0.1 * surface.wavenumber) ** 2)
        air = density_kg_m3 / np.sqrt(below)
        if len(low) and turn >= ROUNDS - EXACT_ROUNDS:
            air[low] = density_kg_m3 * reactance(distinct, k[each], size_m)[place]
        mass = mass_kg_m2 + SIDES * air
    if len(low):
        omega = np.sqrt(stiffness[each] / mass[each])
        pressure = density_kg_m3 * omega * resistance(distinct, omega / SPEED_M_S)
        sigma[low] = (SIDES * pressure / (2 * mass[each]))[place]
    if shell_m:
        moved = np.flatnonzero(surface.transform(np.zeros_like(stiffness), 0.0) ** 2 > LEAST_VOLUME)
        volume = surface.picked(moved).transform(np.zeros(len(moved)), 0.0)
        load, still = density_kg_m3 * volume**2, mass[moved]
        for _ in range(COLUMN_ROUNDS):
            k = np.sqrt(stiffness[moved] / mass[moved]) / SPEED_M_S
            more = _column(k, size_m, shell_m)
            with_column = np.maximum(still + load * more.imag / k, mass_kg_m2 / 2)
            mass[moved] = (mass[moved] + with_column) / 2
        pressure = sigma[moved] * 2 * still + load * SPEED_M_S * more.real
        sigma[moved] = np.maximum(pressure, 0.0) / (2 * mass[moved])
    return mass, sigma


def _column(k: Array, size_m: float, shell_m: float) -> NDArray[np.complex128]:
    """Impedance of a shell's column of air less that of a piston in a baffle, of ρc."""
    ka = k * size_m
    back = np.exp(-(ka**2) / 2 - 2j * k * (shell_m + BEYOND_THE_END * size_m))
    piston = 1 - scipy.special.j1(2 * ka) / ka + 1j * scipy.special.struve(1, 2 * ka) / ka
    found: NDArray[np.complex128] = (1 - back) / (1 + back) - piston
    return found


def reactance(surface: Surface, k: Array, size_m: float) -> Array:
    """∫ D(s)/√(s² - k²) ds over s > k, with s² = k² + u²: ∫ D(s)/s du."""
    highest = 8 * EXACT / size_m
    u = (np.arange(POINTS) + 0.5) * (highest / POINTS)
    s = np.sqrt(k[:, None] ** 2 + u**2)
    found: Array = (surface.density(s) / s).sum(1) * (highest / POINTS)
    return found


def resistance(surface: Surface, k: Array) -> Array:
    """∫ D(s)/√(k² - s²) ds over s < k, with s = k sin α."""
    alpha = (np.arange(64) + 0.5) * (math.pi / 128)
    found: Array = surface.density(k[:, None] * np.sin(alpha)).sum(1) * (math.pi / 128)
    return found
