"""The handle from which what was played is dragged into another program as files; a click opens its menu."""

from __future__ import annotations

from typing import Literal

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QEnterEvent, QMouseEvent
from PySide6.QtWidgets import QMenu, QSizePolicy, QToolButton

Handed = Literal["note", "difference", "recording"]
Way = Literal["prepare", "drag", "copy"]  # what is done with the files
WORDS: dict[Handed, str] = {
    "note": "the last note as it is heard",
    "difference": "the difference of the last note, model − truth",
    "recording": "the last recording",
}


class DragHandle(QToolButton):
    """The button that asks for a drag as it is pulled, and for files already when the mouse comes.

    Attributes:
        subject: what is dragged, one of WORDS.
        pulled: the mouse has left the button while pressed, which asked for a drag, and was not released since.
    """

    asked = Signal(str)  # one of Way: prepare the files, drag them, or copy them to the clipboard

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("chip")
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.setCursor(Qt.CursorShape.OpenHandCursor)
        self.pulled = self._compact = False
        menu = QMenu(self)
        for subject, words in WORDS.items():
            action = menu.addAction(f"Drag {words}")
            action.triggered.connect(lambda _=False, subject=subject: self.show_subject(subject))
        menu.addAction("Copy it as a file").triggered.connect(lambda: self.asked.emit("copy"))
        self.clicked.connect(lambda: menu.popup(self.mapToGlobal(self.rect().bottomLeft())))
        self.show_subject("note")

    def show_subject(self, subject: Handed) -> None:
        """Show what is dragged from now on."""
        self.subject = subject
        self.setAccessibleName(f"Drag {WORDS[subject]}")
        tip = "as the file that Export would write.\nClick for something else, or to copy it as a file"
        self.setToolTip(f"Drag {WORDS[subject]} into a DAW or a file manager, {tip} (the note: Ctrl+Shift+C)")
        self.show_share(None)

    def show_share(self, share: float | None) -> None:
        """Show the share of the files that is rendered; None: nothing is."""
        words = self.subject.capitalize() if self._compact else f"Drag {self.subject}"
        self.setText(f"⋮⋮ {words}" if share is None else f"⋮⋮ {share:.0%}")

    def set_compact(self, compact: bool) -> None:
        """Show fewer words, for a window with little room."""
        self._compact = compact
        self.show_share(None)

    def enterEvent(self, event: QEnterEvent) -> None:
        super().enterEvent(event)
        self.asked.emit("prepare")

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Ask for a drag as the pressed mouse leaves the button; back on the button it is a click again."""
        was_down = self.isDown()
        super().mouseMoveEvent(event)
        if was_down != self.isDown():
            self.pulled = was_down
            if self.pulled:
                self.asked.emit("drag")

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self.pulled = False
        super().mouseReleaseEvent(event)
