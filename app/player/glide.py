"""Pitch glide: by how many cents a key starts above its resting pitch, in closed form.

A pluck stretches the string, which raises its tension. Over a period of each mode, q_n² averages to half its peak and
q_n³ to three quarters of it. The first partial is raised to

    ω² = ω₁² + k₁ (Σ_m η_m² q_m² / 2 + η₁² q₁² / 4),

with the symbols of `engine.resonators.base`. Each q_m² decays by exp(-2σ_m t). Its mean over the first START_S counts
here, as high modes of short strings die away before a pitch is heard. The glide grows with amplitude squared.
"""

from __future__ import annotations

import contextlib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.instruments.drums import Drums
from app.instruments.fields import HIGHEST_KEY
from app.instruments.instrument import VELOCITIES, Instrument
from app.player.drum_keys import DrumKeys
from app.player.strings import MOST_MODES, KeyString, Strings, decay_rates
from engine.bounds import LARGEST_AMPLITUDE_MM
from engine.excitation import blow_factor
from engine.resonators.sine_transform import analysis_matrix
from engine.resonators.string import tension_coupling, undamped_frequencies, wavenumbers
from engine.values.ear import Ear

START_S = 0.1  # of a note, over which its pitch is averaged
GRID_POINTS = 101


@lru_cache(maxsize=8)
def glides_cents(instrument: Instrument) -> NDArray[np.float64]:
    """The glides of an instrument in cents by key and velocity, (128, 128); velocity 0 as 1. Read-only.

    A key that is silent or has no possible string is a row of NaN.

    Raises:
        ValueError: the tuning is impossible.
    """
    if isinstance(instrument.strings, Drums):
        return _drum_glides(instrument)
    strings = Strings(instrument)
    plucks = [instrument.pluck.pluck(velocity) for velocity in range(VELOCITIES[1] + 1)]
    amplitudes_mm = np.array([pluck.amplitude_mm for pluck in plucks])
    shapes_m = np.stack([pluck.displacement(GRID_POINTS) for pluck in plucks])  # (velocities, grid points)
    modal_m = shapes_m @ analysis_matrix(GRID_POINTS, MOST_MODES)  # (velocities, modes)
    # by velocity: factor from a pluck's amplitudes to a blow's
    blows = [blow_factor(np.ones(1), shape) for shape in shapes_m / (amplitudes_mm[:, None] / 1000)]
    glides = np.full((HIGHEST_KEY + 1, len(plucks)), np.nan)
    low, high = instrument.range
    for key in range(low, high + 1):
        try:
            string = strings.of_key(key)
        except ValueError:
            continue
        if string is not None:
            pulled = np.minimum(string.shortened, LARGEST_AMPLITUDE_MM / amplitudes_mm)  # factors, (velocities,)
            sets_out_m = modal_m[:, : string.modes] * pulled[:, None]
            if instrument.pluck.is_blow:
                omega = undamped_frequencies(string.parameters, string.modes)
                sets_out_m = sets_out_m * np.stack(blows) * (omega[0] / omega)
            glides[key] = _string_glides(instrument, string, sets_out_m)
    glides.setflags(write=False)
    return glides


def _drum_glides(instrument: Instrument) -> NDArray[np.float64]:
    """Compute the glides as `glides_cents`, by the mean tension of a blow's first swing."""
    keys = DrumKeys(instrument, Ear(tuple(instrument.pickup.points)))
    glides = np.full((HIGHEST_KEY + 1, VELOCITIES[1] + 1), np.nan)
    (low, high), curve = instrument.range, instrument.pluck.curve
    for key in range(low, high + 1):
        with contextlib.suppress(ValueError):
            if (drum := keys.of_key(key)) is not None:
                glides[key] = [drum.drop_cents(velocity, curve) for velocity in range(len(glides[key]))]
    glides.setflags(write=False)
    return glides


def _string_glides(instrument: Instrument, string: KeyString, modal_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """The glides (plucks,) of plucks with these modal amplitudes, (plucks, at least the string's modes)."""
    parameters, modes = string.parameters, string.modes
    decayed = 2 * START_S * decay_rates(instrument, parameters, modes)
    decayed = np.maximum(decayed, 1e-9)  # a string may be without damping
    squares = (modal_m[:, :modes] * wavenumbers(parameters, modes)) ** 2 * (-np.expm1(-decayed) / decayed)
    coupling = float(tension_coupling(parameters, 1)[0]) / parameters.undamped_frequency(1) ** 2
    return np.asarray(600 * np.log2(1 + coupling * (squares.sum(1) / 2 + squares[:, 0] / 4)))
