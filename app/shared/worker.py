"""A thread of its own for long work, with progress and cancelling; the latest work alone is done.

Work is a function of a `Job`. It calls `Job.report` a few times a second, which ends it where it is not wanted any
more.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from typing import Any, Protocol

from app.shared.thread_priority import Rank, lower_priority

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
        self._stop = threading.Event()  # set: cancelled
        self._reported_s = 0.0  # when progress was last reported, by `time.monotonic`; 0: never

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
        """Say "progressed", but not more often than every REPORT_EVERY_S unless `at_once`.

        `more`: the third argument of that signal, a result so far or the seconds left.
        """
        self.check()
        now_s = time.monotonic()
        if at_once or now_s - self._reported_s >= REPORT_EVERY_S:
            self._reported_s = now_s
            self._say(self, "progressed", share, text, more)


Work = Callable[[Job], Any]


class Worker:
    """A worker that does one job at a time, the latest; its thread starts with the first.

    Args:
        name: of the thread.
        say: see `Job`. Signals are "progressed" (share, text, result so far). One ends each job: "finished" (the
            result), "failed" (message, details) or "cancelled".
        expected: errors whose message is for the user; of any other the details have the traceback.
        rests: see `Job`.
        rank: the priority of the thread.
        doing: the word before "failed" in the message of an unexpected error.
    """

    def __init__(
        self,
        name: str,
        say: Callable[..., None],
        expected: tuple[type[Exception], ...] = (),
        rests: Callable[[], bool] = lambda: False,
        *,
        rank: Rank = Rank.BACKGROUND,
        doing: str = "Computing",
    ) -> None:
        self._name = name
        self._say = say
        self._expected = expected
        self._rests = rests
        self._rank = rank
        self._doing = doing
        self._mailbox = threading.Condition()  # guards `_next` and `_closing`
        self._next: tuple[Job, Work] | None = None  # not yet begun; None: nothing waits
        self._job: Job | None = None  # the latest
        self._closing = False
        self._thread: threading.Thread | None = None

    def start(self, work: Work) -> Job:
        """Do `work` as soon as the job under way has given up."""
        self.cancel()
        job = Job(self._say, self._rests)
        with self._mailbox:
            self._job, self._next = job, (job, work)
            self._mailbox.notify()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()
        return job

    def cancel(self) -> None:
        """Ask the job under way to end; one that waits is not begun."""
        if self._job is not None:
            self._job.cancel()

    def close(self, seconds: float | None = 10.0, *, cancel: bool = True) -> None:
        """End the thread, waiting so long for it (None: as long as it takes); may be called again.

        `cancel`: whether a job under way is cancelled, and not waited for to its end.
        """
        if cancel:
            self.cancel()
        with self._mailbox:
            self._closing = True
            self._mailbox.notify()
        if self._thread is not None:
            self._thread.join(seconds)

    def _run(self) -> None:
        """Do the jobs of the mailbox, one after the other, until `close`; the worker's thread."""
        lower_priority(self._rank)
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
                self._say(job, "failed", f"{self._doing} failed: {error}", traceback.format_exc())
            result = None
            del job, work  # they may hold a take
