"""Axes: the longest label that there is room for, numbers that do not touch, the numbers of frequencies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import pyqtgraph as pg
from PySide6.QtGui import QFontMetrics

from app.views import theme

LETTER_PIXELS = 12
AIR = 8  # pixels of a label, at its ends together
TICK_PIXELS = 14  # the least distance of numbers on a vertical axis
LOWEST_HZ = 50.0  # of a logarithmic axis of frequencies
MOST_STEPS = 6  # of an axis that shows less than two octaves
RANGES_DB = (60, 90, 130)  # of levels, below full scale
_LABELLED_HZ = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000)


class UprightLabel:
    """The label of a plot's left axis in several wordings, the longest first; follows the plot's height."""

    def __init__(self, plot: pg.PlotItem, wordings: Sequence[str] = ()) -> None:
        self._axis = plot.getAxis("left")
        self._box = plot.vb
        self._wordings = tuple(wordings)
        self._box.sigResized.connect(self._fit)
        self._fit()

    def set(self, *wordings: str) -> None:
        if wordings != self._wordings:
            self._wordings = wordings
            self._fit()

    def _fit(self) -> None:
        """Show the longest wording that the height has room for; none where even the shortest is too long."""
        metrics = QFontMetrics(theme.small_font(LETTER_PIXELS))
        height = self._box.boundingRect().height()
        text = next((words for words in self._wordings if metrics.horizontalAdvance(words) + AIR <= height), "")
        if text != self._axis.labelText:
            self._axis.setLabel(text)
        self._axis.showLabel(bool(text))
        self._axis.resizeEvent(None)  # puts the label in the middle again


class UprightTicks:
    """The numbers of a vertical axis: as many of a given list as there is room for, the ends of the list first."""

    def __init__(self, axis: pg.AxisItem, box: pg.ViewBox) -> None:
        self._axis, self._box = axis, box
        self._ticks: tuple[tuple[float, str], ...] | None = None  # as of `set`
        self._between: list[tuple[float, str]] = []  # (place, "")
        box.sigResized.connect(self._fit)
        box.sigYRangeChanged.connect(self._fit)

    def set(self, ticks: Iterable[tuple[float, str]] | None, between: Iterable[float] = ()) -> None:
        """Set the ticks with numbers, (place on the axis, text), rising; None: the axis chooses.

        `between`: places of ticks without numbers.
        """
        self._ticks = None if ticks is None else tuple(ticks)
        self._between = [(place, "") for place in between]
        self._fit()

    def _fit(self) -> None:
        """Set the ticks in view that are TICK_PIXELS apart at least; without a list leave them to the axis."""
        if self._ticks is None:
            self._axis.setTicks(None)
            return
        low, high = self._axis.range
        seen = [tick for tick in self._ticks if low <= tick[0] <= high]  # those out of sight take no room
        room = TICK_PIXELS * (high - low) / max(self._box.boundingRect().height(), 1.0)
        self._axis.setTicks([sparse(seen, room), self._between])


def sparse(ticks: Sequence[tuple[float, str]], room: float) -> list[tuple[float, str]]:
    """Select the `ticks`, (place, text), that are at least `room` apart, the first and the last before the others.

    `room`: in the unit of the places.
    """
    sparse_ticks: list[tuple[float, str]] = []
    for tick in (*ticks[:1], *ticks[:0:-1][:1], *ticks[1:-1]):
        if all(abs(tick[0] - other) >= room for other, _ in sparse_ticks):
            sparse_ticks.append(tick)
    return sorted(sparse_ticks)


def frequency_ticks(lowest_hz: float = LOWEST_HZ, highest_hz: float = 24_000) -> list[tuple[float, str]]:
    """The log₁₀ of frequencies in Hz, and their texts: (2.0, "100"), (3.0, "1k"). Within two octaves, even steps."""
    labelled_hz: Iterable[float] = _LABELLED_HZ
    if highest_hz < 4 * lowest_hz:
        least_hz = (highest_hz - lowest_hz) / MOST_STEPS
        decade_hz = 10.0 ** math.floor(math.log10(least_hz))
        step_hz = next(step * decade_hz for step in (1, 2, 5, 10) if step * decade_hz >= least_hz)
        labelled_hz = (n * step_hz for n in range(math.ceil(lowest_hz / step_hz), int(highest_hz / step_hz) + 1))
    return [(math.log10(hz), f"{hz:.6g}" if hz < 1000 else f"{hz / 1000:.6g}k") for hz in labelled_hz]
