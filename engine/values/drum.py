"""A drum: a membrane or a thin plate, and the mallet that strikes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from engine import bounds
from engine.values.number import Number

DrumShape = Literal["circle", "rectangle", "bar"]
SHAPES: tuple[str, ...] = get_args(DrumShape)  # numbers of the kernels
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
    length_m: Number = 0.33
    width_m: Number = 0.33
    thickness_m: Number = 0.00019
    density_kg_m3: Number = 1390.0
    youngs_modulus_pa: Number = 3.5e9
    poisson: Number = 0.38
    tension_n_m: Number = 1500.0
    damping_d1_kg_m2_s: Number = 1.0
    damping_d3_kg_s: Number = 0.0005
    uneven: Number = 0.0
    air_kg_m3: Number = 0.0
    cavity_m3: Number = 0.0
    shell_m: Number = 0.0

    def __post_init__(self) -> None:
        bounds.check_choice("drum parameter shape", self.shape, SHAPES)
        bounds.check_all(self, bounds.DRUM, "drum parameter ")
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
    def ellipticity(self) -> float:
        """ε: the half-axes are a(1 ± ε)."""
        return (self.length_m - self.width_m) / (self.length_m + self.width_m)

    @property
    def aspect(self) -> float:
        """Length by width; 1 of a circle. The same at all sizes, which differ by rounding."""
        return 1.0 if self.shape == "circle" else float(f"{self.length_m / self.width_m:.12g}")


@dataclass(frozen=True)
class Mallet:
    """The mallet that strikes. Default: a drumstick, of wood.

    Attributes:
        radius_m: of the face that touches.
        mass_kg: as it is felt at the tip; of a drumstick a third.
        contact_s: time of contact at 1 m/s: hardness.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """

    mass_kg: Number = 0.015
    radius_m: Number = 0.005
    contact_s: Number = 0.004

    def __post_init__(self) -> None:
        bounds.check_all(self, bounds.MALLET, "mallet ")
