"""Settings are saved soon after each change, so that a process that is killed loses the last seconds at most."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Signal

from app.views.background import Background
from app.window.settings import Settings, save_settings


class SettingsSaver(QObject):
    """A writer of the settings: those that changed and then stayed for one look are written.

    Of two instances the one that writes last is remembered.

    Args:
        path: of the settings' file.
        read: the settings as they were read from it.
        current: gives those that are to be remembered, as they are now.
    """

    failed = Signal(str)  # once: why the file cannot be written

    def __init__(self, path: Path, read: Settings, current: Callable[[], Settings], parent: QObject) -> None:
        super().__init__(parent)
        self._path, self._current = path, current
        self._base = self._seen = read  # as in the file; as at the last look
        self._background = Background("settings", self)
        self._reported = False  # `failed` was emitted

    def look(self) -> None:
        """Write, in the background, where the settings have changed, but not since the last look."""
        now = self._current()
        rested, self._seen = now == self._seen, now
        if rested and now != self._base and not self._background.busy:
            self._background.start(lambda job: self._write(now))

    def close(self) -> None:
        """Write what has not been written yet."""
        self._background.close(None, cancel=False)
        now = self._current()
        if now != self._base or not self._path.exists():
            self._write(now)

    def _write(self, now: Settings) -> None:
        """Write the settings; report a failure the first time, and try again later."""
        try:
            save_settings(self._path, now)
            self._base = now  # not where it failed: it is tried again
        except OSError as error:
            if not self._reported:  # once: it would come again with every change
                self._reported = True
                self.failed.emit(f"The settings {self._path} cannot be written ({error.strerror or error}).")
