"""A restless user for minutes: plucks and changes of everything, and whether the app bears it.

Everything happens as by a user's hands, through session and controller, with a pretended device that asks for sound
at its pace. What is random follows from the seed; how far the rendering of each pluck gets depends on the machine.

After each minute the user rests on the same short pluck, and the process is weighed: in between, takes of up to
hundreds of MiB come and go with what is chosen.
"""

from __future__ import annotations

import gc
import sys
import threading
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from random import Random
from types import TracebackType

import psutil
from PySide6.QtCore import QMessageLogContext, QObject, QTimer, QtMsgType, qInstallMessageHandler

from app.bench.machine import Machine
from app.bench.pretended_device import PretendedCard
from app.bench.random_changes import Repertoire, random_change
from app.bench.stage import Stage, opened
from app.panels.rack import LEFT, RIGHT
from app.session import Choices
from app.settings import Settings

BLOCK_FRAMES = 512
SIZE = (1280, 800)
EVERY_S = 0.5
LOOK_EVERY_S = 0.02
WEIGH_EVERY_S = 1.0
PART_S = 60.0  # between two rests; in the first, every kind of thing is loaded once, and caches are filled
REST_S = 3.0  # in which the views finish and free memory is given back
REST_PLUCK_S = 1.0
MOST_CHANGES = 3  # before a pluck
MIB = 2**20


@dataclass(frozen=True)
class Soak:
    """What came of it.

    Attributes:
        underruns: blocks that were not ready when the device asked.
        late_callbacks: the device itself was held up by more than a block: not seen as underruns.
        waited_share: of the time in which rendering lagged behind what was to be heard.
        longest_stall_s: for which the window did nothing.
        at_rest_mib: resident memory at each rest.
        settled_mib, end_mib: at the first and at the last.
        drift_mib: how far it was above the first at any other.
        peak_mib: the most that it ever was, with all.
        threads_left: names of those that outlived the window.
        faults: tracebacks of exceptions, whether the app told its user or nobody caught them, and warnings of Python
            and of Qt; each once, with its number.
        notices: all that the app told its user, with how often.
    """

    machine: Machine
    platform: str
    seed: int
    seconds: float
    plucks: int
    changes: int
    underruns: int
    late_callbacks: int
    waited_share: float
    longest_stall_s: float
    at_rest_mib: tuple[float, ...]
    settled_mib: float
    end_mib: float
    drift_mib: float
    peak_mib: float
    threads_left: tuple[str, ...]
    faults: tuple[tuple[str, int], ...]
    notices: tuple[tuple[str, int], ...]


def soak(seconds: float, seed: int, report: Callable[[float, str], None]) -> Soak:
    """The window for so long, then closed."""
    threads_before = set(threading.enumerate())
    machine = Machine.here()
    with collected_faults() as faults, opened(Settings(), card := PretendedCard(BLOCK_FRAMES), SIZE) as stage:
        user = _User(stage, Random(seed))
        watch = _Watch(stage, seconds, report)
        underruns, late = _underruns(card)
        parts = max(2, round(seconds / PART_S))
        at_rest_mib = []
        for _ in range(parts):
            user.go_on()
            stage.run_for(seconds / parts)
            user.stop()
            at_rest_mib.append(_weighed_at_rest(stage))
        watch.stop()
        underruns_after, late_after = _underruns(card)
        notices, platform = stage.window.notices.notices, stage.platform
        faults.update({notice.details: notice.times for notice in notices if "Traceback" in notice.details})
    left = [thread.name for thread in threading.enumerate() if thread not in threads_before]
    return Soak(
        machine,
        platform,
        seed,
        seconds,
        user.plucks,
        user.changes,
        underruns_after - underruns,
        late_after - late,
        watch.waiting / max(1, watch.looks),
        watch.longest_stall_s,
        tuple(at_rest_mib),
        at_rest_mib[0],
        at_rest_mib[-1],
        max(at_rest_mib) - at_rest_mib[0],
        watch.peak_mib,
        tuple(sorted(left)),
        tuple(faults.items()),
        tuple((notice.message, notice.times) for notice in notices),
    )


class _User(QObject):
    """Changes some choices, then plucks, stops, seeks or takes something back."""

    def __init__(self, stage: Stage, random: Random) -> None:
        super().__init__(stage.window)
        controller = stage.controller
        self.plucks = self.changes = 0
        self._stage, self._random = stage, random
        self._repertoire = Repertoire(
            tuple(entry.name for entry in controller.library.entries if not entry.unplayable),
            tuple(panel.key for panel in LEFT),
            tuple(panel.key for panel in RIGHT),
        )
        self._timer = QTimer(self, interval=round(1000 * EVERY_S))
        self._timer.timeout.connect(self._act)

    def go_on(self) -> None:
        self._timer.start()

    def stop(self) -> None:
        self._timer.stop()

    def _act(self) -> None:
        stage, random, session = self._stage, self._random, self._stage.controller.session
        for _ in range(random.randint(0, MOST_CHANGES)):
            session.update(**random_change(random, session.choices, self._repertoire))
            self.changes += 1
        self.plucks += 1
        stage.window.pluck_asked.emit()
        if random.random() < 0.2:
            stage.controller.player.seek(random.uniform(0, session.choices.seconds))
        if random.random() < 0.05:
            stage.window.play_asked.emit()  # stops it
        if random.random() < 0.1:
            random.choice((stage.window.undo_asked, stage.window.redo_asked)).emit()


class _Watch(QObject):
    """Looks at the player and at the window's own pace often, at memory every second."""

    def __init__(self, stage: Stage, seconds: float, report: Callable[[float, str], None]) -> None:
        super().__init__(stage.window)
        self.looks = self.waiting = 0
        self.longest_stall_s = 0.0
        self.peak_mib = 0.0
        self._stage, self._seconds, self._report = stage, seconds, report
        self._begun_s = self._looked_s = self._weighed_s = time.monotonic()
        self._timer = QTimer(self, interval=round(1000 * LOOK_EVERY_S))
        self._timer.timeout.connect(self._look)
        self._timer.start()

    def stop(self) -> None:
        self._timer.stop()

    def _look(self) -> None:
        now_s = time.monotonic()
        self.longest_stall_s = max(self.longest_stall_s, now_s - self._looked_s - LOOK_EVERY_S)
        self._looked_s = now_s
        self.looks += 1
        self.waiting += self._stage.controller.player.status().waiting
        if now_s - self._weighed_s >= min(WEIGH_EVERY_S, self._seconds / 10):
            self._weighed_s, weight_mib = now_s, _resident_mib()
            self.peak_mib = max(self.peak_mib, weight_mib)
            share = min(1.0, (now_s - self._begun_s) / self._seconds)
            self._report(share, f"{weight_mib:.0f} MiB")


def _weighed_at_rest(stage: Stage) -> float:
    """Resident memory in MiB with one short pluck on stage, always the same; the user's choices come back."""
    session = stage.controller.session
    before = session.choices
    rest = Choices(preset=stage.controller.library.entries[0].name, seconds=REST_PLUCK_S)
    stage.controller.player.stop()
    stage.window.error_label.clear()
    session.update(**rest.model_dump())
    stage.controller.pluck()
    stage.wait_until_rendered()
    stage.controller.player.stop()
    stage.run_for(REST_S)
    gc.collect()
    weight_mib = _resident_mib()
    session.update(**before.model_dump())
    return weight_mib


@contextmanager
def collected_faults() -> Iterator[Counter[str]]:
    """Collects what would be printed: exceptions of slots and threads, warnings of Python and Qt."""
    found: Counter[str] = Counter()

    def failed(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        found["".join(traceback.format_exception(kind, error, trace))] += 1

    def thread_failed(arguments: threading.ExceptHookArgs) -> None:
        if arguments.exc_value is not None:
            failed(arguments.exc_type, arguments.exc_value, arguments.exc_traceback)

    def qt_said(kind: QtMsgType, context: QMessageLogContext, message: str) -> None:
        if kind not in (QtMsgType.QtDebugMsg, QtMsgType.QtInfoMsg):
            found[f"Qt: {message}"] += 1

    before = sys.excepthook, threading.excepthook, qInstallMessageHandler(qt_said)
    sys.excepthook, threading.excepthook = failed, thread_failed
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("default")
            yield found
            found.update(f"{w.category.__name__}: {w.message} ({w.filename}:{w.lineno})" for w in warned)
    finally:
        sys.excepthook, threading.excepthook = before[:2]
        qInstallMessageHandler(before[2])


def _underruns(card: PretendedCard) -> tuple[int, int]:
    assert card.output is not None
    assert card.stream is not None
    return card.output.underruns, card.stream.late


def _resident_mib() -> float:
    return float(psutil.Process().memory_info().rss) / MIB
