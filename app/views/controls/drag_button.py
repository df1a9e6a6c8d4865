"""A push button from which files can be dragged out of the window."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QMimeData, QPoint, Qt, QUrl, Signal
from PySide6.QtGui import QDrag, QMouseEvent
from PySide6.QtWidgets import QApplication, QPushButton, QWidget


class DragButton(QPushButton):
    """Emits `drag_began` when it is dragged; the owner then gives the files to `carry`, at once or later.

    With the next movement of the mouse they are dragged. `drag_ended`: they were dropped, or the button was released.
    """

    drag_began = Signal()
    drag_ended = Signal()

    def __init__(self, text: str, parent: QWidget | None = None) -> None:
        super().__init__(text, parent)
        self._pressed_at: QPoint | None = None
        self._dragged = False
        self._files: tuple[Path, ...] = ()

    def carry(self, files: Sequence[Path]) -> None:
        """The files of the drag under way; ignored where there is none."""
        if self._dragged:
            self._files = tuple(files)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._pressed_at = event.position().toPoint()
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._pressed_at is None:  # after a drag: the button itself would take it for a press
            return
        moved = event.position().toPoint() - self._pressed_at
        if not self._dragged and moved.manhattanLength() >= QApplication.startDragDistance():
            self._dragged = True
            self.setDown(False)  # so that the release is no click
            self.drag_began.emit()
        if self._files:
            mime = QMimeData()
            mime.setUrls([QUrl.fromLocalFile(str(file)) for file in self._files])
            drag = QDrag(self)
            drag.setMimeData(mime)
            drag.exec(Qt.DropAction.CopyAction)
            self._end()  # the button gets no release event

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._end()
        super().mouseReleaseEvent(event)

    def _end(self) -> None:
        dragged, self._dragged = self._dragged, False
        self._pressed_at, self._files = None, ()
        if dragged:
            self.drag_ended.emit()
