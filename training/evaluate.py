"""The errors of a model on a split of a data set: as in the paper's tables, past the horizon, and mode by mode.

Every motion is streamed, some trajectories and some frames at a time: ten seconds of a split would not fit in memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor

from engine.compare.partials import (
    PartialErrors,
    PartialTrack,
    partial_errors,
    segment_frames,
    track_partials,
    true_phasors,
)
from engine.compare.relative import ErrorSums, RelativeError
from engine.compare.spectra import spectral_distances
from engine.models.base import KoopmanModel, StringModel
from engine.pluck import DEFAULT_LISTEN
from engine.resonators.sine_transform import listening_weights
from engine.truth import ModalState, SplittingSolver
from training.configuration import DatasetConfiguration
from training.data.dataset import Dataset, draw_initial, split_rows

TRAJECTORIES_AT_ONCE = 10
FRAMES_AT_ONCE = 1000
ALL = slice(None)
RISE_PARTS = (0.0, 0.5, 0.75, 0.9, 0.95, 1.0)  # of the trajectories, from the softest to the hardest

Windows = Sequence[tuple[float, float]]  # (start, stop) of each, in s


@torch.no_grad()
def evaluate_model(model: StringModel[Any], dataset: Dataset, split: str, steps: int | None = None) -> ErrorSums:
    """Error sums of the kept ones of frames 1 … steps (default: all) over every trajectory of the split."""
    c = dataset.configuration
    kept = (steps or c.steps) // c.stride
    device = next(model.parameters()).device
    synthesis = dataset.synthesis.float().to(device)
    sums = ErrorSums(kept)
    with _in_evaluation(model):
        for amplitudes in dataset.split(split).split(TRAJECTORIES_AT_ONCE):
            truth = amplitudes[:, : kept + 1].to(device) @ synthesis
            sums.add(_predicted(model, truth[:, 0], kept, c.stride), truth[:, 1:])
    return sums


def _predicted(model: StringModel[Any], initial: Tensor, kept: int, stride: int) -> Tensor:
    """The prediction at frames stride, 2 stride, …, `kept` in all: (batch, kept, grid_points) in normalised units."""
    if stride > 1 and isinstance(model, KoopmanModel):
        frames = stride * torch.arange(1, kept + 1, device=initial.device)
        return model.decode(model.latents(model.encode(initial).origin, frames))
    return model(initial, kept * stride)[:, stride - 1 :: stride]


def figures(error: RelativeError, form: str = "{}") -> dict[str, float]:
    """The errors by name; in `form`, {} stands for rel_mse and rel_mae."""
    return {form.format("rel_mse"): error.rel_mse, form.format("rel_mae"): error.rel_mae}


@dataclass(frozen=True)
class MotionErrors:
    """The errors of a split's motions, an infinite one where the model's output is not finite.

    Attributes:
        string: over the whole string, as in the tables.
        sound: at the listening point; its `null_depth_db` is what subtraction leaves of the sound.
        spectra: of the sound, one for each window that was asked for.
    """

    string: ErrorSums
    sound: ErrorSums
    spectra: list[SpectralDistance]


@dataclass(frozen=True)
class SpectralDistance:
    """See `engine.compare.spectra`; means over the trajectories."""

    convergence: float
    log_db: float


@torch.inference_mode()
def evaluate_past_horizon(
    model: StringModel[Any],
    dataset: Dataset,
    split: str,
    seconds: float,
    *,
    horizon: int | None = None,
    windows_s: Windows = (),
    trajectories: slice = ALL,
    frames_at_once: int = FRAMES_AT_ONCE,
    report: Callable[[float], None] = lambda share: None,
) -> MotionErrors:
    """The errors of the frames 1 … horizon and of `seconds` more.

    The truth is the data set's where that reaches so far; else it is simulated from the same initial displacements.

    Args:
        horizon: in frames; None is all of the data's.
        windows_s: of the spectral distances; none may be empty.
        trajectories: of the split.
        frames_at_once: of a block; the result does not depend on it.
        report: receives the share that is done.
    """
    c = dataset.configuration
    steps = (c.steps if horizon is None else horizon) + round(seconds * c.rate_hz)
    device = next(model.parameters()).device
    synthesis = dataset.synthesis
    # (grid_points, 1): from displacement to that at the listening point
    ear = torch.from_numpy(listening_weights(np.array([DEFAULT_LISTEN]), c.grid_points)).float()
    spans = [slice(*(min(round(edge * c.rate_hz), steps) for edge in window)) for window in windows_s]
    edges = [edge for span in spans for edge in (span.start, span.stop)]
    string = ErrorSums(steps, edges)
    sound = ErrorSums(steps)
    distances = []
    parts = _parts(c, split, trajectories)
    with _in_evaluation(model):
        for part, rows in enumerate(parts):
            sounds = torch.empty(2, rows.stop - rows.start, steps + 1)
            initial, blocks = _true_motion(dataset, rows, steps, frames_at_once)
            start, first = (initial @ synthesis).float(), 0
            state, sounds[..., 0] = model.encode(start.to(device)), (start @ ear)[:, 0]
            for amplitudes in blocks:
                last = first + amplitudes.shape[1]
                predicted, state = model.advance(state, last - first)
                predicted, truth = predicted.float().cpu(), (amplitudes @ synthesis).float()
                string.add(predicted, truth, first)
                at_ear = torch.stack([predicted @ ear, truth @ ear])
                sound.add(at_ear[0], at_ear[1], first)
                sounds[..., first + 1 : last + 1] = at_ear[..., 0]
                first = last
                report((part + first / steps) / len(parts))
            distances.append([spectral_distances(*sounds[..., 1:][..., span].numpy()) for span in spans])
    spectra = []
    for of_window in zip(*distances, strict=True):
        means = (float(np.concatenate(values).mean()) for values in zip(*of_window, strict=True))
        spectra.append(SpectralDistance(*means))
    return MotionErrors(string, sound, spectra)


@torch.inference_mode()
def evaluate_partials(
    model: StringModel[Any],
    dataset: Dataset,
    split: str,
    windows_s: Windows,
    *,
    trajectories: slice = ALL,
    frames_at_once: int = FRAMES_AT_ONCE,
    report: Callable[[float], None] = lambda share: None,
) -> PartialErrors:
    """The errors of the partials in windows of time, which may lie past the horizon; the other arguments as above.

    Raises:
        ValueError: there are no windows.
    """
    if not windows_s:
        raise ValueError("windows_s must hold at least one window")
    c = dataset.configuration
    device = next(model.parameters()).device
    synthesis = dataset.synthesis.numpy()
    analysis = torch.from_numpy(c.resonator.analysis).float().to(device)
    linear_hz = (c.resonator.eigenvalues().imag / (2 * math.pi)).tolist()
    length = segment_frames(c.rate_hz, linear_hz[0])
    block = max(1, frames_at_once // length) * length
    steps = max(round(stop_s * c.rate_hz) for _, stop_s in windows_s)
    initial, errors = draw_initial(c), []
    parts = _parts(c, split, trajectories)
    with _in_evaluation(model):
        for part, rows in enumerate(parts):
            state, tracks = model.encode(torch.from_numpy(initial[rows] @ synthesis).float().to(device)), []
            true = true_phasors(c.resonator, initial[rows], c.rate_hz, steps, block, substeps=c.substeps)
            for first, truth in zip(range(0, steps, block), true, strict=True):
                predicted, state = model.advance(state, truth.shape[1], analysis)
                tracks.append(track_partials(predicted.cpu().numpy() * np.float32(dataset.scale_m), truth, length))
                report((part + (first + truth.shape[1]) / steps) / len(parts))
            errors.append(partial_errors(PartialTrack.join(tracks), c.rate_hz, linear_hz, windows_s))
    return PartialErrors.join(errors)


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
    order = np.argsort(rise, kind="stable").tolist()
    edges = [round(part * len(order)) for part in RISE_PARTS]
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


@contextmanager
def _in_evaluation(model: StringModel[Any]) -> Iterator[None]:
    """Keep a model in its evaluation mode within the block, and give it its own mode back."""
    was_training = model.training
    model.eval()
    try:
        yield
    finally:
        model.train(was_training)


def held_out(configuration: DatasetConfiguration, scale_m: float, count: int, seed: int) -> Dataset:
    """`count` fresh trajectories of the same draw, the split "all"; simulated when they are asked for.

    Raises:
        ValueError: the seed is the data set's own, or there are less than 10.
    """
    if seed == configuration.seed:
        raise ValueError(f"seed {seed} is the data set's own: its plucks were trained on; take another")
    return Dataset(replace(configuration, count=count, seed=seed), torch.empty(0), scale_m)


def _parts(c: DatasetConfiguration, split: str, trajectories: slice) -> list[slice]:
    """The rows of a split's chosen trajectories in the data set, at most `TRAJECTORIES_AT_ONCE` in each slice."""
    rows = range(c.count)[split_rows(c.count, split)][trajectories]
    return [slice(first, min(first + TRAJECTORIES_AT_ONCE, rows.stop)) for first in rows[::TRAJECTORIES_AT_ONCE]]


def _true_motion(dataset: Dataset, rows: slice, steps: int, block: int) -> tuple[Tensor, Iterator[Tensor]]:
    """Modal amplitudes in m, float64: of frame 0, (rows, modes), and of blocks of frames, (rows, frames, modes).

    Blocks begin with frame 1 and end with frame `steps`; each has `block` frames, the last one perhaps fewer.
    """
    c = dataset.configuration
    if len(dataset.amplitudes) and steps <= c.steps and c.stride == 1:
        stored = dataset.amplitudes[rows, : steps + 1]
        return stored[:, 0].double(), (frames.double() for frames in stored[:, 1:].split(block, dim=1))
    initial = torch.from_numpy(draw_initial(c)[rows])
    return initial, _simulated(c, initial, steps, block)


def _simulated(c: DatasetConfiguration, initial: Tensor, steps: int, block: int) -> Iterator[Tensor]:
    """The blocks of `_true_motion` by the solver, from amplitudes (rows, modes) at rest."""
    solver, state = SplittingSolver(c.resonator, c.rate_hz, substeps=c.substeps), ModalState.at_rest(initial)
    for first in range(0, steps, block):
        frames, state = solver.advance(state, min(block, steps - first))
        yield frames
