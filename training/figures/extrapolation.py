"""A trajectory at a listening point before and past the end of training, and the error: the paper's Fig. 3."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from engine.metrics import ErrorSums
from engine.pluck import DEFAULT_LISTEN
from engine.presets import Preset
from training.figures import motions, spectrum, style
from training.figures.motions import Report

LONGEST_S = 60.0
ZOOM_S = 0.02  # of each look at the waveform: five periods of the paper's string
SPECTRUM_S = 0.25  # the paper's
WINDOW_S = 0.01  # of the error


def extrapolation(
    presets: Sequence[Preset],
    seconds: float | None = None,
    trajectory: int = 0,
    trajectories: int = 10,
    listen: float = DEFAULT_LISTEN,
    report: Report = lambda share: None,
) -> Figure:
    """Waveforms at the start, at the end of training and at the end; spectra; the error over all the time.

    Args:
        seconds: None is twice the longest training horizon.
        trajectory: of the validation set, which is drawn.
        trajectories: of the validation set, from the first on, whose common error is drawn.
        listen: where waveforms and spectra are taken, in lengths.

    Raises:
        PresetError, ValueError: see `training.figures.motions`; too few frames.
    """
    data = motions.data_of(presets)
    horizons_s = [preset.info.horizon_s for preset in presets]
    seconds = 2 * max(horizons_s) if seconds is None else seconds
    steps = round(seconds * data.rate_hz)
    if steps < 64:
        raise ValueError(f"{seconds:g} s hold {steps} frames at {data.rate_hz} Hz; choose at least 64")
    readout = motions.readout(data, listen)
    start = motions.validation_start(data, trajectory)
    several = motions.validation_starts(data)[:trajectories]
    alone, heard = [ErrorSums(steps) for _ in presets], []
    for block in motions.motions(presets, start, steps):
        for sums, model in zip(alone, block.models, strict=True):
            sums.add(model, block.truth, block.first - 1)
        heard.append(torch.stack([(frames @ readout)[0, :, 0] for frames in (block.truth, *block.models)]))
        report((block.first - 1 + block.truth.shape[1]) / steps / (1 + len(several)))
    before = 1 / (1 + len(several))
    together = motions.errors(presets, several, steps, lambda share: report(before + (1 - before) * share))
    first = (start @ readout).expand(1 + len(presets), 1)
    signals = 1000 * torch.cat([first, *heard], dim=1).numpy()  # (sources, frames), mm, from frame 0 on

    with style.styled():
        figure = Figure(figsize=(13, 9), layout="constrained")
        grid = figure.add_gridspec(3, 6, height_ratios=(1.1, 1, 1))
        axes = figure.add_subplot(grid[0, :])
        curves = [
            (_windows(a, data.rate_hz, seconds), _windows(t, data.rate_hz, seconds))
            for a, t in zip(alone, together, strict=True)
        ]
        _draw_errors(axes, curves, motions.labels(presets), seconds, trajectory, len(several))
        for label, horizon_s in motions.horizons(presets):
            style.mark_horizon(axes, horizon_s, label)
        horizon_s = max(horizons_s)
        for place, (from_s, words) in enumerate(_looks(seconds, horizon_s)):
            below = figure.add_subplot(grid[1, 2 * place : 2 * place + 2])
            _draw_waveforms(below, signals, data.rate_hz, from_s, words)
            style.mark_horizon(below, 1000 * horizon_s)
            if place == 0:
                below.set_ylabel(f"u at {100 * listen * data.string.length_m:.0f} cm in mm")
        highest_hz = 1.1 * float(data.resonator.omega[-1]) / (2 * np.pi)
        for place, from_s in enumerate((0.0, min(horizon_s, seconds / 2))):
            below = figure.add_subplot(grid[2, 3 * place : 3 * place + 3])
            _draw_spectra(below, signals, data.rate_hz, from_s, min(from_s + SPECTRUM_S, seconds), highest_hz)
        style.add_legend(figure, (below, axes))
        figure.suptitle(f"Beyond training: {motions.describe(data)}")
    return figure


def _looks(seconds: float, horizon_s: float) -> list[tuple[float, str]]:
    """Where the waveform is looked at, each for ZOOM_S, and why there."""
    end_s = max(0.0, seconds - ZOOM_S)
    middle = min(max(0.0, horizon_s - ZOOM_S / 2), end_s)
    return [(0.0, "the start"), (middle, "the end of training"), (end_s, "the end")]


def _windows(sums: ErrorSums, rate_hz: int, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """The middles of successive windows of WINDOW_S, and the relative MAE in each."""
    found = sums.windows(rate_hz, [WINDOW_S * edge for edge in range(int(seconds / WINDOW_S) + 2)])
    return np.array([(w.start_s + w.stop_s) / 2 for w in found]), np.array([w.rel_mae for w in found])


def _draw_errors(
    axes: Axes,
    curves: Sequence[tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]],
    labels: Sequence[str],
    seconds: float,
    trajectory: int,
    trajectories: int,
) -> None:
    for place, ((alone, together), label) in enumerate(zip(curves, labels, strict=True)):
        drawn = style.colour(place)
        axes.plot(*alone, linewidth=0.9, alpha=0.7, **drawn)
        axes.plot(*together, linewidth=2.2, label=label, **drawn)
    style.scale_errors(axes)
    axes.set_xlim(0, seconds)
    axes.set_xlabel("time in s")
    axes.set_ylabel(f"relative MAE in {1000 * WINDOW_S:g} ms")
    axes.set_title(f"error (bold: {trajectories} trajectories, thin: trajectory {trajectory}, which is drawn below)")


def _draw_waveforms(axes: Axes, signals: np.ndarray, rate_hz: int, from_s: float, words: str) -> None:
    first, last = round(from_s * rate_hz), round((from_s + ZOOM_S) * rate_hz) + 1
    time_ms = 1000 * np.arange(first, min(last, signals.shape[1])) / rate_hz
    truth, *models = signals[:, first:last]
    axes.plot(time_ms, truth, color="#aaaaaa", linewidth=3.2)
    for place, model in enumerate(models):
        axes.plot(time_ms, model, linewidth=1.3, **style.colour(place))
    axes.set_title(words)
    axes.set_xlabel("time in ms")
    axes.set_xlim(time_ms[0], time_ms[-1])
    largest = np.abs(truth).max() or 1.0
    axes.set_ylim(-1.5 * largest, 1.5 * largest)  # a model that runs away does not hide the truth


def _draw_spectra(
    axes: Axes, signals: np.ndarray, rate_hz: int, from_s: float, to_s: float, highest_hz: float
) -> None:
    truth, *models = signals[:, round(from_s * rate_hz) : round(to_s * rate_hz)]
    hz = spectrum.frequencies_hz(len(truth), rate_hz)
    kept = hz <= highest_hz
    axes.plot(hz[kept] / 1000, spectrum.levels_db(truth, truth)[kept], color="#aaaaaa", linewidth=3.0, label="truth")
    for place, model in enumerate(models):
        axes.plot(hz[kept] / 1000, spectrum.levels_db(model, truth)[kept], linewidth=1.2, **style.colour(place))
    axes.set_title(f"spectrum of {from_s:g} … {to_s:g} s")
    axes.set_xlabel("frequency in kHz")
    axes.set_ylabel("level in dB")
    axes.set_xlim(0, hz[kept][-1] / 1000)
    axes.set_ylim(-100, 5)
