"""A `Worker` in Qt: what it says arrives as signals in the window's thread."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Qt, Signal, Slot

from app.shared.worker import Job, Work, Worker
from engine.presets import PresetError


class Background(QObject):
    """A worker of one job at a time, the latest.

    Methods are to be called in the thread that made it, where its signals arrive too.

    Args: see `Worker`.
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
        self._job: Job | None = None  # the one whose signals are passed on
        self._worker = Worker(
            name, lambda job, signal_name, *arguments: self._said.emit(job, signal_name, arguments), expected, rests
        )
        self._said.connect(self._pass_on, Qt.ConnectionType.QueuedConnection)

    @property
    def busy(self) -> bool:
        """Return True if the latest job has been started and its end has not arrived yet."""
        return self._job is not None

    def start(self, work: Work) -> None:
        """Do `work` as soon as the job under way has given up; `finished` has its return value."""
        self._job = self._worker.start(work)

    def stop(self) -> None:
        """Ask the job under way to end; its end is still reported."""
        self._worker.cancel()

    def cancel(self) -> None:
        """Abandon the job under way: nothing of it arrives any more."""
        self._worker.cancel()
        self._job = None

    def close(self, seconds: float | None = 10.0, *, cancel: bool = True) -> None:
        """Abandon the job and end the thread, as `Worker.close`; may be called again."""
        self._job = None
        self._worker.close(seconds, cancel=cancel)

    @Slot(object, str, tuple)
    def _pass_on(self, job: Job, signal_name: str, arguments: tuple[object, ...]) -> None:
        """Emit the signal of this name for the latest job; drop what an abandoned one still reports."""
        if job is not self._job:
            return
        if signal_name != "progressed":
            self._job = None
        getattr(self, signal_name).emit(*arguments)
