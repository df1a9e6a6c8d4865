"""A panel's own thread for what takes longer than a few milliseconds.

Only the latest job is done: starting another abandons the one under way. Results reach the window's thread through
queued signals; nothing of an abandoned job arrives any more.

Jobs give way to playing and drawing: they compute on one core at a low priority, and pause between their pieces,
while a pluck is rendered, and while the panel is hidden.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import ClassVar

import torch
from PySide6.QtCore import QObject, Qt, Signal, Slot

from app.analysis.job import Cancelled, Job
from app.rendering import Take
from app.shared.thread_priority import Rank, step_back
from engine.presets import PresetError

BREATH_S = 0.001  # between pieces of a job
LOOK_AGAIN_S = 0.02
GIVEN_UP_S = 0.5  # a take that has not grown for so long is not waited for
UNSEEN_S = 1.0  # a panel for which `look` was not called for so long is hidden
REPORT_EVERY_S = 0.1  # shares of progress; results are reported at once

Work = Callable[[Job], object]


@dataclass(frozen=True)
class _Task:
    """A job and its number. `check` and `report` raise Cancelled where it was abandoned."""

    number: int
    work: Work
    owner: Background

    def check(self) -> None:
        self.owner.give_way(self)
        if self.owner.is_abandoned(self.number):
            raise Cancelled

    def report(self, share: float, so_far: object = None) -> None:
        time.sleep(BREATH_S)
        self.check()
        self.owner.tell_progress(self.number, share, so_far)


class Background(QObject):
    """All public methods belong to the thread that made it, where its signals arrive too.

    Its own thread starts with the first job.
    """

    progressed = Signal(float, object)  # share of the job, and a result so far or None
    finished = Signal(object)
    failed = Signal(str, str)  # message, details

    _said = Signal(int, str, tuple)  # number of the job, which signal, its arguments

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._name = name
        self._mailbox = threading.Condition()
        self._task: _Task | None = None
        self._number = 0  # of the latest job
        self._busy = False
        self._closing = False
        self._thread: threading.Thread | None = None
        self._last_report_s = 0.0
        self._growing: Take | None = None
        self._seen_s = time.monotonic()
        self._threads = _OneCore(torch.get_num_threads())
        self._said.connect(self._pass_on, Qt.ConnectionType.QueuedConnection)

    def give_way_to(self, take: Take) -> None:
        """Pauses jobs while this take is rendered."""
        self._growing = take

    def look(self) -> None:
        """To be called while the panel is visible; UNSEEN_S after the last call jobs pause."""
        self._seen_s = time.monotonic()

    @property
    def busy(self) -> bool:
        """Whether the latest job has been started and its end has not arrived yet."""
        return self._busy

    def start(self, work: Work) -> None:
        """Does `work` as soon as the job under way has given up; `finished` has its return value."""
        self.look()
        with self._mailbox:
            self._number += 1
            self._task = _Task(self._number, work, self)
            self._mailbox.notify()
        self._busy = True
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def cancel(self) -> None:
        """Abandons the job under way, if there is one."""
        with self._mailbox:
            self._number += 1
            self._task = None
        self._busy = False

    def close(self) -> None:
        """Ends the thread, waiting 10 s at most; may be called again."""
        self.cancel()
        with self._mailbox:
            self._closing = True
            self._mailbox.notify()
        if self._thread is not None:
            self._thread.join(10)

    @Slot(int, str, tuple)
    def _pass_on(self, number: int, what: str, arguments: tuple[object, ...]) -> None:
        if number != self._number or self._closing:
            return
        if what != "progressed":
            self._busy = False
        getattr(self, what).emit(*arguments)

    # All below runs in the thread.

    def is_abandoned(self, number: int) -> bool:
        return number != self._number

    def give_way(self, task: _Task) -> None:
        """Returns when the panel is visible and no pluck is being rendered, or the job is abandoned."""
        while time.monotonic() - self._seen_s > UNSEEN_S and not self.is_abandoned(task.number):
            time.sleep(LOOK_AGAIN_S)
        ready_frames, since_s = -1, time.monotonic()
        while (take := self._growing) is not None and not take.complete and not self.is_abandoned(task.number):
            now_s = time.monotonic()
            if take.ready_frames != ready_frames:
                ready_frames, since_s = take.ready_frames, now_s
            elif now_s - since_s > GIVEN_UP_S:  # its rendering was abandoned, or failed
                self._growing = None if self._growing is take else self._growing
                return
            time.sleep(LOOK_AGAIN_S)

    def tell_progress(self, number: int, share: float, so_far: object) -> None:
        now_s = time.monotonic()
        if so_far is not None or now_s - self._last_report_s >= REPORT_EVERY_S:
            self._last_report_s = now_s
            self._said.emit(number, "progressed", (share, so_far))

    def _run(self) -> None:
        step_back(Rank.BACKGROUND)
        while True:
            with self._mailbox:
                self._mailbox.wait_for(lambda: self._task is not None or self._closing)
                if self._closing:
                    return
                task, self._task = self._task, None
            assert task is not None
            try:
                with self._threads.held():
                    result = task.work(task)
                self._said.emit(task.number, "finished", (result,))
            except Cancelled:
                pass
            except PresetError as error:
                self._said.emit(task.number, "failed", (str(error), ""))
            except Exception as error:  # shown to the user; the thread goes on
                self._said.emit(task.number, "failed", (f"Computing failed: {error}", traceback.format_exc()))
            del task  # it may hold a take


class _OneCore:
    """While any job is under way, torch computes on one core; then the usual number is set again.

    PyTorch's number of threads belongs partly to the calling thread and partly to the process, so whoever ends last
    puts it back.
    """

    _lock: ClassVar = threading.Lock()
    _holders: ClassVar[int] = 0

    def __init__(self, usual: int) -> None:
        self._usual = usual

    @contextmanager
    def held(self) -> Iterator[None]:
        with _OneCore._lock:
            _OneCore._holders += 1
            torch.set_num_threads(1)
        try:
            yield
        finally:
            with _OneCore._lock:
                _OneCore._holders -= 1
                if _OneCore._holders == 0:
                    torch.set_num_threads(self._usual)
