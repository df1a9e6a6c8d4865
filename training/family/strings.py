"""The family: strings with random pitch, inharmonicity and damping, each with a random pluck.

A string's motion depends on three numbers of its own (inharmonicity B, two damping rates) and on its pluck's
shape and relative rise of tension; pitch, length, density and tension rescale it exactly. So the ranges are those
of audible properties, and strings of one length and density stand for all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import torch
from torch import Tensor

from engine.excitation import displacement
from engine.pluck import Shape
from engine.resonators.family import BRIGHT_HZ, StringFamily
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from training.family.motion import Released, true_motion

Column = Literal["inside", "beyond"]
COLUMNS: tuple[Column, ...] = get_args(Column)
SPLITS = ("train", "validation", "test")
DRAWN_SHAPES: tuple[Shape, ...] = ("triangular", "raised_cosine", "gaussian")
FAMILY_VERSION = 1  # of the draws: with another one the same seed and number give another string
HIGHEST_HZ = 20_000.0  # of a mode
MOST_MODES = 99
GRID_POINTS = 101
# of every string: they change nothing but units
LENGTH_M = 0.65
MASS_KG_M = 5e-4
AREA_M2 = 5e-7
MODULUS_PA = 2e10


# pitch in Hz, inharmonicity B, decay by 60 dB of the first mode and of that near 3 kHz in s, rise of tension ΔT/T₀
FAMILY: dict[Column, StringFamily] = {
    "inside": StringFamily(((55, 880),), ((1e-5, 1e-3),), (1, 20), (0.1, 1), (0.02, 0.5)),
    "beyond": StringFamily(((30, 55), (880, 1500)), ((2e-6, 1e-5), (1e-3, 3e-3)), (1, 40), (0.1, 1), (0.1, 0.8)),
}


@dataclass(frozen=True, eq=False)
class PluckedString(Released):
    """A string with all its modes below 20 kHz, and a pluck of it."""

    string: StringParameters


def draw_string(column: Column, split: str, number: int, seed: int = 0) -> PluckedString:
    """The string of a number in a column and split, with its pluck; always the same, however many are drawn."""
    entropy = (FAMILY_VERSION, seed, COLUMNS.index(column), SPLITS.index(split), number)
    return draw_from(FAMILY[column], np.random.default_rng(entropy))


def draw_from(ranges: StringFamily, random: np.random.Generator, shape: Shape | None = None) -> PluckedString:
    """A random string and a pluck of it within ranges; `shape`: of the pluck, None: drawn."""
    while True:
        pitch_hz, inharmonicity = (_either(random, r) for r in (ranges.pitch_hz, ranges.inharmonicity))
        t60_s, bright_t60_s = log_uniform(random, ranges.t60_s), log_uniform(random, ranges.bright_t60_s)
        if bright_t60_s < t60_s:
            break
    string = string_of(pitch_hz, inharmonicity, t60_s, bright_t60_s)
    resonator = resonator_of(string, min(MOST_MODES, string.modes_below(HIGHEST_HZ)), grid_points=GRID_POINTS)
    drawn, place = DRAWN_SHAPES[int(random.integers(3))], float(random.uniform(*ranges.position))
    half_width, rise = log_uniform(random, ranges.half_width), log_uniform(random, ranges.tension_rise)
    shape = shape or drawn
    width = 2 * half_width if shape == "raised_cosine" else half_width
    # a peak of 1 mm first, then scaled to the rise of tension that was drawn
    amplitudes = resonator.to_modes(displacement(shape, place, width, 1e-3, GRID_POINTS))
    amplitudes = amplitudes * np.sqrt(rise / resonator.relative_tension_rise(amplitudes))
    at_rest, even = np.zeros_like(amplitudes), np.ones_like(amplitudes)  # sines are orthogonal, and of one size
    return PluckedString(resonator, amplitudes, at_rest, even, rise, string)


def string_of(pitch_hz: float, inharmonicity: float, t60_s: float, bright_t60_s: float) -> StringParameters:
    """A string that sounds so: quiet pitch and decay of its first mode, B, and the decay of the mode nearest 3 kHz.

    Where even a first mode without any damping of its own would decay faster than `t60_s`, it decays so.
    """
    # decay rates σ in 1/s: mode n has constant + of_squares · n²
    slow, fast = math.log(1000) / t60_s, math.log(1000) / bright_t60_s
    bright = max(2, round(BRIGHT_HZ / pitch_hz))  # number of the mode near BRIGHT_HZ
    of_squares = min((fast - slow) / (bright**2 - 1), fast / bright**2)
    constant = max(0.0, slow - of_squares)
    eta = math.pi / LENGTH_M
    omega = math.hypot(2 * math.pi * pitch_hz, constant + of_squares)
    tension_n = omega**2 * MASS_KG_M / eta**2 / (1 + inharmonicity)
    return StringParameters(
        length_m=LENGTH_M,
        area_m2=AREA_M2,
        second_moment_m4=inharmonicity * tension_n / (MODULUS_PA * eta**2),
        density_kg_m3=MASS_KG_M / AREA_M2,
        youngs_modulus_pa=MODULUS_PA,
        damping_d1_kg_m_s=2 * MASS_KG_M * constant,
        damping_d3_kg_m_s=2 * MASS_KG_M * of_squares / eta**2,
        tension_n=tension_n,
    )


def solve(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """The true motion: modal amplitudes of the frames 1 … steps in m, float64 (steps, modes)."""
    return true_motion(plucked, rate_hz)(steps)


def displacement_m(plucked: PluckedString) -> Tensor:
    """The displacement at its release in m, float64 (grid_points,)."""
    return torch.from_numpy(plucked.resonator.to_grid(plucked.amplitudes_m))


def log_uniform(random: np.random.Generator, bounds: tuple[float, float]) -> float:
    """A draw between bounds above 0 that is uniform in the logarithm."""
    return math.exp(random.uniform(math.log(bounds[0]), math.log(bounds[1])))


def _either(random: np.random.Generator, bounds: tuple[tuple[float, float], ...]) -> float:
    """A draw by `log_uniform` from one of several ranges, each as likely."""
    return log_uniform(random, bounds[int(random.integers(len(bounds)))])
