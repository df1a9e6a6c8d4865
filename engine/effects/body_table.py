"""The bodies of instruments: their lowest modes from measurements, and the statistics of the modes above them.

A body takes the force at the bridge and gives pressure. Each entry names the sources of its figures. Frequencies are
in round numbers, of no particular instrument. "Estimate" marks figures that follow from size and material alone. So
do all quality factors and levels without a source. They lie in the range measured on guitars (T. J. W. Hill,
B. E. Richardson, S. J. Richardson, Acta Acustica 90 (2004) 335).

The density of the higher modes is that of a thin orthotropic plate, √3 S / (h √(c_x c_y)) a hertz, or of a membrane,
2πS f / c² (L. Cremer, M. Heckl, "Structure-Borne Sound"; N. H. Fletcher, T. D. Rossing, "The Physics of Musical
Instruments", 2nd ed., chapter 3). Speeds of waves in spruce along and across the grain: 5200 and 1400 m/s (there,
chapter 22); in paulownia 4700 and 1300 m/s (estimate).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

Density = tuple[tuple[float, float], ...]  # (Hz, modes a hertz), linear between
SPRUCE_M_S = (5_200.0, 1_400.0)
PAULOWNIA_M_S = (4_700.0, 1_300.0)


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
        bright_hz: from here on their mean level falls by 6 dB an octave: the bridge's mass, and radiation of a plate
            above coincidence (Cremer and Heckl, chapter 6).
        half_width_m: with it the directions to two ears differ from about c/2π half widths on.
        seed: of 40 that with the most even response in third octaves, left, right and both.
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


GUITAR_SOURCES = (
    "O. Christensen, B. B. Vistisen, J. Acoust. Soc. Am. 68 (1980) 758 (air and top coupled); Fletcher and "
    "Rossing, chapter 9; Hill, Richardson and Richardson 2004; J. Woodhouse, Acta Acustica 90 (2004) 928 "
    "(statistics above)"
)
BODIES: Mapping[str, Wood] = {
    "guitar": Wood(
        "Guitar",
        (
            Mode(100.0, 18, 4.0),  # the air in the hole with the top
            Mode(195.0, 25, 6.0, -1),  # the top against the air
            Mode(235.0, 30, 2.0),  # the back
            Mode(280.0, 30, 0.0, -1),  # the top's halves against one another: it radiates little
            Mode(395.0, 30, 4.0),  # the top along its length
            Mode(460.0, 30, 3.0, -1),
        ),
        plate(0.1, 0.0025),
        quality=30,
        bright_hz=3_500.0,
        half_width_m=0.18,
        seconds=0.35,
        seed=17,
        sources=GUITAR_SOURCES,
        hills=(Hill(1_500.0, 0.7, 5.0),),
    ),
    "dreadnought": Wood(
        "Steel-string guitar",
        (
            Mode(102.0, 20, 9.0),
            Mode(193.0, 30, 8.0, -1),
            Mode(204.0, 30, 4.0),
            Mode(326.0, 35, 1.0, -1),
            Mode(390.0, 35, 3.0),
            Mode(431.0, 35, 2.0, -1),
        ),
        plate(0.125, 0.0028),
        quality=38,
        bright_hz=8_000.0,
        half_width_m=0.2,
        seconds=0.4,
        seed=40,
        sources=(
            "modes of a Martin D-28 in Fletcher and Rossing, chapter 9, those above 300 Hz with ribs held; X-bracing "
            "and a lighter bridge: brighter (estimate)"
        ),
        hills=(Hill(2_400.0, 0.5, 11.0),),
    ),
    "archtop": Wood(
        "Archtop guitar",
        (
            Mode(125.0, 14, 3.0),
            Mode(215.0, 20, 4.0, -1),
            Mode(280.0, 22, 4.0),
            Mode(370.0, 22, 1.0, -1),
            Mode(480.0, 22, 2.0),
        ),
        plate(0.11, 0.005),
        quality=22,
        bright_hz=1_600.0,
        half_width_m=0.2,
        seconds=0.25,
        seed=19,
        sources=(
            "estimate: f-holes of a violin's kind, a carved top twice as thick as a flat one, a floating bridge"
        ),
        hills=(Hill(900.0, 1.2, 4.0),),
    ),
    "banjo": Wood(
        "Banjo",
        (Mode(215.0, 12, 0.0), *drum(295.0, 14)),
        membrane(0.14, 295.0),
        quality=16,
        bright_hz=3_500.0,
        half_width_m=0.14,
        seconds=0.16,
        seed=29,
        sources=(
            "formants at 500-800 Hz and two above: J. Woodhouse, D. Politzer, H. Mansour, Acta Acustica 5 (2021) 15 "
            "and 16 (doi 10.1051/aacus/2021008); head tuned to about D4, its air and its low quality, for a head "
            "radiates strongly, are estimates"
        ),
        hills=(Hill(680.0, 1.4, 9.0), Hill(2_700.0, 1.6, 5.0)),
    ),
    "skin": Wood(
        "Skin head",
        (Mode(150.0, 10, 1.0), *drum(240.0, 10)),
        membrane(0.11, 240.0),
        quality=11,
        bright_hz=2_600.0,
        half_width_m=0.12,
        seconds=0.14,
        seed=17,
        sources=("estimate, of shamisen and kora: a skin heavier than a banjo's head, with more loss, over a box"),
        hills=(Hill(850.0, 1.2, 7.0),),
    ),
    "harp": Wood(
        "Harp",
        (
            Mode(150.0, 18, 2.0),
            Mode(190.0, 22, 4.0, -1),
            Mode(275.0, 25, 3.0),
            Mode(350.0, 28, 2.0, -1),
            Mode(430.0, 30, 1.0),
        ),
        plate(0.32, 0.006, (5_200.0, 1_400.0)),
        quality=35,
        bright_hz=2_800.0,
        half_width_m=0.2,
        seconds=0.4,
        seed=26,
        sources=(
            "a pair of air and board below 200 Hz: J.-L. Le Carrou, F. Gautier, E. Foltête, J. Acoust. Soc. Am. 121 "
            "(2007) 559 (order of magnitude); breathing modes at 188, 273 and near 350 Hz: 'Vibroacoustics of a "
            "gothic harp', J. Acoust. Soc. Am. 129 (2011); board of 2-10 mm (estimate)"
        ),
        hills=(Hill(1_500.0, 0.6, 5.0),),
    ),
    "harpsichord": Wood(
        "Harpsichord",
        (Mode(52.0, 25, -4.0), Mode(78.0, 28, 0.0, -1), Mode(97.0, 28, 0.0), Mode(122.0, 30, 1.0, -1)),
        ((0.0, 0.06),),
        quality=32,
        bright_hz=9_000.0,
        half_width_m=0.4,
        seconds=0.5,
        seed=2,
        sources=(
            "36 modes up to 600 Hz, output even from 50 to 2000 Hz: W. R. Savage, E. L. Kottick, T. J. Hendrickson, "
            "K. D. Marshall, J. Acoust. Soc. Am. 91 (1992) 2180; the four lowest are estimates"
        ),
        hills=(Hill(3_000.0, 0.5, 9.0),),
    ),
    "upright": Wood(
        "Double bass",
        (
            Mode(62.0, 14, 6.0),
            Mode(102.0, 20, 6.0, -1),
            Mode(130.0, 22, 2.0),
            Mode(170.0, 22, 3.0, -1),
            Mode(215.0, 22, 2.0),
            Mode(260.0, 22, 1.0, -1),
        ),
        plate(0.45, 0.007),
        quality=20,
        bright_hz=900.0,
        half_width_m=0.3,
        seconds=0.4,
        seed=23,
        sources=(
            "air near 60 Hz and the first body mode near 100 Hz: A. Askenfelt, STL-QPSR 4/1982; A. W. Brown, thesis, "
            "Vienna 2004; the others and the quality are estimates"
        ),
        hills=(Hill(400.0, 1.2, 3.0),),
    ),
    "mandolin": Wood(
        "Mandolin",
        (
            Mode(205.0, 16, 4.0),
            Mode(300.0, 22, 4.0, -1),
            Mode(440.0, 26, 3.0),
            Mode(560.0, 28, 2.0, -1),
            Mode(690.0, 28, 2.0),
        ),
        plate(0.055, 0.0032),
        quality=28,
        bright_hz=4_500.0,
        half_width_m=0.13,
        seconds=0.22,
        seed=20,
        sources=("order of magnitude of D. Cohen, T. D. Rossing, Acoust. Sci. & Tech. 24 (2003) 1; levels estimated"),
        hills=(Hill(1_800.0, 1.2, 4.0),),
    ),
    "oud": Wood(
        "Oud",
        (
            Mode(110.0, 16, 5.0),
            Mode(182.0, 22, 4.0, -1),
            Mode(255.0, 25, 2.0),
            Mode(330.0, 28, 3.0, -1),
            Mode(420.0, 28, 1.0),
        ),
        plate(0.12, 0.0018),
        quality=30,
        bright_hz=3_500.0,
        half_width_m=0.18,
        seconds=0.3,
        seed=39,
        sources=(
            "soundboard of 1.5-2 mm with seven braces: S. Inanli, E. Altinsoy, DAGA 2018; frequencies estimated from "
            "bowl and holes, as in a guitar of the same air"
        ),
        hills=(Hill(1_600.0, 0.6, 5.0),),
    ),
    "koto": Wood(
        "Koto",
        (
            Mode(85.0, 15, 2.0),  # air
            Mode(100.0, 30, 2.0, -1),
            Mode(165.0, 35, 1.0),
            Mode(240.0, 38, 2.0, -1),
            Mode(330.0, 40, 2.0),
            Mode(420.0, 40, 2.0, -1),
        ),
        plate(0.42, 0.02, PAULOWNIA_M_S),
        quality=42,
        bright_hz=4_500.0,
        half_width_m=0.13,
        seconds=0.3,
        seed=31,
        sources=(
            "air mode at 85 Hz and first mode at 100 Hz: A. K. Coaldrake, J. Acoust. Soc. Am. 148 (2020), doi "
            "10.1121/10.0002427; a dense spectrum of wood and cavity above: C. Waltham, Y. Lan, E. Koster, of the "
            "qin, J. Acoust. Soc. Am. 139 (2016), doi 10.1121/1.4944874; the others are estimates"
        ),
        hills=(Hill(1_200.0, 0.8, 7.0),),
    ),
    "piano": Wood(
        "Piano soundboard",
        (Mode(55.0, 40, -3.0), Mode(82.0, 45, 0.0, -1), Mode(104.0, 45, 1.0), Mode(130.0, 48, 0.0, -1)),
        ((0.0, 0.05), (1_100.0, 0.05), (2_500.0, 0.01)),
        quality=50,
        bright_hz=4_500.0,
        half_width_m=0.6,
        seconds=0.8,
        seed=29,
        sources=(
            "0.05 modes a hertz up to 1.1 kHz, 0.01 above, where ribs confine waves; loss factor 2 %: K. Ege, X. "
            "Boutillon, arXiv 1212.3068 (2010); the four lowest are estimates"
        ),
        hills=(Hill(2_000.0, 0.5, 6.0),),
    ),
    "gourd": Wood(
        "Gourd with wooden face",
        (Mode(120.0, 14, 4.0), Mode(210.0, 18, 4.0, -1), Mode(330.0, 20, 2.0), Mode(450.0, 22, 2.0, -1)),
        plate(0.08, 0.004),
        quality=26,
        bright_hz=6_000.0,
        half_width_m=0.16,
        seconds=0.25,
        seed=38,
        sources=("estimate, of sitar and tanpura: a shell of 30-40 cm without a hole, a convex face of 4 mm"),
        hills=(Hill(1_800.0, 0.6, 5.0),),
    ),
    "ukulele": Wood(
        "Ukulele",
        (Mode(195.0, 16, 4.0), Mode(375.0, 22, 6.0, -1), Mode(470.0, 26, 1.0), Mode(640.0, 28, 3.0, -1)),
        plate(0.042, 0.0018),
        quality=28,
        bright_hz=4_500.0,
        half_width_m=0.1,
        seconds=0.22,
        seed=20,
        sources=("estimate: a guitar's modes, with the air of a concert ukulele"),
        hills=(Hill(1_800.0, 0.7, 5.0),),
    ),
    "dulcimer": Wood(
        "Hammered dulcimer",
        (Mode(75.0, 22, 0.0), Mode(110.0, 25, 2.0, -1), Mode(150.0, 28, 1.0), Mode(195.0, 30, 2.0, -1)),
        plate(0.36, 0.006),
        quality=34,
        bright_hz=6_000.0,
        half_width_m=0.3,
        seconds=0.35,
        seed=22,
        sources=(
            "estimate, of cimbalom, santur and clavichord: a trapezoid board of spruce of 6 mm over a closed box"
        ),
        hills=(Hill(2_500.0, 0.5, 8.0),),
    ),
}
