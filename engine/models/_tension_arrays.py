"""The arrays of a `koopman_tension` file, in NumPy: a preset of many strings is read and played without torch."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from engine.models.configurations import KoopmanTensionConfiguration
from engine.resonators.base import Array, Resonator

SAME_RESONATOR = 1e-9  # relative: processors round logarithms and sines differently
SLOWEST_LOG = -24.0  # ν_log of a mode without losses: after a minute at 48 kHz it is 0.001 dB down
CURVES = ("A", "r", "p")  # what is learned; the rest follows from the resonator


def shapes_of_arrays(c: KoopmanTensionConfiguration) -> dict[str, tuple[int, ...]]:
    """The shape of each float64 array, by name."""
    modes = (c.modes,)
    return {
        **dict.fromkeys(CURVES, (c.degree + 1,)),
        **dict.fromkeys(("nu_log", "theta_log", "coupling", "stretch"), modes),
        "shapes": (c.modes, c.grid_points),
        "analysis": (c.grid_points, c.modes),
    }


def resonator_arrays(
    c: KoopmanTensionConfiguration, resonator: Resonator, rate_hz: float, scale_m: float
) -> dict[str, Array]:
    """The arrays of a resonator, its modes first; latents to spare rest: no shape, and no share in the tension.

    Raises:
        ValueError: it has more modes than the model, or another grid.
    """
    n = resonator.modes
    if n > c.modes or resonator.points != c.grid_points:
        raise ValueError(
            f"model_configuration.modes is {c.modes} on {c.grid_points} points, the resonator has {n} modes on "
            f"{resonator.points}"
        )
    spare = ((0, c.modes - n),)
    analysis = np.zeros((resonator.points, n)) if resonator.analysis is None else resonator.analysis
    eigenvalues = np.pad(resonator.eigenvalues() / rate_hz, spare, "edge")
    with np.errstate(divide="ignore"):  # without losses
        nu_log = np.maximum(np.log(-eigenvalues.real), SLOWEST_LOG)
    return {
        "nu_log": nu_log,
        "theta_log": np.log(eigenvalues.imag),
        "coupling": np.pad(resonator.coupling / rate_hz**2, spare),
        "stretch": np.pad(resonator.stretch * scale_m**2, spare),
        "shapes": np.pad(resonator.shapes, (*spare, (0, 0))),
        "analysis": np.pad(analysis, ((0, 0), *spare)),
    }


def check_resonator(arrays: Mapping[str, Array], expected: Mapping[str, Array]) -> None:
    """Raise ValueError, naming the array, where one is of another resonator than expected."""
    for name, array in expected.items():
        atol = 1e-3 * SAME_RESONATOR * float(np.abs(array).max())
        if not np.allclose(arrays[name], array, rtol=SAME_RESONATOR, atol=atol):
            raise ValueError(f"tensor {name!r} is of another string, or of other modes, rate_hz or scale_m")
