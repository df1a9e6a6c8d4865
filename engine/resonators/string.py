"""The stiff string: what follows from its physical parameters in closed form, for all modes at once.

Source: Diaz, De La Vega Martin, Sandler, "Towards Efficient Modelling of String Dynamics", DAFx24
(below: the paper), Eq. 1-5 and Table 1.
"""

from __future__ import annotations

import math

import numpy as np

from engine.resonators.base import Array, Resonator
from engine.resonators.sine_transform import analysis_matrix, synthesis_matrix
from engine.values.string import StringParameters


def wavenumbers(string: StringParameters, modes: int) -> Array:
    """η_μ = μπ/ℓ in rad/m, float64 (modes,)."""
    return np.arange(1.0, modes + 1) * (math.pi / string.length_m)


def decay_rates(string: StringParameters, modes: int) -> Array:
    """σ_μ = (d₁ + d₃η²) / 2ρA in 1/s, float64 (modes,): a free mode decays as exp(-σt)."""
    eta = wavenumbers(string, modes)
    return (string.damping_d1_kg_m_s + string.damping_d3_kg_m_s * eta**2) / (2 * string.mass_per_length_kg_m)


def undamped_frequencies(string: StringParameters, modes: int) -> Array:
    """ω_μ = √((EIη⁴ + T₀η²) / ρA) in rad/s, float64 (modes,)."""
    eta = wavenumbers(string, modes)
    bending = string.youngs_modulus_pa * string.second_moment_m4
    return np.sqrt((bending * eta**4 + string.tension_n * eta**2) / string.mass_per_length_kg_m)


def tension_coupling(string: StringParameters, modes: int) -> Array:
    """k_μ = EAη_μ² / 4ρA in 1/(m² s²)·m², float64 (modes,).

    The tension-modulated string adds the acceleration -k_μ q_μ Σ η_m² q_m² (Eq. 3-5 on modal amplitudes).
    """
    return (
        string.youngs_modulus_pa
        * string.area_m2
        * wavenumbers(string, modes) ** 2
        / (4 * string.mass_per_length_kg_m)
    )


def bridge_forces(string: StringParameters, modes: int) -> Array:
    """Force of each mode at amplitude 1 m on the support at x = 0, in N, float64 (modes,).

    The transverse force that a stiff string exerts on its support is T₀ ∂y/∂x - EI ∂³y/∂x³ (N. H. Fletcher,
    T. D. Rossing, "The Physics of Musical Instruments", 2nd ed., sections 2.12 and 2.18), here T₀η + EIη³.
    """
    eta = wavenumbers(string, modes)
    return string.tension_n * eta + string.youngs_modulus_pa * string.second_moment_m4 * eta**3


def resonator_of(
    string: StringParameters, modes: int, *, tension_modulated: bool = True, grid_points: int = 101
) -> Resonator:
    """The first modes of a string, on a grid of so many points with both ends.

    They are linear, or have the tension that stretch adds.

    Raises:
        ValueError: the grid does not hold so many modes.
    """
    coupling = tension_coupling(string, modes)
    return Resonator(
        omega=undamped_frequencies(string, modes),
        sigma=decay_rates(string, modes),
        coupling=coupling if tension_modulated else np.zeros_like(coupling),
        stretch=wavenumbers(string, modes) ** 2,
        tension_rise=string.youngs_modulus_pa * string.area_m2 / (4 * string.tension_n),
        shapes=synthesis_matrix(grid_points, modes),
        analysis=analysis_matrix(grid_points, modes),
        mirror=np.where(np.arange(modes) % 2, -1.0, 1.0),
        end_force=bridge_forces(string, modes),
    )
