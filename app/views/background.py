"""Long work in a thread of its own, the latest alone; what it says arrives as signals in the window's thread."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable

from PySide6.QtCore import QObject, Qt, Signal, Slot

from app.shared.thread_priority import Rank, lower_priority
from app.shared.worker import Cancelled, Job, Work
from engine.presets import PresetError


class Background(QObject):
    """A worker of one job at a time, the latest; its thread starts with the first.

    Methods belong to the thread that made it, where its signals arrive too. One signal ends each job.

    Args:
        name: of the thread.
        expected: errors whose message is for the user; of any other the details have the traceback.
        rests: see `Job`.
    """

    progressed = Signal(float, str, object)  # share of the job, what is done, a result so far, seconds left, or None
    finished = Signal(object)
    failed = Signal(str, str)  # message, details
    cancelled = Signal()  # the job gave up after `stop`

    _said = Signal(object, str, tuple)  # the job, which signal, its arguments

    def __init__(
        self,
        name: str,
        parent: QObject | None = None,
        *,
        expected: tuple[type[Exception], ...] = (PresetError,),
        rests: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(parent)
        self._name, self._expected, self._rests = name, expected, rests
        self._mailbox = threading.Condition()
        self._next: tuple[Job, Work] | None = None
        self._latest: Job | None = None
        self._job: Job | None = None  # the one whose signals are passed on
        self._closing = False
        self._thread: threading.Thread | None = None
        self._said.connect(self._pass_on, Qt.ConnectionType.QueuedConnection)

    @property
    def busy(self) -> bool:
        """Return True if the latest job has been started and its end has not arrived yet."""
        return self._job is not None

    def start(self, work: Work) -> None:
        """Do `work` as soon as the job under way has given up; `finished` has its return value."""
        self.stop()
        self._job = self._latest = job = Job(self._say, self._rests)
        with self._mailbox:
            self._next = job, work
            self._mailbox.notify()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Ask the job under way to end, which is still reported; one that waits is not begun."""
        if self._latest is not None:
            self._latest.cancel()

    def cancel(self) -> None:
        """Abandon the job under way: nothing of it arrives any more."""
        self.stop()
        self._job = None

    def close(self, seconds: float | None = 10.0, *, cancel: bool = True) -> None:
        """Abandon the job and end the thread, waiting so long (None: as it takes); may be called again.

        `cancel`: whether a job under way is cancelled, and not waited for to its end.
        """
        self._job = None
        if cancel:
            self.stop()
        with self._mailbox:
            self._closing = True
            self._mailbox.notify()
        if self._thread is not None:
            self._thread.join(seconds)

    @Slot(object, str, tuple)
    def _pass_on(self, job: Job, signal_name: str, arguments: tuple[object, ...]) -> None:
        if job is not self._job:
            return
        if signal_name != "progressed":
            self._job = None
        getattr(self, signal_name).emit(*arguments)

    # All below runs in the worker's thread.

    def _say(self, job: Job, signal_name: str, *arguments: object) -> None:
        self._said.emit(job, signal_name, arguments)

    def _run(self) -> None:
        lower_priority(Rank.BACKGROUND)
        while True:
            with self._mailbox:
                self._mailbox.wait_for(lambda: self._next is not None or self._closing)
                if self._next is None:
                    return
                (job, work), self._next = self._next, None
            try:
                job.wait()
                result = work(job)
                self._say(job, "finished", result)
            except Cancelled:
                self._say(job, "cancelled")
            except self._expected as error:
                self._say(job, "failed", str(error), "")
            except Exception as error:  # shown to the user; the thread continues
                self._say(job, "failed", f"Computing failed: {error}", traceback.format_exc())
            result = None
            del job, work  # they may hold a take
