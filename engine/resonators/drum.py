"""Membranes and thin plates as modes that share one tension, as the string's do.

Berger (J. Appl. Mech. 22 (1955), 465) leaves out the second invariant of strain. With an edge that is held in its
plane, displacement raises the tension evenly: C (1/A) ∫|∇w|² dA with C = Eh/(2(1 - ν²)):

    μẅ + D∇⁴w - (T + ΔT)∇²w + losses = 0,      ω² = (Tκ² + Dκ⁴)/μ,   k = Cκ²/μ,   η² = κ².

Exact for membranes and rectangles that are supported at the edge. On a circle Dκ⁴ is an approximation, good where
tension outweighs bending. Clamped plates and free edges (cymbals, gongs) need another model. Modes are normalised by
their mass, which the air makes larger for low modes, so that k/η² is the same for all.

A mode moves the air on both sides of an infinite baffle, in which the membrane lies, and radiates: most of all (0,1).
D(s) is the share of the mode's square at a wavenumber s. The pressure that a plane wave of velocity v makes is
iωρv/√(s² - k²), k = ω/c: a mass where s > k, a resistance where s < k. In modes above 16 radians of κa, D is
concentrated at κ, so that the mass is ρ/√(κ² - k²) a side. Couplings between modes by the air are left out (Christian
et al., JASA 76 (1984), 1336).

In an open shell the air that a mode moves as a whole, its plane wave, is a column: an unflanged pipe, whose end
reflects exp(-(ka)²/2) at 0.6133 a beyond it (Levine and Schwinger, Phys. Rev. 73 (1948), 383; the magnitude for
ka < 1). It takes the place of a piston in a baffle (Morse and Ingard, Theoretical Acoustics (1968), 7.4).

Frequencies of pairs differ to the first order of perturbation: κ² of cos θ falls by the ellipticity ε, that of sin θ
rises; other pairs part with powers of ε. Computed by `engine.kernels.drum_modes`.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace
from functools import cached_property

import numpy as np

from engine.kernels import drum_modes as kernel
from engine.resonators import surface
from engine.resonators.base import Array, Resonator
from engine.resonators.surface import Surface, tools
from engine.values.drum import SHAPES, DrumParameters

MOST_MODES = 1_600


def numbers_of(drum: DrumParameters) -> Array:
    """The drum's numbers, as the kernels have them."""
    return np.array([SHAPES.index(drum.shape), *astuple(drum)[1:]], np.float64)


def stretching_n_m(drum: DrumParameters) -> float:
    """C = Eh/2(1 - ν²); of a bar, which is free to widen, without ν."""
    return float(kernel.stretching(numbers_of(drum)))


def bending_nm(drum: DrumParameters) -> float:
    """D = Eh³/12(1 - ν²); of a bar without ν."""
    return stretching_n_m(drum) * drum.thickness_m**2 / 6


def around(drum: DrumParameters, highest_hz: float, most: int = MOST_MODES) -> kernel.Around:
    """The kernels' input for modes: the surface's list, the air's table, and ka up to which that goes.

    Args:
        most: modes that are needed at most.

    Returns:
        rows of `surface.modes_below`, (4, modes); the table of `surface.air_below`, empty without air; and ka.
    """
    numbers = numbers_of(drum)
    size_m = kernel.size(numbers)
    low = 1.2 * kernel.LOW_HZ * kernel.lowest(numbers) * size_m  # for its pitch
    needed = (
        max(kernel.reach(numbers, highest_hz, most), low),
        4 * math.pi * highest_hz / kernel.AIR_M_S * size_m,
    )
    reach, ka = (2 ** (math.ceil(4 * math.log2(1.05 * need)) / 4) for need in needed)  # for its like too
    air = surface.air_below(drum.shape, drum.aspect, ka, surface.POINTS) if drum.air_kg_m3 else np.zeros((2, 0, 0))
    return surface.modes_below(drum.shape, drum.aspect, reach), air, ka


def modes_of(drum: DrumParameters, highest_hz: float, most: int = MOST_MODES) -> DrumModes:
    """The lowest modes below a frequency, so many at most.

    Raises:
        ValueError: there is none, or far too many; the message names the remedy.
    """
    known, rows = around(drum, highest_hz, most), np.empty((kernel.ROWS, most))  # rows: written by the kernel
    count = kernel.modes(numbers_of(drum), known, highest_hz, most, _work(known[0]), rows)
    if count == 0:
        raise ValueError(f"a drum has no mode below {highest_hz:g} Hz; tune it lower, or ask for higher modes")
    return DrumModes(drum, rows[:, :count].copy())


def tune(drum: DrumParameters, ratio: float, highest_hz: float) -> DrumParameters:
    """The drum whose pitch is higher by a ratio: a membrane's by its tension, a plate's by its size.

    Raises:
        ValueError: it is out of its bounds then.
    """
    known, changed = around(drum, highest_hz), numbers_of(drum)
    kernel.tune(changed, ratio, known, _work(known[0]), np.empty((kernel.ROWS, kernel.LOW_MODES)))
    length_m, width_m, tension_n_m = map(float, changed[[kernel.LENGTH, kernel.WIDTH, kernel.TENSION]])
    return replace(drum, length_m=length_m, width_m=width_m, tension_n_m=tension_n_m)


def _work(rows: Array) -> Array:
    """The kernels' work space for a surface's list of modes, (4, modes)."""
    return np.empty(4 * rows.shape[1] + kernel.ORDERS)


@dataclass(frozen=True, eq=False)
class DrumModes:
    """Modes of a drum by rising frequency; see the module. Places are (x, y) from the centre, in half-lengths.

    Attributes:
        rows: (7, modes): those of a surface, then ω, mass in kg/m², and what is radiated of σ.
        scale: √(μ/μ_n); mass-normalised shapes are smaller by it.
    """

    drum: DrumParameters
    rows: Array

    @cached_property
    def numbers(self) -> Array:
        """The drum's numbers, as the kernels have them."""
        return numbers_of(self.drum)

    @property
    def omega(self) -> Array:
        return self.rows[kernel.OMEGA]

    @cached_property
    def sigma(self) -> Array:
        rates = np.empty(len(self))
        kernel.losses(self.numbers, self.rows, rates)
        return rates

    @property
    def scale(self) -> Array:
        scale: Array = np.sqrt(self.drum.mass_kg_m2 / self.rows[kernel.MASS])
        return scale

    @cached_property
    def surface(self) -> Surface:
        return Surface(self.numbers[:3], self.rows[: kernel.SURFACE])

    def __len__(self) -> int:
        return self.rows.shape[1]

    @property
    def stretch(self) -> Array:
        """η² in 1/m², of mass-normalised amplitudes."""
        return (self.surface.wavenumber * self.scale) ** 2

    def shapes(self, places: Array) -> Array:
        """Displacement at places (places, 2) of each mode at amplitude 1, (modes, places)."""
        return self.surface.shapes(np.asarray(places, dtype=np.float64)) * self.scale[:, None]

    def damped(self, d1_kg_m2_s: float, d3_kg_s: float) -> DrumModes:
        """The same modes with other damping. They stay, since ω is undamped; σ is computed when it is asked for."""
        return replace(self, drum=replace(self.drum, damping_d1_kg_m2_s=d1_kg_m2_s, damping_d3_kg_s=d3_kg_s))

    def resonator(self, places: Array, *, tension_modulated: bool = True) -> Resonator:
        """The resonator for truth and models, with the shapes at a few places (places, 2).

        Amplitudes do not follow from these.
        """
        coupling = stretching_n_m(self.drum) / self.drum.mass_kg_m2 * self.stretch
        first = float(self.surface.wavenumber.min())
        return Resonator(
            omega=self.omega,
            sigma=self.sigma,
            coupling=coupling if tension_modulated else np.zeros_like(coupling),
            stretch=self.stretch,
            tension_rise=stretching_n_m(self.drum) / (self.drum.tension_n_m + bending_nm(self.drum) * first**2),
            shapes=self.shapes(places),
            analysis=None,
        )

    @property
    def mass_kg(self) -> float:
        """μA: of each mass-normalised mode."""
        return float(kernel.mass_kg(self.numbers))

    def struck(self, place: tuple[float, float], radius_m: float) -> Array:
        """The speeds (modes,) in m/s from a sudden blow of 1 N s, spread over a disc at a place."""
        amplitudes = np.empty(len(self))
        kernel.struck(self.numbers, self.rows, *map(float, place), radius_m, tools(), amplitudes)
        return amplitudes

    def blow(self, struck: Array, contact_s: float, mallet_kg: float, speed_m_s: float) -> Array:
        """The speeds (modes,) in m/s from a mallet's blow, see `engine.strike`.

        Args:
            struck: those that 1 N s at once gives.
            contact_s: time of contact at 1 m/s.
        """
        amplitudes = np.empty(len(self))
        kernel.blow(self.omega**2, struck, contact_s, (self.mass_kg, mallet_kg), speed_m_s, amplitudes)
        return amplitudes

    def radiated(self, direction: tuple[float, float], distance_m: float = 1.0) -> Array:
        """Sound pressure in Pa (modes,) far off, of each mode at amplitude 1 m, as from a baffle.

        By Rayleigh's integral, ρω²/2πr |∫φ e^{ik·x} dA| at the mode's own frequency: a low mode with nodal lines is
        heard beside the axis alone. Phases are left out, which no ear hears in one mode.

        Args:
            direction: cosines along the two axes of the surface; (0, 0) is above the centre.
        """
        weights = np.empty(len(self))
        kernel.radiated(self.numbers, self.rows, *map(float, direction), tools(), weights)
        return weights / distance_m
