"""Settings are saved soon after each change, so that a process that is killed loses the last seconds at most."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Signal

from app.window.settings import Settings, save_settings


class SettingsSaver(QObject):
    """A writer of the settings: those that changed and then stayed for one look are written.

    Of two instances the one that writes last is remembered.

    Args:
        current: what is to be remembered, as it is now.
    """

    failed = Signal(str)  # once: why the file cannot be written

    def __init__(self, path: Path, read: Settings, current: Callable[[], Settings], parent: QObject) -> None:
        super().__init__(parent)
        self._path, self._current = path, current
        self._base = self._seen = read
        self._writing: threading.Thread | None = None
        self._reported = False

    def look(self) -> None:
        """Write, in a thread of its own, where the settings have changed, but not since the last look."""
        now = self._current()
        rested, self._seen = now == self._seen, now
        if not rested or now == self._base or (self._writing is not None and self._writing.is_alive()):
            return
        self._writing = threading.Thread(target=self._write, args=(now,), name="settings")
        self._writing.start()

    def close(self) -> None:
        """Write what has not been written yet."""
        if self._writing is not None:
            self._writing.join()
        now = self._current()
        if now != self._base or not self._path.exists():
            self._write(now)

    def _write(self, now: Settings) -> None:
        try:
            save_settings(self._path, now)
            self._base = now  # not where it failed: it is tried again
        except OSError as error:
            if not self._reported:  # once: it would come again with every change
                self._reported = True
                self.failed.emit(f"The settings {self._path} cannot be written ({error.strerror or error}).")
