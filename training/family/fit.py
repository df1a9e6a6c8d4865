"""The curves of `koopman_tension` from the motions of many strings: Gauss and Newton with Levenberg's damping.

There are a dozen numbers, and each string's error is close to quadratic in them. A step by least squares
does what a thousand steps along a gradient do. The loss is the mean logarithm of each string's relative error: a
string on which it is 1e-9 counts as much as one on which it is 1e-3. Its Gauss–Newton matrix is that of the residuals
divided by the present errors. Derivatives by the curves' numbers are differences, which the smooth motion allows.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from engine.compare.relative import error_to_signal
from engine.models.base import Physics
from engine.models.koopman_tension import KoopmanTension
from training.family.strings import PluckedString, displacement_m

DIFFERENCE = 1e-4  # of a curve's number, for a derivative
FLOOR = 1e-13  # is added to each relative error: smaller ones count no more
FRAMES = 256  # of a string that enter the matrix, drawn again for each step
DAMPINGS = (0.01, 0.1, 1.0, 10.0, 100.0)  # tried in each step, times the damping that was best in the last


@dataclass(frozen=True)
class FitCase:
    """A string and its true motion, (steps, modes) in m."""

    plucked: PluckedString
    truth: Tensor


@torch.no_grad()
def fit_curves(
    model: KoopmanTension,
    train: Sequence[FitCase],
    validation: Sequence[FitCase],
    rate_hz: int,
    *,
    steps: int,
    first_frames: int,
    seed: int,
    report: Callable[[float, str, float], None] = lambda share, text, left_s: None,
) -> float:
    """Set the model's curves in place to those that are best on validation.

    Args:
        steps: of Gauss and Newton.
        first_frames: in reach of the first step; they grow to all within the first half of the steps.
        seed: of the frames that enter each step's matrix.
        report: receives the share that is done, 0 … 1, what was reached in words, and the seconds left.

    Returns:
        The geometric mean of the strings' relative squared errors on validation.
    """
    generator = torch.Generator().manual_seed(seed)
    longest = len(train[0].truth)
    size = len(model.A)  # numbers of each of the curves A, r, p
    best, present = geometric_mean(errors(model, validation, rate_hz, longest)), _numbers(model)
    best_numbers = present.clone()
    damping = 1e-3
    started = time.monotonic()
    for step in range(steps):
        frames = min(longest, round(first_frames * (longest / first_frames) ** (2 * step / max(1, steps))))
        # by string: residuals (frames, modes) in m; `before`: relative squared errors (strings,)
        residual = [_motion(model, case, rate_hz, frames) - case.truth[:frames] for case in train]
        before = torch.stack(
            [r.square().sum() / case.truth[:frames].square().sum() for r, case in zip(residual, train, strict=True)]
        )
        matrix, gradient = torch.zeros(3 * size, 3 * size).double(), torch.zeros(3 * size).double()
        chosen = [torch.randperm(frames, generator=generator)[:FRAMES] for _ in train]
        columns: list[list[Tensor]] = [[] for _ in train]  # of each string, by number: slopes at the chosen frames
        for number in range(3 * size):
            moved = present.clone()
            moved[number] += DIFFERENCE
            _set(model, moved)
            for place, case in enumerate(train):
                change = _motion(model, case, rate_hz, frames)[chosen[place]] - case.truth[chosen[place]]
                columns[place].append(((change - residual[place][chosen[place]]) / DIFFERENCE).flatten())
        for place, case in enumerate(train):
            jacobian = torch.stack(columns[place], dim=1)
            weight = frames / len(chosen[place]) / float(case.truth[:frames].square().sum() * (before[place] + FLOOR))
            matrix += weight * jacobian.T @ jacobian
            gradient += weight * jacobian.T @ residual[place][chosen[place]].flatten()
        start = float((before + FLOOR).log().mean())
        tried = []
        for factor in DAMPINGS:
            diagonal = matrix.diagonal()
            damped = matrix + damping * factor * torch.diag(diagonal + 1e-9 * diagonal.max())
            numbers = present - torch.linalg.solve(damped, gradient)
            _set(model, numbers)
            value = float((errors(model, train, rate_hz, frames) + FLOOR).log().mean())
            tried.append((value if math.isfinite(value) else math.inf, damping * factor, numbers))
        value, factor, numbers = min(tried, key=lambda one: one[0])
        if value < start:
            present, damping = numbers, factor
        else:
            damping *= DAMPINGS[-1]
        _set(model, present)
        measured = geometric_mean(errors(model, validation, rate_hz, longest))
        if measured < best:
            best, best_numbers = measured, present.clone()
        left_s = (time.monotonic() - started) / (step + 1) * (steps - step - 1)
        report((step + 1) / steps, f"step {step + 1}, validation {measured:.3g}", left_s)
    _set(model, best_numbers)
    return best


def errors(model: KoopmanTension, cases: Sequence[FitCase], rate_hz: int, frames: int) -> Tensor:
    """Relative squared error of each string's first frames, over the whole grid, (strings,)."""
    shares = [error_to_signal(_motion(model, case, rate_hz, frames), case.truth[:frames]) for case in cases]
    return torch.tensor(shares, dtype=torch.float64)


def geometric_mean(errors: Tensor) -> float:
    """The geometric mean of errors (strings,)."""
    return float(errors.clamp(min=1e-300).log().mean().exp())


@torch.no_grad()
def _motion(model: KoopmanTension, case: FitCase, rate_hz: int, frames: int) -> Tensor:
    """Modal amplitudes in m, (frames, modes): sines are orthogonal, so that their errors are the grid's."""
    of_string = model.for_resonator(Physics(case.plucked.resonator, rate_hz))
    return of_string.amplitudes(of_string.encode(displacement_m(case.plucked)[None]), frames)[0]


def _numbers(model: KoopmanTension) -> Tensor:
    """A copy of the numbers of the curves A, r and p, one after the other, (3 · numbers of a curve,)."""
    return torch.cat([model.A, model.r, model.p]).detach().clone()


def _set(model: KoopmanTension, numbers: Tensor) -> None:
    """Set the curves from numbers in the order of `_numbers`."""
    for curve, part in zip((model.A, model.r, model.p), numbers.chunk(3), strict=True):
        curve.copy_(part)
