"""Calls of the threads that render and play, carried into the window's thread: Qt queues the signals."""

from __future__ import annotations

from PySide6.QtCore import QObject, Signal

from app.rendering import BlowTake, Take


class RenderSignals(QObject):
    """Signals of the rendering, whose methods are called in other threads; see `RenderListener`."""

    started = Signal(object)  # Take or BlowTake
    finished = Signal(object)  # the same
    other_refused = Signal(str, str)  # name of the preset, message
    failed = Signal(str, str)  # message, details
    refused = Signal(str, str)  # a pluck cannot be played: message, details

    def take_started(self, take: Take | BlowTake) -> None:
        self.started.emit(take)

    def take_finished(self, take: Take | BlowTake) -> None:
        self.finished.emit(take)

    def other_failed(self, preset: str, message: str) -> None:
        self.other_refused.emit(preset, message)

    def render_failed(self, message: str, detail: str) -> None:
        self.failed.emit(message, detail)
