"""A string that moves in two directions across its length: normal to the soundboard, and along it.

Kirchhoff's and Carrier's tension acts on both alike, S = Σ η² (y² + z²) (C. E. Gough, "The nonlinear free vibration
of a damped elastic string", JASA 75, 1984). To a resonator they are modes of one shape, side by side, that share one
stretch: solvers and models need no other equation.

The bridge treats the directions differently. A conductance G at the end of a string adds T G/ℓ to its decay rates:
a round trip of 2ℓ/c leaves 1 - 2 Z G of a wave, with Z = T/c (Fletcher and Rossing, "The Physics of Musical
Instruments", section 2.12). Along the board it is stiffer: that motion rings longer, and two-stage decay follows
(G. Weinreich, "Coupled piano strings", JASA 62, 1977; J. Woodhouse, "A necessary condition for double-decay
envelopes in stringed instruments", JASA 150, 2021). Slightly different frequencies beat.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from engine.kernels.constants import HIGHEST_SIGMA, MOST_PAIRS
from engine.resonators.base import Array, Resonator
from engine.resonators.string import decay_rates, resonator_of, undamped_frequencies
from engine.values.string import Polarisations, StringParameters

PAIRS = MOST_PAIRS  # lowest partials that have two modes; an estimate: above them neither beats nor stages are heard


def polarised_resonator(
    moving: Polarisations,
    string: StringParameters,
    partials: int,
    *,
    losses: float = 1.0,
    tension_modulated: bool = True,
    grid_points: int = 101,
) -> Resonator:
    """The string's first partials: pairs of modes, then single ones.

    Args:
        losses: factor of the bridge's conductances.

    Raises:
        ValueError: the grid does not hold so many partials.
    """
    law = resonator_of(string, partials, tension_modulated=tension_modulated, grid_points=grid_points)
    partial, second = layout(partials)
    pulled, heard = (np.array(each)[second] for each in (moving.pulled, moving.heard))
    single = np.arange(len(partial)) >= 2 * min(PAIRS, partials)
    pulled = np.where(single, 1 / moving.heard[0], pulled)  # so that it is heard as the others are
    omega, sigma = _rates(moving, string, partials, losses)
    assert law.end_force is not None and law.mirror is not None and law.analysis is not None
    return Resonator(
        omega=omega,
        sigma=sigma,
        coupling=law.coupling[partial],
        stretch=law.stretch[partial],
        tension_rise=law.tension_rise,
        shapes=law.shapes[partial] * heard[:, None],
        analysis=law.analysis[:, partial] * pulled,
        mirror=law.mirror[partial],
        end_force=law.end_force[partial] * heard,
    )


def _rates(moving: Polarisations, string: StringParameters, partials: int, losses: float) -> tuple[Array, Array]:
    """ω and σ of the modes."""
    partial, second = layout(partials)
    omega = undamped_frequencies(string, partials)[partial]
    omega = np.where(second == 1, omega * math.sqrt(moving.detuning), omega)
    conductance = np.array([moving.conductance_s_kg, moving.second_conductance_s_kg])[second]
    added = losses * string.tension_n / string.length_m * conductance
    return omega, np.minimum(decay_rates(string, partials)[partial] + added, HIGHEST_SIGMA * omega)


def layout(partials: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The partial, from 0, and the direction, 0 or 1, of each mode."""
    mode, pairs = np.arange(partials + min(PAIRS, partials)), min(PAIRS, partials)
    paired = mode < 2 * pairs
    return np.where(paired, mode // 2, mode - pairs), np.where(paired, mode % 2, 0)


def partials_of(modes: int) -> int:
    """The number of partials of so many modes: the inverse of `layout`."""
    return modes - min(PAIRS, modes // 2)
