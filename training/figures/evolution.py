"""Displacement of the whole string in time, of truth and models, errors, and spectra: the paper's Fig. 2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from torch import Tensor

from engine.metrics import relative_error
from engine.pluck import DEFAULT_LISTEN
from engine.presets import Preset
from engine.resonators.string import StringParameters
from training.figures import motions, spectrum, style
from training.figures.motions import Report

LONGEST_S = 2.0
PAPERS_S = 0.1
FLOOR_DB = -90.0
CLIPPED = 0.995  # share of the displacements that are within the colour scale


def evolution(
    presets: Sequence[Preset],
    trajectory: int = 0,
    seconds: float = PAPERS_S,
    listen: float = DEFAULT_LISTEN,
    report: Report = lambda share: None,
) -> Figure:
    """One trajectory of the validation set: space and time in one colour scale, errors magnified in it.

    Args:
        listen: of the spectra, in lengths.

    Raises:
        PresetError, ValueError: see `training.figures.motions`; too few frames for a spectrum.
    """
    data = motions.data_of(presets)
    steps = round(seconds * data.rate_hz)
    if steps < 16:
        raise ValueError(f"{seconds:g} s hold {steps} frames at {data.rate_hz} Hz; choose at least 16")
    start = motions.validation_start(data, trajectory)
    blocks = []
    for block in motions.motions(presets, start, steps):
        blocks.append(torch.stack([block.truth[0], *(model[0] for model in block.models)]))
        report((block.first - 1 + block.truth.shape[1]) / steps)
    truth, *models = torch.cat(blocks, dim=1)  # (frames, grid_points) each, from frame 1 on
    with style.styled():
        return _drawn(presets, data, trajectory, start[0], truth, models, listen)


def magnification(error: float, largest: float) -> int:
    """The power of ten, at least 1, that shows an error in the scale of `largest`."""
    if not 0 < error < largest:
        return 1
    return 10 ** int(np.log10(largest / error))


def _extent(frames: Tensor) -> float:
    """What nearly all displacements keep within; the few first peaks would leave all else pale."""
    return float(np.quantile(frames.abs().numpy(), CLIPPED))


def _drawn(
    presets: Sequence[Preset],
    data: motions.DatasetConfiguration,
    trajectory: int,
    start: Tensor,
    truth: Tensor,
    models: Sequence[Tensor],
    listen: float,
) -> Figure:
    columns = 1 + len(models)
    figure = Figure(figsize=(2.1 + 3.1 * columns, 7.6), layout="constrained")
    grid = figure.add_gridspec(3, columns, height_ratios=(1, 1, 0.9))
    limit_mm = 1000 * _extent(truth)
    seconds = len(truth) / data.rate_hz
    spectra = _spectra(data.rate_hz, data.string, data.modes, truth, models, motions.readout(data, listen))

    first = figure.add_subplot(grid[0, 0])
    image = _image(first, truth, seconds, data.string, limit_mm)
    first.set_title("truth")
    first.set_ylabel("position in cm")
    _draw_start(figure.add_subplot(grid[1, 0]), start, data.string)
    first_spectrum = figure.add_subplot(grid[2, 0])
    _draw_spectrum(first_spectrum, *spectra[0], None, {})
    first_spectrum.set_ylabel(f"level at {100 * listen * data.string.length_m:.0f} cm in dB")

    for place, (model, label) in enumerate(zip(models, motions.labels(presets), strict=True), 1):
        drawn = style.colour(place - 1)
        axes = figure.add_subplot(grid[0, place], sharex=first, sharey=first)
        _image(axes, model, seconds, data.string, limit_mm)
        axes.set_title(label, color=drawn["color"], fontweight="bold")
        error = model - truth
        factor = magnification(1000 * _extent(error), limit_mm)
        below = figure.add_subplot(grid[1, place], sharex=first, sharey=first)
        _image(below, factor * error, seconds, data.string, limit_mm)
        relative = relative_error(model[None], truth[None]).rel_mae
        times = f" × {factor}" if factor > 1 else ""
        below.set_title(f"error{times}   (rel. MAE {relative:.2g})")
        below.set_xlabel("time in ms")
        if place == 1:
            below.set_ylabel("position in cm")
        axes = figure.add_subplot(grid[2, place], sharex=first_spectrum, sharey=first_spectrum)
        _draw_spectrum(axes, *spectra[0], spectra[place][1], drawn)

    bar = figure.colorbar(
        image, ax=[axes for axes in figure.axes if axes.images], shrink=0.8, aspect=30, extend="both"
    )
    bar.set_label("displacement in mm")
    bar.outline.set_visible(False)
    figure.suptitle(f"Trajectory {trajectory} of the validation set: {motions.describe(data)}")
    return figure


def _image(axes: Axes, frames: Tensor, seconds: float, string: StringParameters, limit_mm: float) -> AxesImage:
    axes.grid(False)
    return axes.imshow(
        1000 * frames.T.numpy(),
        origin="lower",
        aspect="auto",
        extent=(0, 1000 * seconds, 0, 100 * string.length_m),
        cmap=style.DISPLACEMENT_MAP,
        vmin=-limit_mm,
        vmax=limit_mm,
        interpolation="antialiased",
        rasterized=True,
    )


def _draw_start(axes: Axes, start: Tensor, string: StringParameters) -> None:
    axes.plot(100 * string.length_m * np.linspace(0, 1, len(start)), 1000 * start.numpy(), color=style.TRUTH)
    axes.set_title("initial displacement")
    axes.set_xlabel("position in cm")
    axes.set_ylabel("displacement in mm")
    axes.set_xlim(0, 100 * string.length_m)


def _spectra(
    rate_hz: int, string: StringParameters, modes: int, truth: Tensor, models: Sequence[Tensor], readout: Tensor
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Frequencies in kHz up to what the string has, and levels in dB: of the truth, then of each model."""
    reference = (truth @ readout)[:, 0].numpy()
    hz = spectrum.frequencies_hz(len(reference), rate_hz)
    kept = hz <= 1.1 * float(string.undamped_frequencies(modes)[-1]) / (2 * np.pi)
    signals = [(frames @ readout)[:, 0].numpy() for frames in (truth, *models)]
    return [(hz[kept] / 1000, spectrum.levels_db(signal, reference)[kept]) for signal in signals]


def _draw_spectrum(
    axes: Axes, khz: np.ndarray, truth: np.ndarray, model: np.ndarray | None, drawn: dict[str, Any]
) -> None:
    if model is None:
        axes.plot(khz, truth, color=style.TRUTH, label="truth")
    else:
        axes.plot(khz, truth, color="#aaaaaa", linewidth=2.4, label="truth")
        axes.plot(khz, model, linewidth=1.3, label="model", **drawn)
        axes.legend(loc="upper right", ncols=2, borderaxespad=0)
    axes.set_xlabel("frequency in kHz")
    axes.set_xlim(0, khz[-1])
    axes.set_ylim(FLOOR_DB, 18)  # with room for the legend
