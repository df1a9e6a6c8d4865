"""True motions of the family's strings."""

from __future__ import annotations

from torch import Tensor

from engine.resonators.base import Resonator
from engine.truth import ModalState, SplittingSolver, default_substeps
from training.family.strings import PluckedString

SUBSTEP_DIVISOR = (
    3  # times fewer sub-steps than a data set has: 1e-12 of the energy off after a second, inside the family
)


def solve(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """Modal amplitudes of the frames 1 … steps in m, float64 (steps, modes)."""
    solver = SplittingSolver(plucked.resonator, rate_hz, substeps=substeps_of(plucked.resonator, rate_hz))
    return solver.advance(ModalState.at_rest(plucked.amplitudes_m[None]), steps)[0][0]


def substeps_of(resonator: Resonator, rate_hz: int) -> int:
    """The number of sub-steps of the true motion in a frame."""
    return max(1, -(-default_substeps(resonator, rate_hz) // SUBSTEP_DIVISOR))
