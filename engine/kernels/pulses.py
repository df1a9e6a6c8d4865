"""The laws of plucks and blows: their shapes on a string and their force over time.

Plain functions for Python and compiled code, as `engine.kernels.strings`; a `Number` may be an array in Python.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

Number = TypeVar("Number", float, np.ndarray)


def gaussian(distance: Number) -> Number:
    """The height at a distance from the middle, in widths: exp(-d²)."""
    return np.exp(-distance * distance)


def raised_cosine(distance: Number) -> Number:
    """The height at a distance from the middle, in full widths: (1 + cos 2πd)/2 within half a width."""
    return (abs(distance) < 0.5) * (1 + np.cos(2 * math.pi * distance)) / 2


def triangle(x: Number, position: float) -> Number:
    """The height at a place of a string that is pulled to a point."""
    return np.minimum(x / position, (1 - x) / (1 - position))


def spectrum(turns: Number) -> Number:
    """The Fourier transform of a raised cosine of area 1, at so many turns in its width, about its middle.

    It is sinc(t) / (1 - t²), and 1/2 at t = 1. Fingers, hammers and mallets push so: along the string, and in time. A
    force that falls so in a time leaves this share of a mode that turns so often meanwhile: as if it had been
    released at once in the middle of that time: a slow release is mellow. (Released by a finger in milliseconds:
    D. Chadefaux et al., "Experimentally based description of harp plucking", JASA 131, 2012.) A blow gives the mode
    this share of the speed of a sudden one.
    """
    near = abs(turns - 1) < 1e-6
    away = turns + near + (turns == 0) * 1e-300  # so that nothing is divided by 0
    return 0.5 * near + (1 - near) * np.sin(math.pi * away) / (math.pi * away * (1 - away * away))


def corner(mode: Number, position: float, width: float) -> Number:
    """The amplitude of a mode of a rounded triangle, up to a factor: of a triangle, times its force's spectrum."""
    return np.sin(math.pi * mode * position) / (mode * mode) * spectrum(mode * width / 2)
