"""The handle from which what was played is dragged into another program as files; a click opens its menu."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from PySide6.QtCore import QMimeData, QPoint, Qt, QUrl, Signal
from PySide6.QtGui import QActionGroup, QDrag, QEnterEvent, QMouseEvent
from PySide6.QtWidgets import QApplication, QMenu, QSizePolicy, QToolButton

Handed = Literal["note", "difference", "recording"]
WORDS: dict[Handed, str] = {
    "note": "the last note as it is heard",
    "difference": "the difference of the last note, model − truth",
    "recording": "the last recording",
}
GRIP = "⋮⋮"
LEFT = Qt.MouseButton.LeftButton


def file_data(files: Sequence[Path]) -> QMimeData:
    """Files as they are dragged and copied."""
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(file)) for file in files])
    return data


class DragHandle(QToolButton):
    """Pointing at it asks for files, which `offer` gives; pulling it drags them as soon as they are there.

    Attributes:
        subject: what is dragged.
        pulled: the mouse was pressed and moved away, and nothing is dragged yet.
    """

    wanted = Signal()
    copy_asked = Signal()  # to the clipboard

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("chip")
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.setCursor(Qt.CursorShape.OpenHandCursor)
        self.pulled = self._compact = False
        self._pressed: QPoint | None = None  # None: the mouse is up, or drags already
        self._files: Sequence[Path] = ()
        self._menu = QMenu(self)
        group = QActionGroup(self._menu)
        self._actions = {}
        for subject, words in WORDS.items():
            action = self._actions[subject] = self._menu.addAction(f"Drag {words}")
            action.setCheckable(True)
            action.triggered.connect(lambda _=False, subject=subject: self.show_subject(subject))
            group.addAction(action)
        self._menu.addSeparator()
        self._menu.addAction("Copy it as a file").triggered.connect(self.copy_asked)
        self.clicked.connect(lambda: self._menu.popup(self.mapToGlobal(self.rect().bottomLeft())))
        self.show_recorded(False)
        self.show_subject("note")

    def show_subject(self, subject: Handed) -> None:
        """Show what is dragged from now on."""
        self.subject = subject
        self._actions[subject].setChecked(True)
        self.setAccessibleName(f"Drag {WORDS[subject]}")
        tip = "as the file that Export would write.\nClick for something else, or to copy it as a file"
        self.setToolTip(f"Drag {WORDS[subject]} into a DAW or a file manager, {tip} (the note: Ctrl+Shift+C)")
        self.show_share(None)

    def show_recorded(self, recorded: bool) -> None:
        """Show if there is a recording to be dragged; a new one is."""
        self._actions["recording"].setEnabled(recorded)
        if recorded or self._actions["recording"].isChecked():
            self.show_subject("recording" if recorded else "note")

    def show_share(self, share: float | None) -> None:
        """Show the share of the files that is rendered; None: nothing is."""
        words = self.subject.capitalize() if self._compact else f"Drag {self.subject}"
        words = words if share is None else f"{share:.0%}"
        self.setText(f"{GRIP} {words}")

    def set_compact(self, compact: bool) -> None:
        """Show fewer words, for a window with little room."""
        self._compact = compact
        self.show_share(None)

    def offer(self, files: Sequence[Path]) -> None:
        """Give the files, which are whole."""
        self._files = files
        self._drag()

    def enterEvent(self, event: QEnterEvent) -> None:
        super().enterEvent(event)
        if self.subject != "recording":  # which may be long
            self.wanted.emit()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        super().mousePressEvent(event)
        if event.button() == LEFT:
            self._pressed, self.pulled, self._files = event.position().toPoint(), False, ()
            self.wanted.emit()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        super().mouseMoveEvent(event)
        if self._pressed is not None:
            way = event.position().toPoint() - self._pressed
            self.pulled = self.pulled or way.manhattanLength() >= QApplication.startDragDistance()
            self._drag()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._pressed = None
        self.setDown(self.isDown() and not self.pulled)  # or it would be clicked
        super().mouseReleaseEvent(event)

    def _drag(self) -> None:
        if self._pressed is not None and self.pulled and self._files:
            self._pressed, self.pulled = None, False
            self.setDown(False)  # its release goes to the other program
            drag = QDrag(self)
            drag.setMimeData(file_data(self._files))
            drag.exec(Qt.DropAction.CopyAction)
