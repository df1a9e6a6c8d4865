"""Air at a membrane: its mass lowers the low modes, and what it radiates damps them, most of all (0,1).

A mode moves the air on both sides of an infinite baffle, in which the membrane lies. D(s) is the share of the mode's
square at a wavenumber s. The pressure that a plane wave of velocity v makes is iωρv/√(s² - k²), k = ω/c: a mass
where s > k, a resistance where s < k. In modes above `EXACT` radians of κa, D is concentrated at κ, so that the mass
is ρ/√(κ² - k²) a side. Couplings between modes by the air are left out (Christian et al., JASA 76 (1984), 1336).
"""

from __future__ import annotations

import math

import numpy as np

from engine.resonators.base import Array
from engine.resonators.surface import Surface

DENSITY_KG_M3, SPEED_M_S = 1.2, 343.0
SIDES = 2
EXACT = 16.0  # radians of κ√(A/π), above which waves are nearly plane
POINTS = 256  # of an integral; of a bar it converges to 0.1 %, of others to 3e-5
ROUNDS, EXACT_ROUNDS = 4, 2  # the mass depends on the frequency, a little


def loaded(
    surface: Surface, stiffness: Array, mass_kg_m2: float, density_kg_m3: float = DENSITY_KG_M3
) -> tuple[Array, Array]:
    """Mass a unit of area (modes,) in kg/m² with the air's, and the decay rates (modes,) in 1/s that it adds.

    Args:
        stiffness: Tκ² + Dκ⁴ in N/m³, (modes,).
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
            air[low] = density_kg_m3 * _reactance(distinct, k[each], size_m)[place]
        mass = mass_kg_m2 + SIDES * air
    if len(low):
        omega = np.sqrt(stiffness[each] / mass[each])
        resistance = density_kg_m3 * omega * _resistance(distinct, omega / SPEED_M_S)
        sigma[low] = (SIDES * resistance / (2 * mass[each]))[place]
    return mass, sigma


def _reactance(surface: Surface, k: Array, size_m: float) -> Array:
    """∫ D(s)/√(s² - k²) ds over s > k, with s² = k² + u²: ∫ D(s)/s du."""
    highest = 8 * EXACT / size_m
    u = (np.arange(POINTS) + 0.5) * (highest / POINTS)
    s = np.sqrt(k[:, None] ** 2 + u**2)
    found: Array = (surface.density(s) / s).sum(1) * (highest / POINTS)
    return found


def _resistance(surface: Surface, k: Array) -> Array:
    """∫ D(s)/√(k² - s²) ds over s < k, with s = k sin α."""
    alpha = (np.arange(64) + 0.5) * (math.pi / 128)
    found: Array = surface.density(k[:, None] * np.sin(alpha)).sum(1) * (math.pi / 128)
    return found
