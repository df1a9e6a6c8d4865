"""The error of a model over position and amplitude of the pluck, on grids from coarse to fine.

The grid of each level contains the one before, so that nothing is computed twice. A computation that was cancelled
continues where it stopped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.shared.worker import Job
from engine.bounds import LARGEST_AMPLITUDE_MM, POSITION_RANGE
from engine.compare.relative import ErrorSums
from engine.pluck import Pluck
from engine.presets import Preset
from engine.resonators.sine_transform import project
from engine.sources import TruthSource, array_model

SMALLEST_AMPLITUDE_MM = 0.5
STRIDES = (16, 8, 4, 2, 1)  # of the finest grid, level by level
FINEST = (49, 33)  # positions, amplitudes: each a multiple of the coarsest stride plus one
PLUCKS_AT_ONCE = 4  # computed together, as one batch
FRAMES_AT_ONCE = 1000  # of a batch, between two looks at whether the job is cancelled
SUBSTEP_DIVISOR = (
    4  # the truth takes a quarter of its default sub-steps: an error of 1e-5, far below any that is shown
)

POSITIONS = np.linspace(*POSITION_RANGE, FINEST[0])
AMPLITUDES_MM = np.geomspace(SMALLEST_AMPLITUDE_MM, LARGEST_AMPLITUDE_MM, FINEST[1])

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlanePicture:
    """The picture of a plane, as far as it can be shown.

    Attributes:
        error: relative MAE over the trained horizon, (positions, amplitudes) of the finest grid. Its logarithm is
            interpolated between the points of the finest complete level.
        spacing: between the points of that level, in steps of the finest grid.
    """

    error: Array
    spacing: int

    def at(self, position: float, amplitude_mm: float) -> float:
        """The error at the grid's point nearest to a pluck."""
        return float(self.error[nearest_cell(position, amplitude_mm)])


def nearest_cell(position: float, amplitude_mm: float) -> tuple[int, int]:
    """Indices of the finest grid's point nearest to a pluck; the pluck may lie outside the grid."""
    amplitude_log = math.log(max(amplitude_mm, 1e-6))
    return int(np.abs(POSITIONS - position).argmin()), int(np.abs(np.log(AMPLITUDES_MM) - amplitude_log).argmin())


@dataclass
class ErrorPlane:
    """The errors known so far, NaN elsewhere. One thread calls `compute`, and hands out copies (`picture`)."""

    error: Array = field(default_factory=lambda: np.full(FINEST, math.nan))

    @property
    def spacing(self) -> int | None:
        """The stride of the finest complete level; None before the coarsest is complete."""
        whole = [stride for stride in STRIDES if not np.isnan(self.error[::stride, ::stride]).any()]
        return whole[-1] if whole else None

    def picture(self) -> PlanePicture | None:
        """The picture so far; None before the coarsest level is complete."""
        spacing = self.spacing
        if spacing is None:
            return None
        fine_errors = np.exp(refine(np.log(np.maximum(self.error[::spacing, ::spacing], 1e-9)), spacing))
        return PlanePicture(fine_errors, spacing)

    @property
    def _share(self) -> float:
        """The share of the finest grid's points that are known, 0 … 1."""
        return float((~np.isnan(self.error)).mean())

    def compute(self, preset: Preset, pluck: Pluck, job: Job) -> PlanePicture:
        """Compute what is not known yet, of plucks with the shape and width of `pluck`.

        Raises:
            Cancelled: the job was cancelled; what is known stays.
            ValueError: the model cannot start from a displaced string at rest alone.
        """
        errors = error_of_plucks(preset)
        spacing = self.spacing
        if spacing is not None:
            job.report(self._share, so_far=self.picture())
        for places in self._missing():
            plucks = [pluck.moved(position=POSITIONS[x], amplitude_mm=AMPLITUDES_MM[y]) for x, y in places]
            for place, error in zip(places, errors(plucks, job), strict=True):
                self.error[place] = error
            is_finer, spacing = self.spacing != spacing, self.spacing
            job.report(self._share, so_far=self.picture() if is_finer else None)
        picture = self.picture()
        assert picture is not None
        return picture

    def _missing(self) -> Iterator[list[tuple[int, int]]]:
        """Points that are not known, in the order of computing, `PLUCKS_AT_ONCE` at a time."""
        for stride in STRIDES:
            rows, columns = np.nonzero(np.isnan(self.error[::stride, ::stride]))
            places = [(int(x) * stride, int(y) * stride) for x, y in zip(rows, columns, strict=True)]
            for first in range(0, len(places), PLUCKS_AT_ONCE):
                yield places[first : first + PLUCKS_AT_ONCE]


def error_of_plucks(preset: Preset) -> Callable[[list[Pluck], Job], Array]:
    """A function of plucks and a job: relative MAEs (plucks,) over the trained horizon, infinite where not finite."""
    from engine.truth import default_substeps

    info, model = preset.info, array_model(preset)
    truth = TruthSource(info, -(-default_substeps(info.resonator, info.rate_hz) // SUBSTEP_DIVISOR))

    def errors(plucks: list[Pluck], job: Job) -> Array:
        """Relative MAEs (plucks,) of the model; the job's cancelling ends it."""
        # (plucks, grid_points) in m
        initial = project(np.stack([pluck.displacement(info.grid_points) for pluck in plucks]), info.modes)
        state = model.encode((initial / info.scale_m).astype(np.float32))
        true_state = truth.start(initial)
        sums, first = ErrorSums(info.horizon_steps), 0  # first: frames done
        while first < info.horizon_steps:
            steps = min(FRAMES_AT_ONCE, info.horizon_steps - first)
            predicted, state = model.advance(state, steps)
            true, true_state = truth.advance(true_state, steps)
            sums.add(predicted * info.scale_m, true, first)
            first += steps
            job.check()
        return sums.per_trajectory()[1]

    return errors


def refine(coarse: Array, factor: int) -> Array:
    """Bilinear interpolation of `coarse` (m, n) to ((m - 1) factor + 1, (n - 1) factor + 1) points."""
    fine = coarse
    for axis in (0, 1):
        rows = np.moveaxis(fine, axis, 0)
        places = np.arange((len(rows) - 1) * factor + 1) / factor  # of the fine points, in coarse steps
        before = np.minimum(places.astype(int), max(len(rows) - 2, 0))  # coarse point below each of them
        share = (places - before)[:, None]  # of the coarse point above
        after = np.minimum(before + 1, len(rows) - 1)
        # ∞ · 0 is not a number: beside an infinite error a known point keeps its own value
        with np.errstate(invalid="ignore"):
            mixed = rows[before] * (1 - share) + rows[after] * share
        fine = np.moveaxis(
            np.where(np.isnan(mixed), np.where(share < 0.5, rows[before], rows[after]), mixed), 0, axis
        )
    return fine
