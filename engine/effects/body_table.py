"""The bodies of instruments (`bodies.toml`): their lowest modes from measurements, and statistics of those above.

A body takes the force at the bridge and gives pressure. Each entry names the sources of its figures. Frequencies are
in round numbers, of no particular instrument. "Estimate" marks figures that follow from size and material alone. So
do all quality factors and levels without a source. They lie in the range measured on guitars (T. J. W. Hill,
B. E. Richardson, S. J. Richardson, Acta Acustica 90 (2004) 335).

The higher modes are as dense as those of a thin orthotropic plate, √3 S / (h √(c_x c_y)) a hertz, or a membrane:
2πS f / c² (L. Cremer, M. Heckl, "Structure-Borne Sound"; N. H. Fletcher, T. D. Rossing, "The Physics of Musical
Instruments", 2nd ed., chapter 3). Speeds of waves in spruce along and across the grain: 5200 and 1400 m/s (there,
chapter 22); in paulownia 4700 and 1300 m/s (estimate).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Density = tuple[tuple[float, float], ...]  # (Hz, modes a hertz), linear between
SPRUCE_M_S = (5_200.0, 1_400.0)


@dataclass(frozen=True)
class Mode:
    """A resonance: its frequency, quality factor, and peak over the mean level of the higher modes."""

    frequency_hz: float
    quality: float
    peak_db: float
    sign: int = 1


@dataclass(frozen=True)
class Hill:
    """A broad rise of the mean level of the higher modes.

    A bridge's own resonance makes one (violin, banjo). So do ribs and braces: where half waves get shorter than the
    distance between them, the board's mobility rises (K. Ege, X. Boutillon, arXiv 1210.5688 (2010), on a piano: from
    1.1 kHz on). For other instruments place and height are estimates.
    """

    frequency_hz: float
    quality: float
    rise_db: float


@dataclass(frozen=True)
class Wood:
    """A body.

    Attributes:
        lowest: modes by rising frequency.
        density: of the modes above them.
        quality: of those.
        bright_hz: from here on their mean level falls by `fall_db` an octave: at 6 dB the bridge's mass, and
            radiation of a plate above coincidence (Cremer and Heckl, chapter 6).
        half_width_m: with it the directions to two ears differ from about c/2π half widths on.
        seconds: length of the response at a size of 1.
        seed: of the draws; of 40 tried, that with the most even response in third octaves, left, right and both.
        sources: of the figures.
    """

    title: str
    lowest: tuple[Mode, ...]
    density: Density
    quality: float
    bright_hz: float
    half_width_m: float
    seconds: float
    seed: int
    sources: str
    hills: tuple[Hill, ...] = ()
    fall_db: float = 6.0


def plate(area_m2: float, thickness_m: float, speeds_m_s: tuple[float, float] = SPRUCE_M_S) -> Density:
    """The density of a plate's modes, the same at all frequencies."""
    return ((0.0, math.sqrt(3) * area_m2 / (thickness_m * math.sqrt(math.prod(speeds_m_s)))),)


def membrane(radius_m: float, first_hz: float) -> Density:
    """The density of a round membrane's modes, by its lowest frequency: f₀₁ = 2.405 c / 2πa."""
    speed_m_s = 2 * math.pi * radius_m * first_hz / 2.405
    return ((0.0, 0.0), (20_000.0, 2 * math.pi * (math.pi * radius_m**2) * 20_000.0 / speed_m_s**2))


def drum(first_hz: float, quality: float) -> tuple[Mode, ...]:
    """The lowest modes of a round membrane that its bridge, off the centre, drives: zeros of Bessel functions."""
    ratios = (1.0, 1.593, 2.136, 2.295, 2.653, 2.917)  # of (0,1), (1,1), (2,1), (0,2), (3,1), (1,2)
    levels_db = (4.0, 0.0, -3.0, 3.0, -4.0, -1.0)  # those without nodal diameters radiate best
    return tuple(
        Mode(first_hz * ratio, quality, level_db, 1 - 2 * (n % 2))
        for n, (ratio, level_db) in enumerate(zip(ratios, levels_db, strict=True))
    )


def _wood(data: dict[str, Any]) -> Wood:
    """A body from its part of the file."""
    lowest = tuple(Mode(*mode) for mode in data.pop("lowest"))
    if "drum" in data:
        lowest += drum(**data.pop("drum"))
    if "plate" in data:
        density = plate(**data.pop("plate"))
    elif "membrane" in data:
        density = membrane(**data.pop("membrane"))
    else:
        density = tuple((hz, modes) for hz, modes in data.pop("density"))
    hills = tuple(Hill(*hill) for hill in data.pop("hills"))
    return Wood(lowest=lowest, density=density, hills=hills, **data)


BODIES: Mapping[str, Wood] = {
    name: _wood(data)
    for name, data in tomllib.loads(Path(__file__).with_name("bodies.toml").read_text("utf-8")).items()
}
