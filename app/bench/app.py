"""The window as its user meets it: how soon it is there, how soon a pluck sounds, how smoothly the picture moves.

A pluck is timed from the controller's `pluck` to the callback that gives the device its first sample other than
zero. The sound that is kept ready before it, the user's choice of a buffer, is told beside it and taken off: what is
left is what the program adds.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QWidget

from app.audio_control import LATENCY_S
from app.bench.machine import Machine
from app.bench.pretended_device import PretendedCard
from app.bench.stage import Stage, opened
from app.bench.start import measure_starts
from app.panels import StringPanel
from app.settings import Buffer, Settings

SIZE = (1920, 1080)
PLUCKS = 8
PLUCK_S = 0.5  # how long they are: a new one waits for the last to be rendered
PICTURE_S = 4.0
LONG_PLUCKS = 3  # of that length, heard while they are rendered
QUIET_S = 0.3  # lets what rings fade before the next pluck
SETTLING_S = 1.0
BUFFERS: tuple[Buffer, ...] = ("low", "medium")


@dataclass(frozen=True)
class Figure:
    """One line: a median (or a mean over the time of measurement), the worst where there are several, the target."""

    name: str
    unit: str
    value: float
    worst: float | None
    target: float


@dataclass(frozen=True)
class AppBenchmark:
    """`platform` is Qt's; `size` of the window in pixels; `views`: those beside the string."""

    machine: Machine
    platform: str
    preset: str
    size: tuple[int, int]
    views: tuple[str, str]
    figures: tuple[Figure, ...]


class PaintCounter(QObject):
    """Counts how often a widget is really painted."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self.count = 0
        widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        self.count += event.type() == QEvent.Type.Paint
        return False


def measure(starts: int, seconds: float, report: Callable[[float, str], None]) -> AppBenchmark:
    """`starts`: how many are timed; `seconds`: how long the picture is watched, playing and stopped."""
    figures = _starts(starts, lambda number: report(0.5 * number / (starts + 1), "starts"))
    card = PretendedCard()
    with opened(Settings(), card, SIZE) as stage:
        for number, buffer in enumerate(BUFFERS):
            report(0.5 + 0.15 * number, f"plucks, {buffer} buffer")
            figures += _plucks(stage, buffer)
        report(0.75, "long plucks")
        figures += _gaps(stage)
        report(0.85, "picture")
        figures += _picture(stage, seconds)
        size, choices = stage.window.size(), stage.controller.session.choices
        views = choices.left_view, choices.right_view
        found = Machine.here(), stage.platform, choices.preset, (size.width(), size.height()), views
    return AppBenchmark(*found, tuple(figures))


def _starts(count: int, report: Callable[[int], None]) -> list[Figure]:
    found = measure_starts(count, report)
    return [
        _median("start to the first window", "s", list(found.painted_s), 2.0),
        Figure("start to the first pluck ready", "s", found.ready_s, None, 5.0),
    ]


def _plucks(stage: Stage, buffer: Buffer) -> list[Figure]:
    controller = stage.controller
    changes_done = controller.player.status().changes_done
    controller.player.open(buffer_s=LATENCY_S[buffer])
    stage.wait_for(lambda: controller.player.status().changes_done > changes_done, "another buffer")
    stage.run_for(SETTLING_S)
    buffer_s = _buffer_s(stage)
    _choose_seconds(stage, PLUCK_S)
    same_s = [_pluck_s(stage) for _ in range(PLUCKS)]
    first = 0.3 + 0.005 * BUFFERS.index(buffer)
    new_s = [_pluck_s(stage, position=first + 0.01 * (number + 1)) for number in range(PLUCKS)]
    return [
        Figure(f"ready sound, {buffer} buffer", "ms", 1000 * buffer_s, None, 1000 * LATENCY_S[buffer]),
        *(
            _median(f"{kind} to the device beyond it", "ms", [1000 * (t - buffer_s) for t in times_s], target)
            for kind, times_s, target in (("same pluck", same_s, 10.0), ("new pluck", new_s, 30.0))
        ),
    ]


def _choose_seconds(stage: Stage, seconds: float) -> None:
    if stage.controller.session.choices.seconds != seconds:
        stage.window.error_label.clear()
        stage.controller.session.update(seconds=seconds)
        stage.wait_until_rendered()


def _buffer_s(stage: Stage) -> float:
    """Of the sound that a command waits for."""
    output = stage.card.output
    assert output is not None
    return output.prompt_blocks * output.block_frames / output.rate_hz


def _pluck_s(stage: Stage, **changes: float) -> float:
    """From silence to the first sample, of what is on stage or of a pluck with `changes`."""
    controller, stream = stage.controller, stage.card.stream
    assert stream is not None
    controller.player.stop()
    stage.run_for(QUIET_S)
    stream.listen_anew()
    if changes:
        stage.window.error_label.clear()
    plucked_s = time.perf_counter()
    controller.session.update(**changes)
    controller.pluck()
    stage.wait_for(lambda: stream.sounded_s is not None, "a sound")
    assert stream.sounded_s is not None
    stage.wait_until_rendered()
    return stream.sounded_s - plucked_s


def _gaps(stage: Stage) -> list[Figure]:
    """Of new plucks that are heard, and drawn, while they are rendered."""
    _choose_seconds(stage, PICTURE_S)
    gaps_s = []
    for number in range(LONG_PLUCKS):
        _pluck_s(stage, position=0.55 + 0.01 * number)
        stream = stage.card.stream
        assert stream is not None
        stage.wait_for(lambda: not stage.controller.player.status().playing, "the end of a pluck")
        gaps_s.append(stream.gap_s)
    return [_median(f"gaps in a new pluck of {PICTURE_S:g} s", "s", gaps_s, 0.0)]


def _picture(stage: Stage, seconds: float) -> list[Figure]:
    controller = stage.controller
    painted = PaintCounter(next(panel.view for panel in controller.panels if isinstance(panel, StringPanel)))

    def watch() -> tuple[float, float]:
        """Paintings a second, and the share of a core that this thread takes."""
        stage.run_for(SETTLING_S)
        count, cpu_s, now_s = painted.count, time.thread_time(), time.perf_counter()
        stage.run_for(seconds)
        taken_s = time.perf_counter() - now_s
        return (painted.count - count) / taken_s, (time.thread_time() - cpu_s) / taken_s

    _choose_seconds(stage, PICTURE_S)
    controller.session.update(loop=True)
    controller.pluck()
    frames_per_s, playing = watch()
    controller.play_or_stop()
    _, stopped = watch()
    return [
        Figure("picture while playing", "frames/s", frames_per_s, None, 60.0),
        Figure("drawing while playing", "of a core", playing - stopped, None, 0.33),
        Figure("the window while stopped", "of a core", stopped, None, 0.1),
    ]


def _median(name: str, unit: str, values: list[float], target: float) -> Figure:
    return Figure(name, unit, statistics.median(values), max(values), target)
