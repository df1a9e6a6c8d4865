"""A split's errors by how far its plucks raise the tension: which of them hold the error."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch

from engine.metrics import ErrorSums, RelativeError
from training.configuration import DatasetConfiguration
from training.data.dataset import draw_initial, split_rows

PARTS = (0.0, 0.5, 0.75, 0.9, 0.95, 1.0)  # of the trajectories, from the softest to the hardest


@dataclass(frozen=True)
class RiseErrors(RelativeError):
    """The errors of the trajectories between two rises of the tension.

    Attributes:
        trajectories: how many.
        from_rise, to_rise: ΔT/T₀ at the release.
        share: of the split's squared error that is theirs.
        largest: of the split's squared error, the share of the one among them that has most.
    """

    trajectories: int
    from_rise: float
    to_rise: float
    share: float
    largest: float


def errors_by_rise(sums: ErrorSums, configuration: DatasetConfiguration, split: str) -> list[RiseErrors]:
    """The errors of a split's trajectories, as far as `sums` has them, in groups of growing rise, none empty."""
    shares = sums.shares()
    initial = draw_initial(configuration)[split_rows(configuration.count, split)][: len(shares)]
    rise = configuration.resonator.relative_tension_rise(initial)
    order = torch.argsort(rise).tolist()
    edges = [round(part * len(order)) for part in PARTS]
    groups = [order[first:last] for first, last in pairwise(edges) if last > first]
    return [
        RiseErrors(
            **vars(sums.of(rows)),
            trajectories=len(rows),
            from_rise=float(rise[rows[0]]),
            to_rise=float(rise[rows[-1]]),
            share=float(shares[rows].sum()),
            largest=float(shares[rows].max()),
        )
        for rows in groups
    ]
