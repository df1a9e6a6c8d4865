"""A restless user, or one who plays without a pause, for minutes; and whether the app bears it.

Everything happens as by a user's hands, through window, session and controller. The sound goes through PortAudio into
a private sound card; all that it was given is recorded, by a process of its own, and looked at for holes. What is
random follows from the seed.

The restless user rests after each minute on the same short pluck, and the process is weighed: in between, motions of
up to hundreds of MiB come and go with what is chosen. Who plays does not rest: the process is weighed at the end of
each minute.
"""

from __future__ import annotations

import gc
import statistics
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import TracebackType

import numpy as np
import psutil
from PySide6.QtCore import (
    QCoreApplication,
    QEvent,
    QMessageLogContext,
    QObject,
    Qt,
    QTimer,
    QtMsgType,
    Signal,
    qInstallMessageHandler,
)
from PySide6.QtGui import QKeyEvent

from app.audio.choices import Buffer, SoundChoice
from app.patches.instrument import SingleString
from app.patches.library import list_patches
from app.session.choices import Choices
from app.window.main_window import MainWindow
from app.window.panels.rack import LEFT, RIGHT
from app.window.settings import Settings
from tests.bench.machine import Machine
from tests.bench.play import analysis, hands
from tests.bench.play.children import Missing, need_programs
from tests.bench.play.control import late_wakes_ms, steady_tone_aside
from tests.bench.play.recording import recording_aside
from tests.bench.play.sound_server import RATE_HZ, sound_server
from tests.bench.printing import target
from tests.bench.random_changes import Repertoire, random_change
from tests.bench.stage import Stage, opened

PROGRAMS = ("pulseaudio", "pacat", "parec")
SIZE = (1280, 800)
EVERY_S = 0.5
RATE_OF_PLAYING_HZ = 12.0
LOOK_EVERY_S = 0.02
WEIGH_EVERY_S = 1.0
PART_S = 60.0  # between two rests; in the first, every kind of thing is loaded once, and caches are filled
WEIGHED_S = 10.0  # of a minute that is played: garbage comes and goes
REST_S = 3.0  # in which the views finish and free memory is given back
REST_PLUCK_S = 1.0
MOST_CHANGES = 3  # before a pluck
MIB = 2**20


@dataclass(frozen=True)
class Holes:
    """What the recording and the app itself tell of silences that nobody asked for.

    Attributes:
        heard: in the recording: of one who plays all silences, of a restless user those that begin or end at once.
        heard_ms, longest_ms: of them together, and of the longest.
        heard_at_s: since the recording began.
        `told`: by the app's mixer, by cause; of very many the latest.
        control: of a steady tone that another process plays meanwhile in the same way: the machine's, not the app's.
        late: how often a thread of that process which only wakes, in real time, was later than 3 ms.
        latest_ms: by how much at most; 0 where never.
    """

    seconds: float
    heard: int = field(metadata=target(0))
    heard_ms: float = field(metadata=target(0))
    longest_ms: float = field(metadata=target(0))
    heard_at_s: tuple[float, ...]
    reported: dict[str, int]
    control: int
    control_ms: float
    late: int
    latest_ms: float

    @property
    def a_minute(self) -> float:
        return 60 * self.heard / self.seconds


@dataclass(frozen=True)
class Soak:
    """What came of it.

    Attributes:
        longest_stall_s: for which the window did nothing.
        memory_mib: resident memory at each rest, or at the end of each minute that is played.
        settled_mib, end_mib: the first and the last of them.
        drift_mib: how far any other was from the first, above or below.
        peak_mib: the most that it ever was, with all.
        threads_left: names of those that outlived the window.
        faults: tracebacks of exceptions, whether the app showed them or nobody caught them, and warnings of Python
            and of Qt; each once, with its number.
        notices: all that the app showed its user, with how often.
    """

    machine: Machine
    platform: str
    seed: int
    playing: bool
    buffer: Buffer
    seconds: float
    plucks: int
    changes: int
    holes: Holes
    longest_stall_s: float = field(metadata=target(0.1))
    memory_mib: tuple[float, ...]
    settled_mib: float
    end_mib: float
    drift_mib: float = field(metadata=target(20))
    peak_mib: float
    threads_left: tuple[str, ...]
    faults: tuple[tuple[str, int], ...]
    notices: tuple[tuple[str, int], ...]


def soak(seconds: float, seed: int, playing: bool, buffer: Buffer, report: Callable[[float, str], None]) -> Soak:
    """The window for so long, then closed. `playing`: without a pause, instead of restlessly. `buffer`: the device's.

    Raises:
        Missing: a program is not there, or the app does not play into the private sound card.
    """
    need_programs(*PROGRAMS)
    threads_before = set(threading.enumerate())
    settings = Settings(sound=SoundChoice(rate_hz=RATE_HZ, buffer=buffer))
    random = Random(seed)
    with tempfile.TemporaryDirectory(prefix="soak") as folder, sound_server(Path(folder)) as server, server.adopted():
        file = Path(folder) / "recording"
        with collected_faults() as faults, opened(settings, SIZE) as stage:
            if stage.controller.sound.status().device is None:
                raise Missing(f"the app plays no sound ({stage.window.notices.text}); install libasound2-plugins")
            memory_mib: list[float] = []
            watch = _Watch(stage, seconds, report)
            gaps_before = len(stage.controller.sound.status().gaps)
            with (
                steady_tone_aside(server, Path(folder), buffer) as tone,
                recording_aside(server, file),
            ):
                if playing:
                    changes, plucks = 0, _play(stage, random, seconds)
                else:
                    changes, plucks = _be_restless(stage, random, seconds, memory_mib)
                gaps = stage.controller.sound.status().gaps[gaps_before:]
            watch.stop()
            if playing:
                memory_mib = watch.at_each_minute()
            notices, platform = stage.window.notices.notices, stage.platform
            faults.update({notice.details: notice.times for notice in notices if "Traceback" in notice.details})
        late_ms = late_wakes_ms(Path(folder))
        holes = _holes(file, tone, playing, Counter(gap.cause for gap in gaps), late_ms)
    left = [thread.name for thread in threading.enumerate() if thread not in threads_before]
    return Soak(
        Machine.here(),
        platform,
        seed,
        playing,
        buffer,
        seconds,
        plucks,
        changes,
        holes,
        watch.longest_stall_s,
        tuple(memory_mib),
        memory_mib[0],
        memory_mib[-1],
        max(abs(mib - memory_mib[0]) for mib in memory_mib),
        watch.peak_mib,
        tuple(sorted(left)),
        tuple(faults.items()),
        tuple((notice.message, notice.times) for notice in notices),
    )


def _holes(file: Path, tone: Path, playing: bool, reported: Counter[str], late_ms: list[float]) -> Holes:
    sound, control = (np.memmap(each, np.float32, "r", shape=(each.stat().st_size // 4,)) for each in (file, tone))
    found = [silence for silence in analysis.silences(sound, RATE_HZ) if playing or silence.sharp]
    lengths_ms = [1000 * silence.frames / RATE_HZ for silence in found]
    controls_ms = [1000 * silence.frames / RATE_HZ for silence in analysis.silences(control, RATE_HZ)]
    return Holes(
        len(sound) / RATE_HZ,
        len(found),
        sum(lengths_ms),
        max(lengths_ms, default=0.0),
        tuple(round(silence.start / RATE_HZ, 3) for silence in found),
        dict(reported),
        len(controls_ms),
        sum(controls_ms),
        len(late_ms),
        max(late_ms, default=0.0),
    )


def _play(stage: Stage, random: Random, seconds: float) -> int:
    """Press keys from another thread, as they come from outside; return how many."""
    steps_s = hands.steady(random, RATE_OF_PLAYING_HZ, seconds)
    thread = threading.Thread(target=hands.play, args=(_Keys(stage.window), random, steps_s), name="hands")
    thread.start()
    stage.wait_for(lambda: not thread.is_alive(), "the end of playing", seconds)
    stage.run_for(analysis.SOUNDS_S)
    return len(steps_s)


class _Keys(QObject):
    """A keyboard for another thread, whose keys come to the window by Qt's queue."""

    _pressed = Signal(str, bool)

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self._window = window
        self._pressed.connect(self._send, Qt.ConnectionType.QueuedConnection)

    def key(self, name: str, down: bool) -> float:
        """By the name of its sign; returns when it was sent."""
        now_s = time.monotonic()
        self._pressed.emit({"semicolon": ";"}.get(name, name), down)
        return now_s

    def _send(self, sign: str, down: bool) -> None:
        kind = QEvent.Type.KeyPress if down else QEvent.Type.KeyRelease
        event = QKeyEvent(kind, ord(sign.upper()), Qt.KeyboardModifier.NoModifier, sign)  # Qt's letters are ASCII's
        QCoreApplication.sendEvent(self._window.focusWidget() or self._window, event)


def _be_restless(stage: Stage, random: Random, seconds: float, memory_mib: list[float]) -> tuple[int, int]:
    """Return how many changes and plucks there were, and add what the process weighs at each rest."""
    user = _User(stage, random)
    parts = max(2, round(seconds / PART_S))
    for _ in range(parts):
        user.go_on()
        stage.run_for(seconds / parts)
        user.stop()
        memory_mib.append(_weighed_at_rest(stage))
    return user.changes, user.plucks


class _User(QObject):
    """Changes some choices, then plucks, stops, seeks or takes something back."""

    def __init__(self, stage: Stage, random: Random) -> None:
        super().__init__(stage.window)
        controller = stage.controller
        self.plucks = self.changes = 0
        self._stage, self._random = stage, random
        self._repertoire = Repertoire(
            tuple(controller.library.names),
            tuple(panel.key for panel in LEFT),
            tuple(panel.key for panel in RIGHT),
            tuple(e.patch for e in list_patches()[0] if controller.library.find(e.patch.preset) is not None),
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
            stage.controller.performance.seek(random.uniform(0, session.choices.seconds))
        if random.random() < 0.05:
            stage.window.action["play"].trigger()  # stops it
        if random.random() < 0.1:
            stage.window.action[random.choice(("undo", "redo"))].trigger()


class _Watch(QObject):
    """Looks at the window's own pace often, at memory every second."""

    def __init__(self, stage: Stage, seconds: float, report: Callable[[float, str], None]) -> None:
        super().__init__(stage.window)
        self.longest_stall_s = 0.0
        self._weights_mib: list[tuple[float, float]] = []  # and when, in s since the beginning
        self._seconds, self._report = seconds, report
        self._begun_s = self._looked_s = self._weighed_s = time.monotonic()
        self._timer = QTimer(self, interval=round(1000 * LOOK_EVERY_S))
        self._timer.timeout.connect(self._look)
        self._timer.start()

    def stop(self) -> None:
        self._timer.stop()

    @property
    def peak_mib(self) -> float:
        return max((mib for _, mib in self._weights_mib), default=_resident_mib())

    def at_each_minute(self) -> list[float]:
        """The medians of the last seconds of each minute, or, of less than two, of the halves of the time."""
        part_s = min(PART_S, self._seconds / 2)
        ends_s = [part_s * (number + 1) for number in range(round(self._seconds / part_s))]
        parts = [
            [mib for time_s, mib in self._weights_mib if end_s - min(WEIGHED_S, part_s) < time_s <= end_s]
            for end_s in ends_s
        ]
        return [statistics.median(part) for part in parts if part] or [_resident_mib()]

    def _look(self) -> None:
        now_s = time.monotonic()
        self.longest_stall_s = max(self.longest_stall_s, now_s - self._looked_s - LOOK_EVERY_S)
        self._looked_s = now_s
        if now_s - self._weighed_s >= min(WEIGH_EVERY_S, self._seconds / 10):
            self._weighed_s, weight_mib = now_s, _resident_mib()
            self._weights_mib.append((now_s - self._begun_s, weight_mib))
            share = min(1.0, (now_s - self._begun_s) / self._seconds)
            self._report(share, f"{weight_mib:.0f} MiB")


def _weighed_at_rest(stage: Stage) -> float:
    """Resident memory in MiB with one short pluck on stage, always the same; the user's choices come back."""
    session = stage.controller.session
    before = session.choices
    rest = Choices(instrument=SingleString(preset=stage.controller.library.entries[0].name), seconds=REST_PLUCK_S)
    stage.controller.performance.stop()
    session.update(**rest.model_dump())
    stage.controller.pluck()
    stage.wait_until_rendered()
    stage.controller.performance.stop()
    stage.run_for(REST_S)
    gc.collect()
    weight_mib = _resident_mib()
    session.update(**before.model_dump())
    return weight_mib


@contextmanager
def collected_faults() -> Iterator[Counter[str]]:
    """Collect what would be printed: exceptions of slots and threads, warnings of Python and Qt."""
    found: Counter[str] = Counter()

    def failed(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        found["".join(traceback.format_exception(kind, error, trace))] += 1

    def thread_failed(arguments: threading.ExceptHookArgs) -> None:
        if arguments.exc_value is not None:
            failed(arguments.exc_type, arguments.exc_value, arguments.exc_traceback)

    def qt_said(kind: QtMsgType, context: QMessageLogContext, message: str) -> None:
        lacks = message.startswith("This plugin does not support")  # a platform without windows
        if kind not in (QtMsgType.QtDebugMsg, QtMsgType.QtInfoMsg) and not lacks:
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


def _resident_mib() -> float:
    return float(psutil.Process().memory_info().rss) / MIB
