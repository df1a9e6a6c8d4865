"""What the render worker says, carried into the window's thread (Qt queues the signals)."""

from __future__ import annotations

from PySide6.QtCore import QObject, Signal

from app.audio import Track
from app.rendering import Take
from app.strikes import Strikes
from engine.metrics import ErrorSums


class RenderMail(QObject):
    """Its methods are called in the worker's thread; see `RenderListener`."""

    started = Signal(object, object, bool)  # take, track, whether it sounds already
    replaced = Signal(object, object)
    finished = Signal(object, object)
    other_refused = Signal(str, str)
    failed = Signal(str, str)

    def __init__(self, strikes: Strikes) -> None:
        super().__init__()
        self._strikes = strikes

    def sound_started(self, take: Take, track: Track) -> bool:
        return self._strikes.begin(take, track)

    def take_started(self, take: Take, track: Track, sounds: bool) -> None:
        self.started.emit(take, track, sounds)

    def track_replaced(self, take: Take, track: Track) -> None:
        self.replaced.emit(take, track)

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        self.finished.emit(take, errors)

    def other_failed(self, preset: str, message: str) -> None:
        self.other_refused.emit(preset, message)

    def render_failed(self, message: str, detail: str) -> None:
        self.failed.emit(message, detail)
