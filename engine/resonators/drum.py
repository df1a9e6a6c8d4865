"""Membranes and thin plates as modes that share one tension, as the string's do.

Berger (J. Appl. Mech. 22 (1955), 465) leaves out the second invariant of strain. With an edge that is held in its
plane, displacement raises the tension evenly, by C (1/A) ∫|∇w|² dA with C = Eh/(2(1 - ν²)):

    μẅ + D∇⁴w - (T + ΔT)∇²w + losses = 0,      ω² = (Tκ² + Dκ⁴)/μ,   k = Cκ²/μ,   η² = κ².

Exact for membranes and rectangles that are supported at the edge. On a circle Dκ⁴ is an approximation, good where
tension outweighs bending. Clamped plates and free edges (cymbals, gongs) need another model. Modes are normalised by
their mass, which the air makes larger for low modes (`air`), so that k/η² is the same for all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Literal, get_args

import numpy as np

from engine import bounds
from engine.resonators import air
from engine.resonators.base import Array, Resonator
from engine.resonators.surface import Circle, Numbers, Rectangle, Surface, spread

DrumShape = Literal["circle", "rectangle", "bar"]
MAY_BE_ZERO = frozenset(
    {"tension_n_m", "damping_d1_kg_m2_s", "damping_d3_kg_s", "uneven", "air_kg_m3", "cavity_m3", "shell_m"}
)
MOST_MODES = 1_600
LARGEST_ELLIPTICITY = 0.1


@dataclass(frozen=True)
class DrumParameters:
    """Physical parameters of a membrane or a thin plate. Default: the head of a concert tom of 33 cm, of Mylar.

    Attributes:
        length_m, width_m: sides of a rectangle; the two diameters of a circle, nearly the same. A bar is held at the
            ends of its length alone, and moves alike across its width.
        tension_n_m: at rest, per length of the edge; 0: a plate.
        damping_d1_kg_m2_s, damping_d3_kg_s: σ = (d₁ + d₃κ²)/2μ, besides what is radiated.
        uneven: by how much the frequencies of a circle's pairs differ, relatively: heads are never tuned evenly.
        air_kg_m3: density of the air on both sides; 0: none.
        cavity_m3: volume of a closed shell under the head, whose air is a spring for modes that move it; 0: open.
        shell_m: depth of an open shell under the head, whose air is a mass for modes that move it; 0: a baffle.

    Raises:
        ValueError: a parameter is not finite, out of its bounds, or does not go with others.
    """

    shape: DrumShape = "circle"
    length_m: float = 0.33
    width_m: float = 0.33
    thickness_m: float = 0.00019
    density_kg_m3: float = 1390.0
    youngs_modulus_pa: float = 3.5e9
    poisson: float = 0.38
    tension_n_m: float = 1500.0
    damping_d1_kg_m2_s: float = 1.0
    damping_d3_kg_s: float = 0.0005
    uneven: float = 0.0
    air_kg_m3: float = 0.0
    cavity_m3: float = 0.0
    shell_m: float = 0.0

    def __post_init__(self) -> None:
        if self.shape not in get_args(DrumShape):
            raise ValueError(
                f"drum parameter shape must be one of {', '.join(get_args(DrumShape))}, not {self.shape!r}"
            )
        for field in fields(self):
            if field.name == "shape":
                continue
            value = getattr(self, field.name)
            if not math.isfinite(value) or value < 0 or (value == 0 and field.name not in MAY_BE_ZERO):
                raise ValueError(f"drum parameter {field.name} must be positive and finite, not {value}")
            bounds.check(f"drum parameter {field.name}", value, bounds.DRUM[field.name])
        if self.shell_m and (self.cavity_m3 or not self.air_kg_m3):
            raise ValueError(
                "drum parameter shell_m is of an open shell in air: set cavity_m3 to 0 and air_kg_m3 to that of air, "
                "or shell_m to 0"
            )
        if self.shape == "circle" and abs(self.ellipticity) > LARGEST_ELLIPTICITY:
            raise ValueError(
                f"drum parameters length_m and width_m of a circle are its two diameters, nearly the same, "
                f"not {self.length_m:g} and {self.width_m:g}; make them alike, or choose a rectangle"
            )
        if self.thickness_m > (self.length_m if self.shape == "bar" else min(self.length_m, self.width_m)) / 10:
            raise ValueError(
                "drum parameter thickness_m must be below a tenth of the sides: a thick plate bends otherwise"
            )

    @property
    def mass_kg_m2(self) -> float:
        """μ = ρh."""
        return self.density_kg_m3 * self.thickness_m

    @property
    def bending_nm(self) -> float:
        """D = Eh³/12(1 - ν²); of a bar, which is free to widen, without ν."""
        return self.youngs_modulus_pa * self.thickness_m**3 / (12 * self._held_across)

    @property
    def stretching_n_m(self) -> float:
        """C = Eh/2(1 - ν²); of a bar without ν."""
        return self.youngs_modulus_pa * self.thickness_m / (2 * self._held_across)

    @property
    def _held_across(self) -> float:
        return 1.0 if self.shape == "bar" else 1 - self.poisson**2

    @property
    def ellipticity(self) -> float:
        """ε: the half-axes are a(1 ± ε)."""
        return (self.length_m - self.width_m) / (self.length_m + self.width_m)

    def surface(self, wavenumber: float) -> Surface:
        """Its modes up to a wavenumber."""
        if self.shape == "bar":
            return Rectangle.bar_below(self.length_m, self.width_m, wavenumber)
        if self.shape == "rectangle":
            return Rectangle.below(self.length_m, self.width_m, wavenumber)
        return Circle.below((self.length_m + self.width_m) / 4, wavenumber)

    def highest_wavenumber(self, highest_hz: float, most: int = MOST_MODES) -> float:
        """Up to which modes are looked at for the lowest below a frequency, so many at most."""
        load = self.mass_kg_m2 * (2 * math.pi * highest_hz) ** 2
        square = 2 * load / (self.tension_n_m + math.sqrt(self.tension_n_m**2 + 4 * self.bending_nm * load))
        highest = 1.2 * math.sqrt(square) if self.air_kg_m3 else math.sqrt(square)
        density = self.length_m * self.width_m / (4 * math.pi) * (math.pi / 4 if self.shape == "circle" else 1)
        if density * highest**2 > bounds.MOST_SURFACE_MODES:  # Weyl's law
            highest = math.sqrt(2.5 * (most + 50) / density)
        return highest

    def modes(self, highest_hz: float, most: int = MOST_MODES) -> DrumModes:
        """Its lowest modes below a frequency, so many at most.

        Raises:
            ValueError: there is none, or far too many; the message names the remedy.
        """
        surface = self.surface(self.highest_wavenumber(highest_hz, most) * (1 + 1e-9))
        if len(surface.wavenumber) == 0:
            raise ValueError(f"a drum has no mode below {highest_hz:g} Hz; tune it lower, or ask for higher modes")
        return DrumModes.of(self, surface, highest_hz, most)


@dataclass(frozen=True, eq=False)
class DrumModes:
    """Modes of a drum by rising frequency; see the module.

    Attributes:
        omega, sigma: with the air; (modes,).
        scale: √(μ/μ_n); mass-normalised shapes are smaller by it.
    """

    drum: DrumParameters
    surface: Surface
    omega: Array
    sigma: Array
    scale: Array

    @classmethod
    def of(cls, drum: DrumParameters, surface: Surface, highest_hz: float, most: int) -> DrumModes:
        kappa, mu = surface.wavenumber, drum.mass_kg_m2
        stiffness = drum.tension_n_m * kappa**2 + drum.bending_nm * kappa**4
        mass, radiated = np.full(len(kappa), mu), np.zeros(len(kappa))
        if drum.air_kg_m3:
            mass, radiated = air.loaded(surface, stiffness, mu, drum.air_kg_m3, drum.shell_m)
        squared = stiffness / mass
        if drum.cavity_m3:
            volumes = surface.transform(np.zeros_like(kappa), 0.0)
            spring = air.DENSITY_KG_M3 * air.SPEED_M_S**2 / drum.cavity_m3
            squared = squared + spring * volumes**2 * surface.area_m2 / mass
        omega = np.sqrt(squared) * _split(drum, surface)
        sigma = (drum.damping_d1_kg_m2_s + drum.damping_d3_kg_s * kappa**2) / (2 * mass) + radiated
        order = np.argsort(omega, kind="stable")
        order = order[omega[order] < 2 * math.pi * highest_hz][:most]
        if len(order) == 0:
            raise ValueError(f"a drum has no mode below {highest_hz:g} Hz; tune it lower, or ask for higher modes")
        chosen: Numbers = order.astype(np.int64)
        return cls(drum, surface.picked(chosen), omega[order], sigma[order], np.sqrt(mu / mass[order]))

    def __len__(self) -> int:
        return len(self.omega)

    @property
    def stretch(self) -> Array:
        """η² in 1/m², of mass-normalised amplitudes."""
        return (self.surface.wavenumber * self.scale) ** 2

    def shapes(self, places: Array) -> Array:
        """Displacement at places (places, 2) of each mode at amplitude 1, (modes, places)."""
        return self.surface.shapes(np.asarray(places, dtype=np.float64)) * self.scale[:, None]

    def damped(self, d1_kg_m2_s: float, d3_kg_s: float) -> DrumModes:
        """The same with other damping, which takes no time."""
        drum = replace(self.drum, damping_d1_kg_m2_s=d1_kg_m2_s, damping_d3_kg_s=d3_kg_s)
        own = self.drum
        more = d1_kg_m2_s - own.damping_d1_kg_m2_s + (d3_kg_s - own.damping_d3_kg_s) * self.surface.wavenumber**2
        sigma = self.sigma + more * self.scale**2 / (2 * own.mass_kg_m2)
        return replace(self, drum=drum, sigma=sigma)

    def resonator(self, places: Array, *, tension_modulated: bool = True) -> Resonator:
        """For truth and models; its points are a few places (places, 2), from which amplitudes do not follow."""
        coupling = self.drum.stretching_n_m / self.drum.mass_kg_m2 * self.stretch
        first = float(self.surface.wavenumber.min())
        return Resonator(
            omega=self.omega,
            sigma=self.sigma,
            coupling=coupling if tension_modulated else np.zeros_like(coupling),
            stretch=self.stretch,
            tension_rise=self.drum.stretching_n_m / (self.drum.tension_n_m + self.drum.bending_nm * first**2),
            shapes=self.shapes(places),
            analysis=None,
        )

    @property
    def mass_kg(self) -> float:
        """μA: of each mass-normalised mode."""
        return self.drum.mass_kg_m2 * self.surface.area_m2

    def struck(self, place: tuple[float, float], radius_m: float) -> Array:
        """Speeds (modes,) in m/s that a sudden blow of 1 N s gives, spread over a disc at a place."""
        return self.shapes(np.array([place]))[:, 0] * spread(self.surface.wavenumber, radius_m) / self.mass_kg

    def radiated(self, direction: tuple[float, float], distance_m: float = 1.0) -> Array:
        """Sound pressure in Pa (modes,) far off, of each mode at amplitude 1 m, as from a baffle.

        By Rayleigh's integral, ρω²/2πr |∫φ e^{ik·x} dA| at the mode's own frequency: a low mode with nodal lines is
        heard beside the axis alone. Phases are left out, which no ear hears in one mode.

        Args:
            direction: cosines along the two axes of the surface; (0, 0) is above the centre.
        """
        x, y = direction
        k = self.omega / air.SPEED_M_S * math.hypot(x, y)
        found = self.surface.transform(k, math.atan2(y, x)) * self.surface.area_m2 * self.scale
        return air.DENSITY_KG_M3 * self.omega**2 / (2 * math.pi * distance_m) * found


def _split(drum: DrumParameters, surface: Surface) -> Array | float:
    """Factors of frequency, (modes,): an ellipse parts the pairs of one nodal diameter, uneven tension all pairs.

    First order of perturbation: κ² of cos θ falls by ε, that of sin θ rises. Other pairs part with powers of ε.
    """
    if not isinstance(surface, Circle):
        return 1.0
    side = np.where(surface.m == 0, 0.0, np.where(surface.sine, 1.0, -1.0))
    found: Array = 1 + side * (np.where(surface.m == 1, drum.ellipticity / 2, 0.0) + drum.uneven / 2)
    return found
