"""A picture of a training run from its log.csv: loss and validation errors, learning rate and horizon."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.figures import style

COLUMNS = ("epoch", "horizon", "learning_rate", "loss", "rel_mse", "rel_mae")


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
    series = read_log(log)
    with style.styled():
        figure = Figure(figsize=(10, 6.5))
        figure.subplots_adjust(left=0.08, right=0.91, bottom=0.09, top=0.93, hspace=0.08)  # at once, unlike a layout
        errors, rates = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for place, (name, label) in enumerate(
            (("loss", "loss"), ("rel_mse", "validation rel. MSE"), ("rel_mae", "validation rel. MAE"))
        ):
            marker = "" if name == "loss" else "o"
            _curve(errors, series, name, label=label, marker=marker, markersize=3.5, **style.colour(place))
        _log_scale(errors)
        errors.set_ylabel("loss, relative error")
        if errors.lines:
            errors.legend(loc="upper right")
        _curve(rates, series, "learning_rate", **style.colour(3))
        rates.set_ylim(bottom=0)
        rates.ticklabel_format(axis="y", style="sci", scilimits=(0, 0))
        rates.set_ylabel("learning rate", color=style.COLOURS[3])
        rates.set_xlabel("epoch")
        horizon = rates.twinx()
        horizon.grid(False)
        _curve(horizon, series, "horizon", **style.colour(4))
        _log_scale(horizon)
        horizon.set_ylabel("horizon in frames", color=style.COLOURS[4])
        figure.suptitle(log.parent.name)
    return figure


def read_log(log: Path) -> dict[str, list[float]]:
    """Columns of a log, each as long as the epochs; NaN where there is no number. A torn last line is left out.

    Raises:
        OSError, ValueError: see `plot_run`.
    """
    try:
        with log.open(newline="", encoding="utf-8") as file:
            head, *lines = csv.reader(file)
    except (ValueError, csv.Error) as error:  # not a line, not text
        raise ValueError(f"{log}: not a training log ({error}); give a run's log.csv") from error
    if missing := [name for name in COLUMNS if name not in head]:
        raise ValueError(f"{log}: not a training log, column {missing[0]!r} is missing; give a run's log.csv")
    whole = [dict(zip(head, line, strict=True)) for line in lines if len(line) == len(head)]
    return {name: [_number(line[name]) for line in whole] for name in COLUMNS}


def _curve(axes: Axes, series: dict[str, list[float]], name: str, **look: Any) -> None:
    """What is finite of a column over its epochs; nothing where nothing is."""
    points = [(epoch, value) for epoch, value in zip(series["epoch"], series[name], strict=True) if value == value]
    if points:
        axes.plot(*zip(*points, strict=True), **look)


def _log_scale(axes: Axes) -> None:
    """Where there is anything to show on it: log10 losses may be negative."""
    if axes.lines and all((np.asarray(line.get_ydata()) > 0).all() for line in axes.lines):
        axes.set_yscale("log")


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan
