"""The window: how soon after the start it is shown and can be played, and how smoothly the picture moves.

Sound and its latency are measured by `bench play`, from outside.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QWidget

from app.window.panels import StringPanel
from app.window.settings import Settings
from tests.bench.machine import Machine
from tests.bench.stage import Stage, opened, silent
from tests.bench.start import measure_starts

SIZE = (1920, 1080)
PICTURE_S = 4.0
SETTLING_S = 2.5  # before each measurement, until what rings has ended and the pictures have stopped


@dataclass(frozen=True)
class Figure:
    """One line: the median (or a mean over the time of measurement), the worst of several, and the target."""

    name: str
    unit: str
    value: float
    worst: float | None
    target: float


@dataclass(frozen=True)
class AppBenchmark:
    """`platform`: Qt's; `size`: of the window in pixels; `views`: those beside the string."""

    machine: Machine
    platform: str
    preset: str
    size: tuple[int, int]
    views: tuple[str, str]
    figures: tuple[Figure, ...]


class PaintCounter(QObject):
    """Counts how often a widget is painted."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self.count = 0
        widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        self.count += event.type() == QEvent.Type.Paint
        return False


def measure(starts: int, seconds: float, report: Callable[[float, str], None]) -> AppBenchmark:
    """`starts`: how many are timed; `seconds`: how long the picture is observed, playing and stopped."""
    figures = _starts(starts, lambda number: report(0.8 * number / (starts + 1), "starts"))
    with opened(Settings(), SIZE, silent) as stage:
        report(0.8, "picture")
        figures += _picture(stage, seconds)
        size, choices = stage.window.size(), stage.controller.session.choices
        views = choices.left_view, choices.right_view
        found = Machine.here(), stage.platform, choices.preset, (size.width(), size.height()), views
    return AppBenchmark(*found, tuple(figures))


def _starts(count: int, report: Callable[[int], None]) -> list[Figure]:
    found = measure_starts(count, report)
    return [
        _median("start to the first window", "s", list(found.painted_s), 2.0),
        _median("start to the first playable pluck", "s", list(found.ready_s), 3.0),
    ]


def _picture(stage: Stage, seconds: float) -> list[Figure]:
    controller = stage.controller
    painted = PaintCounter(next(panel.view for panel in controller.panels if isinstance(panel, StringPanel)))

    def watch() -> tuple[float, float]:
        """Paint events per second, and the share of a core that this thread takes."""
        stage.run_for(SETTLING_S)
        count, cpu_s, now_s = painted.count, time.thread_time(), time.perf_counter()
        stage.run_for(seconds)
        taken_s = time.perf_counter() - now_s
        return (painted.count - count) / taken_s, (time.thread_time() - cpu_s) / taken_s

    controller.session.update(seconds=PICTURE_S, loop=True)
    stage.wait_until_rendered()
    controller.pluck()
    frames_per_s, playing = watch()
    controller.session.update(loop=False)
    controller.performance.stop()
    _, stopped = watch()
    return [
        Figure("picture while playing", "frames/s", frames_per_s, None, 60.0),
        Figure("the window while playing", "of a core", playing, None, 0.33),
        Figure("the window with nothing playing", "of a core", stopped, None, 0.03),
    ]


def _median(name: str, unit: str, values: list[float], target: float) -> Figure:
    return Figure(name, unit, statistics.median(values), max(values), target)
