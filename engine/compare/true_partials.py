"""The true motion mode by mode, as the phasors that `engine.compare.partials` compares a prediction with."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.compare.partials import Array, Phasors, phasors
from engine.resonators.base import Resonator
from engine.truth import ModalState, SplittingSolver

OVERSAMPLING = 4  # of the truth whose phasors are wanted


def true_phasors(
    resonator: Resonator,
    initial: Array,
    rate_hz: float,
    steps: int,
    block: int,
    *,
    substeps: int | None = None,
) -> Iterator[Phasors]:
    """Phasors of frames 1 … steps in m, complex128 (batch, up to `block`, modes).

    Args:
        initial: modal amplitudes at rest in m, (batch, modes).
        substeps: of the solver in a frame; None is its default.
    """
    sample_hz = OVERSAMPLING * rate_hz
    fewer = None if substeps is None else -(-substeps // OVERSAMPLING)
    solver = SplittingSolver(resonator, sample_hz, substeps=fewer)
    state = ModalState.at_rest(initial)
    for first in range(0, steps, block):
        samples, state = solver.advance(state, OVERSAMPLING * min(block, steps - first))
        beyond, _ = solver.advance(state, 1)
        every = np.concatenate([samples, beyond], axis=1)
        before, now, after = (every[:, OVERSAMPLING - 1 + offset :: OVERSAMPLING] for offset in (-1, 0, 1))
        count = now.shape[1]
        yield phasors(before[:, :count], now, after, 1 / sample_hz, resonator)
