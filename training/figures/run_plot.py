"""A picture of a training run from its log.csv: loss and validation errors, learning rate and horizon."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.figures import style
from training.fitting.log import Epoch, read_log


def plot_run(log: Path, image: Path) -> None:
    """Draws a run's log, of any length, finished or not, to `image`, whole or not at all.

    Raises:
        OSError: the log cannot be read, or the image not be written.
        ValueError: the log is not a training log, or `image` is of no format that is written.
    """
    style.check_format(image)
    style.save_figure(run_figure(log), image)


def run_figure(log: Path) -> Figure:
    """The figure of `plot_run`."""
    epochs = read_log(log)
    with style.styled():
        figure = Figure(figsize=(10, 6.5))
        figure.subplots_adjust(left=0.08, right=0.91, bottom=0.09, top=0.93, hspace=0.08)  # at once, unlike a layout
        errors, rates = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for place, (name, label) in enumerate(
            (("loss", "loss"), ("rel_mse", "validation rel. MSE"), ("rel_mae", "validation rel. MAE"))
        ):
            marker = "" if name == "loss" else "o"
            _curve(errors, epochs, name, label=label, marker=marker, markersize=3.5, **style.colour(place))
        _log_scale(errors)
        errors.set_ylabel("loss, relative error")
        if errors.lines:
            errors.legend(loc="upper right")
        _curve(rates, epochs, "learning_rate", **style.colour(3))
        rates.set_ylim(bottom=0)
        rates.ticklabel_format(axis="y", style="sci", scilimits=(0, 0))
        rates.set_ylabel("learning rate", color=style.COLOURS[3])
        rates.set_xlabel("epoch")
        horizon = rates.twinx()
        horizon.grid(False)
        _curve(horizon, epochs, "horizon", **style.colour(4))
        _log_scale(horizon)
        horizon.set_ylabel("horizon in frames", color=style.COLOURS[4])
        figure.suptitle(log.parent.name)
    return figure


def _curve(axes: Axes, epochs: Sequence[Epoch], name: str, **look: Any) -> None:
    """A figure over the epochs that have it; nothing where none has."""
    points = [(epoch.epoch, value) for epoch in epochs if (value := getattr(epoch, name)) is not None]
    if points:
        axes.plot(*zip(*points, strict=True), **look)


def _log_scale(axes: Axes) -> None:
    """Where there is anything to show on it: log10 losses may be negative."""
    if axes.lines and all((np.asarray(line.get_ydata()) > 0).all() for line in axes.lines):
        axes.set_yscale("log")
