"""The log: a file of a few megabytes at most with every unexpected exception, for a report of a fault.

A crash (a fault in compiled code) writes the stack of each thread to a file beside it.
"""

from __future__ import annotations

import faulthandler
import logging
import os
import platform
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from logging.handlers import RotatingFileHandler
from pathlib import Path
from types import TracebackType
from typing import ParamSpec

from platformdirs import user_log_path

from app.shared.version import PROGRAM, program_version

LARGEST_BYTES = 2**20
OLDER_KEPT = 2  # earlier log files
MOST_KINDS = 200  # different exceptions that are written in one run
FILE_VARIABLE = "LEARNED_STRINGS_LOG"

P = ParamSpec("P")
_log = logging.getLogger("learned_strings")


def log_file() -> Path:
    """The path in LEARNED_STRINGS_LOG, else `learned-strings.log` in the platform's folder for a user's logs."""
    path = os.environ.get(FILE_VARIABLE)
    return Path(path) if path else user_log_path("learned-strings", appauthor=False) / "learned-strings.log"


@contextmanager
def faults_logged(report: Callable[[str], None]) -> Iterator[None]:
    """Write uncaught exceptions of any thread to the log while it is open, each different one once.

    A log that cannot be opened is done without.

    Args:
        `report`: called with the text of each of them, in the thread where it was raised.
    """
    handler = _open(log_file())
    before = sys.excepthook, threading.excepthook
    known: set[str] = set()  # texts that are in the log already

    def note(kind: type[BaseException], error: BaseException | None, trace: TracebackType | None, where: str) -> None:
        text = f"{where}\n{''.join(traceback.format_exception(kind, error, trace))}"
        if text not in known and len(known) < MOST_KINDS:  # one that is raised at every frame would fill the log
            known.add(text)
            _log.error("%s", text)
            report(text)

    def of_main(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        before[0](kind, error, trace)
        if issubclass(kind, Exception):  # an interrupt is no fault
            note(kind, error, trace, f"in the thread {threading.current_thread().name}")

    def of_thread(arguments: threading.ExceptHookArgs) -> None:
        if issubclass(arguments.exc_type, SystemExit):
            return
        before[1](arguments)
        name = arguments.thread.name if arguments.thread else "unknown"
        note(arguments.exc_type, arguments.exc_value, arguments.exc_traceback, f"in the thread {name}")

    sys.excepthook, threading.excepthook = of_main, of_thread
    try:
        yield
    finally:
        sys.excepthook, threading.excepthook = before
        if handler is not None:
            _log.removeHandler(handler)
            handler.close()


@contextmanager
def crashes_written() -> Iterator[None]:
    """Write the stack of each thread at a crash to a file beside the log, with the suffix `.crash`."""
    path = log_file().with_suffix(".crash")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("w" if path.exists() and path.stat().st_size > LARGEST_BYTES else "a")
    except OSError:
        yield
        return
    with file:
        faulthandler.enable(file)
        try:
            yield
        finally:
            faulthandler.disable()


def log_fault(error: BaseException, where: str) -> str:
    """Write an exception that was caught to the log, and return what was written.

    Args:
        where: a line before it: what was being done.
    """
    text = f"{where}\n{''.join(traceback.format_exception(error))}"
    _log.error("%s", text)
    return text


def faultless(work: Callable[P, object], where: str) -> Callable[P, None]:
    """The work, whose exceptions are written to the log and go no further: what it reports to must not stop sound."""

    def guarded(*values: P.args, **named: P.kwargs) -> None:
        try:
            work(*values, **named)
        except Exception as error:
            log_fault(error, where)

    return guarded


def _open(path: Path) -> logging.Handler | None:
    """Open the log, write a line of versions, and return the log's handler; None: it cannot be opened."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handler = RotatingFileHandler(
            path, maxBytes=LARGEST_BYTES, backupCount=OLDER_KEPT, encoding="utf-8", errors="backslashreplace"
        )
    except OSError:
        return None
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    _log.addHandler(handler)
    _log.setLevel(logging.INFO)
    _log.propagate = False
    _log.info("%s %s, Python %s, %s", PROGRAM, program_version(), platform.python_version(), platform.platform())
    return handler
