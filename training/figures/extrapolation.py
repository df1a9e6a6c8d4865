"""A trajectory at a listening point before and past the end of training, and the error: the paper's Fig. 3.

The truth is simulated as the data set was, so that no data set is needed and no figure ends where the data end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from engine.metrics import ErrorSums
from engine.pluck import DEFAULT_LISTEN
from engine.presets import Preset, PresetError
from training.cell import MODEL_NAMES
from training.configuration import DatasetConfiguration
from training.data.dataset import Dataset, split_rows
from training.evaluate import MotionErrors, evaluate_past_horizon
from training.figures import style
from training.row_errors import data_of

LONGEST_S = 60.0
ZOOM_S = 0.02  # of each look at the waveform: five periods of the paper's string
SPECTRUM_S = 0.25  # the paper's
WINDOW_S = 0.01  # of the error
FLOOR_DB = -120.0
STARTS = {"gaussian": "Gaussian plucks", "noise": "noise-like starts", "pluck": "plucks of three shapes"}
SAME_DATA = (
    "tension_modulated",
    "initial",
    "rate_hz",
    "modes",
    "grid_points",
    "string",
    "seed",
    "count",
    "largest_tension_rise",
)


def extrapolation(
    presets: Sequence[Preset],
    seconds: float | None = None,
    trajectory: int = 0,
    trajectories: int = 10,
    listen: float = DEFAULT_LISTEN,
    report: Callable[[float], None] = lambda share: None,
) -> Figure:
    """Waveforms at the start, at the end of training and at the end; spectra; the error over all the time.

    Args:
        seconds: None is twice the longest training horizon.
        trajectory: of the validation set, which is drawn.
        trajectories: of the validation set, from the first on, whose common error is drawn.
        listen: where waveforms and spectra are taken, in lengths.

    Raises:
        PresetError: there is no preset, one does not name its data, or two were trained on different data.
        ValueError: there is no such trajectory, or too few frames.
    """
    data = common_data(presets)
    horizons_s = [preset.info.horizon_s for preset in presets]
    seconds = 2 * max(horizons_s) if seconds is None else seconds
    steps = round(seconds * data.rate_hz)
    if steps < 64:
        raise ValueError(f"{seconds:g} s hold {steps} frames at {data.rate_hz} Hz; choose at least 64")
    there = len(range(data.count)[split_rows(data.count, "validation")])
    if not 0 <= trajectory < there:
        raise ValueError(
            f"there is no trajectory {trajectory}: the validation set has 0 … {there - 1}; choose one of these"
        )
    parts = [slice(trajectory, trajectory + 1), slice(min(trajectories, there))]
    shares = [1 / (1 + parts[1].stop), 1.0]
    measured: list[list[MotionErrors]] = [[], []]
    for place, preset in enumerate(presets):
        own, before = Dataset(data, torch.empty(0), preset.info.scale_m), 0.0
        for found, part, share in zip(measured, parts, shares, strict=True):

            def reported(done: float, first: float = place + before, width: float = share - before) -> None:
                report((first + width * done) / len(presets))

            found.append(
                evaluate_past_horizon(
                    preset.model,
                    own,
                    "validation",
                    seconds,
                    horizon=0,
                    trajectories=part,
                    listen=listen,
                    report=reported,
                )
            )
            before = share
    alone, together = measured
    # (sources, frames), mm, from frame 0 on: the truth, then the models
    sounds = [alone[0].sounds[1], *(one.sounds[0] for one in alone)]
    scales_m = [preset.info.scale_m for preset in (presets[0], *presets)]
    signals = np.stack([1000 * scale * sound[0].numpy() for sound, scale in zip(sounds, scales_m, strict=True)])
    signals[~np.isfinite(signals)] = np.nan

    with style.styled():
        figure = Figure(figsize=(13, 9), layout="constrained")
        grid = figure.add_gridspec(3, 6, height_ratios=(1.1, 1, 1))
        axes = figure.add_subplot(grid[0, :])
        curves = [
            (_windows(a.string, data.rate_hz, seconds), _windows(t.string, data.rate_hz, seconds))
            for a, t in zip(alone, together, strict=True)
        ]
        _draw_errors(axes, curves, labels(presets), seconds, trajectory, parts[1].stop)
        for label, horizon_s in horizons(presets):
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
        figure.suptitle(f"Beyond training: {describe(data)}")
    return figure


def common_data(presets: Sequence[Preset]) -> DatasetConfiguration:
    """The data set that all the presets were trained on.

    Raises:
        PresetError: as `extrapolation`.
    """
    if not presets:
        raise PresetError("no preset was given; a figure needs at least one")
    first, *others = [data_of(preset) for preset in presets]
    for preset, data in zip(presets[1:], others, strict=True):
        for name in SAME_DATA:
            mine, its = getattr(first, name), getattr(data, name)
            if mine != its:
                raise PresetError(
                    f"{presets[0].name} and {preset.name} were trained on different data ({name}: {mine} and {its}); "
                    "make a figure of each"
                )
    return first


def describe(data: DatasetConfiguration) -> str:
    """The data set in words, for a title."""
    string = "tension-modulated" if data.tension_modulated else "linear"
    return f"{string} string, {STARTS[data.initial]}, {data.rate_hz / 1000:g} kHz"


def labels(presets: Sequence[Preset]) -> list[str]:
    """Short names that differ: the models', with the rest of the preset's name where one model is there twice."""
    models = [preset.info.model for preset in presets]
    found = []
    for preset in presets:
        label, model = MODEL_NAMES[preset.info.model], preset.info.model
        rest = preset.name.partition(f"_{model}")[2].strip("_").replace("_", " ")
        found.append(f"{label} ({rest})" if models.count(model) > 1 and rest else label)
    return found if len(set(found)) == len(found) else [preset.name for preset in presets]


def horizons(presets: Sequence[Preset]) -> list[tuple[str, float]]:
    """Where training ended, in s, and what to write there: one entry for all presets that have the same."""
    found: dict[float, list[str]] = {}
    for label, preset in zip(labels(presets), presets, strict=True):
        found.setdefault(preset.info.horizon_s, []).append(label)
    if len(found) == 1:
        return [("end of training", horizon_s) for horizon_s in found]
    return [(f"end of training\n{', '.join(who)}", horizon_s) for horizon_s, who in found.items()]


def levels_db(signal: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """The spectrum in dB below the highest peak of the reference's, not lower than FLOOR_DB."""
    peak = _magnitudes(reference).max() or 1.0
    return 20 * np.log10(np.maximum(_magnitudes(signal) / peak, 10 ** (FLOOR_DB / 20)))


def _magnitudes(signal: np.ndarray) -> np.ndarray:
    """|DFT| of a signal (samples,) under a Hann window: (samples // 2 + 1,)."""
    return np.abs(np.fft.rfft(signal * np.hanning(len(signal) + 1)[:-1]))


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
    hz = np.fft.rfftfreq(len(truth), 1 / rate_hz)
    kept = hz <= highest_hz
    axes.plot(hz[kept] / 1000, levels_db(truth, truth)[kept], color="#aaaaaa", linewidth=3.0, label="truth")
    for place, model in enumerate(models):
        axes.plot(hz[kept] / 1000, levels_db(model, truth)[kept], linewidth=1.2, **style.colour(place))
    axes.set_title(f"spectrum of {from_s:g} … {to_s:g} s")
    axes.set_xlabel("frequency in kHz")
    axes.set_ylabel("level in dB")
    axes.set_xlim(0, hz[kept][-1] / 1000)
    axes.set_ylim(-100, 5)
