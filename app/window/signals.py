"""Signals that ask a process to end: a logout, a closed terminal, Ctrl+C."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from PySide6.QtCore import QTimer

LOOK_MS = 100
SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGINT", "SIGBREAK") if hasattr(signal, name)]


@contextmanager
def asked_to_end(end: Callable[[], None]) -> Iterator[None]:
    """Let the first of SIGNALS call `end` in Qt's event loop; a second one has its usual effect.

    A timer runs Python now and then: Qt alone would not notice a signal before the next event.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before: dict[int, Any] = {}

    def restore() -> None:
        while before:
            signal.signal(*before.popitem())

    def take(*_: object) -> None:
        restore()
        QTimer.singleShot(0, end)

    before |= {number: signal.signal(number, take) for number in SIGNALS}
    pulse = QTimer(interval=LOOK_MS)
    pulse.timeout.connect(lambda: None)
    pulse.start()
    try:
        yield
    finally:
        pulse.stop()
        restore()
