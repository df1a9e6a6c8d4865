"""The resonator of a string of two polarisations, of the rows that the player has."""

from __future__ import annotations

import numpy as np

from engine.kernels import strings
from engine.kernels.constants import MOST_PAIRS
from engine.resonators.base import Array, Resonator
from engine.resonators.polarised import Polarisations
from engine.resonators.string import StringParameters


def layout(partials: int) -> tuple[Array, Array]:
    """The partial, from 0, and the direction, 0 or 1, of each mode."""
    pairs = min(MOST_PAIRS, partials)
    modes = range(partials + pairs)
    found = ([strings.partial_of(mode, pairs) - 1, strings.direction_of(mode, pairs)] for mode in modes)
    partial, direction = np.array(list(found)).T
    return partial, direction


def polarised(
    moving: Polarisations,
    string: StringParameters,
    partials: int,
    *,
    decay: float = 1.0,
    losses: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tension_modulated: bool = True,
    grid_points: int = 101,
) -> Resonator:
    """Pairs of modes, then single ones; `decay`: of the bridge's conductances, `losses`: as of `strings.loss`."""
    law = string.resonator(partials, tension_modulated=tension_modulated, grid_points=grid_points)
    partial, direction = layout(partials)
    pairs, modes = min(MOST_PAIRS, partials), len(partial)
    conductances = decay * moving.conductance_s_kg, decay * moving.second_conductance_s_kg
    rows = np.empty(4 * modes)
    strings.rows(string.row, modes, pairs, moving.detuning, *conductances, *losses, rows)
    squares, sigma, coupling, stretch = rows.reshape(4, modes)
    pulled, heard = (np.array(each)[direction] for each in (moving.pulled, moving.heard))
    pulled[2 * pairs :] = 1 / moving.heard[0]  # so that it is heard as the others are
    assert law.end_force is not None and law.mirror is not None and law.analysis is not None
    return Resonator(
        omega=np.sqrt(squares),
        sigma=sigma,
        coupling=coupling if tension_modulated else np.zeros(modes),
        stretch=stretch,
        tension_rise=law.tension_rise,
        shapes=law.shapes[partial] * heard[:, None],
        analysis=law.analysis[:, partial] * pulled,
        mirror=law.mirror[partial],
        end_force=law.end_force[partial] * heard,
    )
