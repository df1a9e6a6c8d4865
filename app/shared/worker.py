"""Long work with progress and cancelling.

Work is a function of a `Job`. It calls `Job.report` a few times a second, which ends it where it is not wanted any
more.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

BREATH_S = 0.001  # between pieces of a job, so that other threads get their turn
LOOK_AGAIN_S = 0.02  # while a job rests
REPORT_EVERY_S = 0.05  # shares of progress; results so far are reported at once


class Cancelled(Exception):
    """The result of a computation is no longer wanted."""


class Progress(Protocol):
    """A function that long work calls; it may raise `Cancelled`, which ends the work. `Job.progress` is one."""

    def __call__(self, share: float, text: str = "", left_s: float | None = None, /) -> None:
        """Report the done share, 0 … 1, the present step in words, and the seconds left; None: not known."""


class Job:
    """A piece of work under way.

    Args:
        say: is called in the worker's thread with the job, a signal's name and its arguments.
        rests: whether the job is to wait where it is.
    """

    def __init__(self, say: Callable[..., None] = lambda *_: None, rests: Callable[[], bool] = lambda: False) -> None:
        self._say, self._rests = say, rests
        self._stop = threading.Event()
        self._reported_s = 0.0

    def cancel(self) -> None:
        """Ask the work to end at its next call; return at once."""
        self._stop.set()

    def wait(self, seconds: float = 0.0) -> None:
        """Wait, less where the job is cancelled.

        Raises:
            Cancelled: the result is no longer wanted.
        """
        if self._stop.wait(seconds):
            raise Cancelled

    def check(self) -> None:
        """Return when the job may continue.

        Raises:
            Cancelled: see `wait`.
        """
        self.wait()
        while self._rests():
            self.wait(LOOK_AGAIN_S)

    def report(self, share: float, text: str = "", so_far: object = None) -> None:
        """Report the share that is done, 0 … 1, the present step, and a result that can be shown already.

        Raises:
            Cancelled: see `wait`.
        """
        self.wait(BREATH_S)
        self._report(share, text, so_far, at_once=so_far is not None)

    def progress(self, share: float, text: str = "", left_s: float | None = None, /) -> None:
        """Report as a `Progress`, without a breath: for compiled work. In place of a result: the seconds left.

        Raises:
            Cancelled: see `wait`.
        """
        self._report(share, text, left_s)

    def _report(self, share: float, text: str, more: object, at_once: bool = False) -> None:
        self.check()
        now_s = time.monotonic()
        if at_once or now_s - self._reported_s >= REPORT_EVERY_S:
            self._reported_s = now_s
            self._say(self, "progressed", share, text, more)


Work = Callable[[Job], Any]
