"""Relative error in each time step over the validation set, within training and past it: the paper's Fig. 4."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from engine.presets import Preset
from training.figures import motions, style
from training.figures.motions import Report

LONGEST_S = 10.0
PAST_TRAINING = 1.5  # horizons that are drawn
SMOOTHED_S = 0.01


def error(
    presets: Sequence[Preset],
    seconds: float | None = None,
    trajectories: int | None = None,
    report: Report = lambda share: None,
) -> Figure:
    """Relative MAE and MSE over time, a curve each model.

    Args:
        seconds: None is one and a half times the longest training horizon.
        trajectories: of the validation set, from the first on; None is all.

    Raises:
        PresetError, ValueError: see `training.figures.motions`.
    """
    data = motions.data_of(presets)
    horizons_s = [preset.info.horizon_s for preset in presets]
    seconds = PAST_TRAINING * max(horizons_s) if seconds is None else seconds
    steps = round(seconds * data.rate_hz)
    if steps < 1:
        raise ValueError(f"{seconds:g} s hold no frame at {data.rate_hz} Hz; choose more")
    starts = motions.validation_starts(data)[:trajectories]
    sums = motions.errors(presets, starts, steps, report)
    with style.styled():
        figure = Figure(figsize=(12, 6.2), layout="constrained")
        mae, mse = figure.subplots(1, 2, sharex=True)
        time_s = np.arange(1, steps + 1) / data.rate_hz
        for axes, metric, name in ((mse, 0, "relative MSE"), (mae, 1, "relative MAE")):
            for place, (total, label) in enumerate(zip(sums, motions.labels(presets), strict=True)):
                values, drawn = total.per_frame()[metric], style.colour(place)
                axes.plot(time_s, values, linewidth=0.5, alpha=0.25, **drawn)
                axes.plot(time_s, smoothed(values, data.rate_hz, SMOOTHED_S), label=label, **drawn)
            style.scale_errors(axes)
            axes.set_xlim(0, seconds)
            for words, horizon_s in motions.horizons(presets):
                style.mark_horizon(axes, horizon_s, words)
            axes.set_xlabel("time in s")
            axes.set_ylabel(f"{name} per time step")
        style.add_legend(figure, (mae,))
        figure.suptitle(
            f"Error per time step (thin) and its mean over {1000 * SMOOTHED_S:g} ms (bold)\n"
            f"{len(starts)} trajectories of the validation set: {motions.describe(data)}"
        )
    return figure


def smoothed(values: np.ndarray, rate_hz: float, seconds: float) -> np.ndarray:
    """The running mean over `seconds`, at the ends over what there is of them."""
    width = min(max(1, round(seconds * rate_hz)), len(values))
    window = np.ones(width)
    return np.convolve(values, window, "same") / np.convolve(np.ones(len(values)), window, "same")
