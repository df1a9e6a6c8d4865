"""The stiff string: its physical parameters and what follows from them in closed form.

Source: Diaz, De La Vega Martin, Sandler, "Towards Efficient Modelling of String Dynamics", DAFx24
(below: the paper), Eq. 1-5 and Table 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from engine import bounds
from engine.kernels import strings as law
from engine.resonators.base import Array, Resonator
from engine.resonators.sine_transform import analysis_matrix, synthesis_matrix


@dataclass(frozen=True)
class StringParameters:
    """Physical parameters of a simply supported stiff string. Default: the paper's Table 1, nylon, B3.

    Raises:
        ValueError: a parameter is not finite, negative, zero where that has no meaning, or out of its bounds.
    """

    length_m: float = 0.65
    area_m2: float = 0.5188e-6
    second_moment_m4: float = 0.141e-12
    density_kg_m3: float = 1140.0
    youngs_modulus_pa: float = 5.4e9
    damping_d1_kg_m_s: float = 8.0e-5
    damping_d3_kg_m_s: float = 1.4e-5
    tension_n: float = 60.97

    def __post_init__(self) -> None:
        may_be_zero = {"second_moment_m4", "youngs_modulus_pa", "damping_d1_kg_m_s", "damping_d3_kg_m_s"}
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value) or value < 0 or (value == 0 and field.name not in may_be_zero):
                raise ValueError(f"string parameter {field.name} must be positive and finite, not {value}")
            bounds.check(f"string parameter {field.name}", value, bounds.STRING[field.name])

    @property
    def mass_per_length_kg_m(self) -> float:
        """ρA."""
        return self.density_kg_m3 * self.area_m2

    @property
    def row(self) -> tuple[float, ...]:
        """The parameters in their order, as the laws of `engine.kernels.strings` take them."""
        return tuple(getattr(self, field.name) for field in fields(self))

    @property
    def pitch_hz(self) -> float:
        """The frequency of the first partial of a quiet pluck; 0 where it does not oscillate."""
        return law.pitch_hz(self.row)

    def wavenumbers(self, modes: int) -> Array:
        """η_μ = μπ/ℓ in rad/m, float64 (modes,)."""
        return law.wavenumber(self.row, _numbers(modes))

    def decay_rates(self, modes: int) -> Array:
        """σ_μ = (d₁ + d₃η²) / 2ρA in 1/s, float64 (modes,): a free mode decays as exp(-σt)."""
        return law.decay_rate(self.row, _numbers(modes))

    def undamped_frequencies(self, modes: int) -> Array:
        """ω_μ = √((EIη⁴ + T₀η²) / ρA) in rad/s, float64 (modes,)."""
        return np.sqrt(law.omega_squared(self.row, _numbers(modes)))

    def decay_rate(self, mode: int) -> float:
        """σ of one mode, as in `decay_rates`."""
        return law.decay_rate(self.row, mode)

    def undamped_frequency(self, mode: int) -> float:
        """ω of one mode, as in `undamped_frequencies`."""
        return math.sqrt(law.omega_squared(self.row, mode))

    def tension_coupling(self, modes: int) -> Array:
        """k_μ = EAη_μ² / 4ρA in 1/(m² s²)·m², float64 (modes,).

        The tension-modulated string adds the acceleration -k_μ q_μ Σ η_m² q_m² (Eq. 3-5 on modal amplitudes).
        """
        return law.coupling(self.row, _numbers(modes))

    def resonator(self, modes: int, *, tension_modulated: bool = True, grid_points: int = 101) -> Resonator:
        """The string's first modes, on a grid of so many points with both ends.

        They are linear, or have the tension that stretch adds.

        Raises:
            ValueError: the grid does not hold so many modes.
        """
        coupling = self.tension_coupling(modes)
        return Resonator(
            omega=self.undamped_frequencies(modes),
            sigma=self.decay_rates(modes),
            coupling=coupling if tension_modulated else np.zeros_like(coupling),
            stretch=self.wavenumbers(modes) ** 2,
            tension_rise=self.youngs_modulus_pa * self.area_m2 / (4 * self.tension_n),
            shapes=synthesis_matrix(grid_points, modes),
            analysis=analysis_matrix(grid_points, modes),
            mirror=np.where(np.arange(modes) % 2, -1.0, 1.0),
            end_force=law.bridge_force(self.row, _numbers(modes)),
        )

    def modes_below(self, frequency_hz: float) -> int:
        """The number of modes whose undamped frequency lies below `frequency_hz`."""
        return law.modes_below(self.row, frequency_hz)

    def check_motion(self, modes: int, grid_points: int, rate_hz: float, tension_modulated: bool) -> None:
        """Checks that its motion can be computed in ordinary memory and time, in closed form.

        Raises:
            ValueError: it cannot, or a mode does not oscillate; the message names the fields.
        """
        bounds.check("rate_hz", rate_hz, (1, bounds.HIGHEST_RATE_HZ), "Hz")
        bounds.check("grid_points", grid_points, (3, bounds.SIZES["grid_points"][1]))
        if not 1 <= modes <= grid_points - 2:
            raise ValueError(f"a grid of {grid_points} points cannot hold {bounds.brief(modes)} modes")
        if modes * grid_points > bounds.MOST_MATRIX_NUMBERS:
            raise ValueError(
                f"modes times grid_points must be at most {bounds.MOST_MATRIX_NUMBERS}, "
                f"not {modes} times {grid_points}"
            )
        if grid_points * rate_hz > bounds.MOST_NUMBERS_A_SECOND:
            raise ValueError(
                f"grid_points times rate_hz must be at most {bounds.MOST_NUMBERS_A_SECOND}, "
                f"not {grid_points} times {rate_hz:g}"
            )
        # σ² < ω² is a quadratic in η² that is not above 0 at η = 0: it holds for all modes if for first and last
        for mode in (1, modes):
            if not self.decay_rate(mode) < self.undamped_frequency(mode):
                raise ValueError(f"mode {mode} is overdamped: lower its damping, or keep fewer modes")
        if not tension_modulated:
            return
        highest_hz = self.undamped_frequency(modes) / (2 * math.pi)
        substeps = math.ceil(bounds.SUBSTEPS_IN_A_PERIOD * highest_hz / rate_hz)
        if substeps > bounds.MOST_SUBSTEPS:
            raise ValueError(
                f"mode {modes} at {highest_hz:.3g} Hz is too high for a rate_hz of {rate_hz:g}: the truth would take"
                f" {substeps:.3g} sub-steps, at most {bounds.MOST_SUBSTEPS}; keep fewer modes"
            )
        if modes * min(modes, substeps) > bounds.MOST_FLOWS:
            raise ValueError(f"{modes} modes with {substeps} sub-steps of the truth are too many; keep fewer modes")


def _numbers(modes: int) -> Array:
    return np.arange(1.0, modes + 1)
