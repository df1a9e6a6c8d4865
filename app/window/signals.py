"""Signals that ask a process to end: a logout, a closed terminal, Ctrl+C."""

from __future__ import annotations

import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from PySide6.QtCore import QSocketNotifier

SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGINT", "SIGBREAK") if hasattr(signal, name)]


@contextmanager
def asked_to_end(end: Callable[[], None]) -> Iterator[None]:
    """Let the first of SIGNALS call `end` in Qt's event loop; a second one has its usual effect.

    Python alone would not notice it before the next line of Python is run.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    woken, waker = socket.socketpair()
    for end_socket in (woken, waker):
        end_socket.setblocking(False)
    before = {number: signal.signal(number, lambda *_: None) for number in SIGNALS}
    waker_before = signal.set_wakeup_fd(waker.fileno(), warn_on_full_buffer=False)

    def restore() -> None:
        signal.set_wakeup_fd(waker_before)
        for number, handler in before.items():
            signal.signal(number, handler)

    def take() -> None:
        notifier.setEnabled(False)
        restore()
        end()

    notifier = QSocketNotifier(woken.fileno(), QSocketNotifier.Type.Read)
    notifier.activated.connect(take)
    try:
        yield
    finally:
        notifier.setEnabled(False)
        restore()
        woken.close()
        waker.close()
