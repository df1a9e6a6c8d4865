"""The stiff string: what follows from its physical parameters in closed form, for all modes at once.

Source: Diaz, De La Vega Martin, Sandler, "Towards Efficient Modelling of String Dynamics", DAFx24
(below: the paper), Eq. 1-5 and Table 1. The laws are those of `engine.kernels.strings`.
"""

from __future__ import annotations

import numpy as np

from engine.kernels import strings as law
from engine.resonators.base import Array, Resonator
from engine.resonators.sine_transform import analysis_matrix, synthesis_matrix
from engine.values.string import StringParameters


def wavenumbers(string: StringParameters, modes: int) -> Array:
    """η_μ = μπ/ℓ in rad/m, float64 (modes,)."""
    return law.wavenumber(string.row, _numbers(modes))


def decay_rates(string: StringParameters, modes: int) -> Array:
    """σ_μ = (d₁ + d₃η²) / 2ρA in 1/s, float64 (modes,): a free mode decays as exp(-σt)."""
    return law.decay_rate(string.row, _numbers(modes))


def undamped_frequencies(string: StringParameters, modes: int) -> Array:
    """ω_μ = √((EIη⁴ + T₀η²) / ρA) in rad/s, float64 (modes,)."""
    return np.sqrt(law.omega_squared(string.row, _numbers(modes)))


def tension_coupling(string: StringParameters, modes: int) -> Array:
    """k_μ = EAη_μ² / 4ρA in 1/(m² s²)·m², float64 (modes,).

    The tension-modulated string adds the acceleration -k_μ q_μ Σ η_m² q_m² (Eq. 3-5 on modal amplitudes).
    """
    return law.coupling(string.row, _numbers(modes))


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
        end_force=law.bridge_force(string.row, _numbers(modes)),
    )


def _numbers(modes: int) -> Array:
    return np.arange(1.0, modes + 1)
