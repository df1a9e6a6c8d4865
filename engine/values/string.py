"""A string: the stiff string of physics, its two polarisations, and its losses by mode.

Source: Diaz, De La Vega Martin, Sandler, "Towards Efficient Modelling of String Dynamics", DAFx24
(below: the paper), Eq. 1-5 and Table 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from operator import attrgetter

from engine import bounds
from engine.kernels import strings as law
from engine.values.number import Number


@dataclass(frozen=True)
class StringParameters:
    """Physical parameters of a simply supported stiff string. Default: the paper's Table 1, nylon, B3.

    Attributes:
        area_m2, second_moment_m4: of the cross-section, A and I.
        damping_d1_kg_m_s, damping_d3_kg_m_s: σ = (d₁ + d₃η²)/2ρA in 1/s of a mode with wavenumber η in rad/m.
        tension_n: at rest, T₀.

    Raises:
        ValueError: a parameter is out of its bounds; the message names it.
    """

    length_m: Number = 0.65
    area_m2: Number = 0.5188e-6
    second_moment_m4: Number = 0.141e-12
    density_kg_m3: Number = 1140.0
    youngs_modulus_pa: Number = 5.4e9
    damping_d1_kg_m_s: Number = 8.0e-5
    damping_d3_kg_m_s: Number = 1.4e-5
    tension_n: Number = 60.97

    def __post_init__(self) -> None:
        bounds.check_all(self, bounds.STRING, "string parameter ")

    @property
    def mass_per_length_kg_m(self) -> float:
        """ρA."""
        return self.density_kg_m3 * self.area_m2

    @property
    def row(self) -> tuple[float, ...]:
        """The parameters in their order, as the laws of `engine.kernels.strings` take them."""
        return _VALUES(self)

    @property
    def pitch_hz(self) -> float:
        """The frequency of the first partial of a quiet pluck; 0 where it does not oscillate."""
        return law.pitch_hz(self.row)

    def decay_rate(self, mode: int) -> float:
        """σ of one mode in 1/s: a free mode decays as exp(-σt)."""
        return law.decay_rate(self.row, mode)

    def undamped_frequency(self, mode: int) -> float:
        """ω of one mode in rad/s."""
        return math.sqrt(law.omega_squared(self.row, mode))

    def modes_below(self, frequency_hz: float) -> int:
        """The number of modes whose undamped frequency lies below `frequency_hz`."""
        return law.modes_below(self.row, frequency_hz)

    def check_motion(self, modes: int, grid_points: int, rate_hz: float, tension_modulated: bool) -> None:
        """Check that its motion can be computed in ordinary memory and time, in closed form.

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


_VALUES = attrgetter(*(field.name for field in fields(StringParameters)))


@dataclass(frozen=True)
class Polarisations:
    """Motion across the string in two directions: normal to the soundboard, and along it.

    Kirchhoff's and Carrier's tension acts on both alike, S = Σ η² (y² + z²) (C. E. Gough, "The nonlinear free
    vibration of a damped elastic string", JASA 75, 1984). To a resonator they are modes of one shape, side by side,
    that share one stretch: solvers and models need no other equation. `engine.kernels.strings.rows` has the modes:
    pairs, then single ones. The lowest `MOST_PAIRS` partials have two modes; above them neither beats nor stages are
    heard, which is an estimate.

    The bridge treats the directions differently. A conductance G at the end of a string adds T G/ℓ to its decay
    rates: a round trip of 2ℓ/c leaves 1 - 2 Z G of a wave; Z = T/c (Fletcher and Rossing, "The Physics of
    Musical Instruments", section 2.12). Along the board it is stiffer: that motion rings longer, and two-stage decay
    follows (G. Weinreich, "Coupled piano strings", JASA 62, 1977; J. Woodhouse, "A necessary condition for
    double-decay envelopes in stringed instruments", JASA 150, 2021). Slightly different frequencies beat.

    Attributes:
        angle_deg: of the pluck, from the first direction.
        second_heard: what the second is heard with, of the first.
        second_cents: pitch of the second, above the first.
        conductance_s_kg, second_conductance_s_kg: real part of the bridge's admittance in both directions.
    """

    angle_deg: Number = 45.0
    second_heard: Number = 0.3
    second_cents: Number = 1.0
    conductance_s_kg: Number = 0.01
    second_conductance_s_kg: Number = 0.001

    def __post_init__(self) -> None:
        bounds.check_all(self, bounds.POLARISATIONS)

    @property
    def pulled(self) -> tuple[float, float]:
        """Parts of a pluck in both directions."""
        angle = math.radians(self.angle_deg)
        return math.cos(angle), math.sin(angle)

    @property
    def heard(self) -> tuple[float, float]:
        """The weights with which both are heard: a pluck is heard as high as it is pulled."""
        first, second = self.pulled
        whole = first + self.second_heard * second
        return 1 / whole, self.second_heard / whole

    @property
    def detuning(self) -> float:
        """ω² of the second over that of the first."""
        return float(2 ** (2 * self.second_cents / 1200))


@dataclass(frozen=True)
class Losses:
    """Decay by mode, besides d₁ and d₃ of the string, which may be 0 then: see `engine.resonators.losses`.

    Attributes:
        air: factor of the losses to the air, a; 1 is that of physics.
        friction: loss factor 1/Q of the string's tension, δ.
        bending: loss factor of bending, β.
    """

    air: Number = 1.0
    friction: Number = 2e-4
    bending: Number = 0.02

    def __post_init__(self) -> None:
        bounds.check_all(self, bounds.LOSSES)
