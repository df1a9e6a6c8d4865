"""A button that is pressed as any other; dragged, it takes files out of the window, as soon as there are any."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QMimeData, QPoint, Qt, QUrl, Signal
from PySide6.QtGui import QDrag, QMouseEvent
from PySide6.QtWidgets import QApplication, QPushButton, QWidget


class DragButton(QPushButton):
    """`drag_began` asks for files; `carry` brings them, then or later, and the next movement takes them along.

    `drag_ended`: they were dropped, or the button was let go.
    """

    drag_began = Signal()
    drag_ended = Signal()

    def __init__(self, text: str, parent: QWidget | None = None) -> None:
        super().__init__(text, parent)
        self._pressed_at: QPoint | None = None
        self._dragged = False
        self._files: tuple[Path, ...] = ()

    def carry(self, files: Sequence[Path]) -> None:
        """For the drag that has begun; without one nothing happens."""
        if self._dragged:
            self._files = tuple(files)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._pressed_at = event.position().toPoint()
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._pressed_at is None:  # and not to the button itself, to which it would be pressed again
            return
        moved = event.position().toPoint() - self._pressed_at
        if not self._dragged and moved.manhattanLength() >= QApplication.startDragDistance():
            self._dragged = True
            self.setDown(False)  # it will be no click
            self.drag_began.emit()
        if self._files:
            mime = QMimeData()
            mime.setUrls([QUrl.fromLocalFile(str(file)) for file in self._files])
            drag = QDrag(self)
            drag.setMimeData(mime)
            drag.exec(Qt.DropAction.CopyAction)
            self._end()  # the release went to where it was dropped

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._end()
        super().mouseReleaseEvent(event)

    def _end(self) -> None:
        dragged, self._dragged = self._dragged, False
        self._pressed_at, self._files = None, ()
        if dragged:
            self.drag_ended.emit()
