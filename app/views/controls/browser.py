"""Base of both browsers: a search field and a list over the window, and keys that work in either."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QFrame, QLineEdit, QListWidget, QTreeWidget, QWidget

KEYS = Qt.Key
MOVES = (KEYS.Key_Up, KEYS.Key_Down, KEYS.Key_PageUp, KEYS.Key_PageDown)
CLOSES = (KEYS.Key_Return, KEYS.Key_Enter, KEYS.Key_Escape)


class Browser(QFrame):
    """Hidden at first; closing gives the focus back to the widget that had it.

    A subclass makes `list`, calls `watch_keys` at the end of its `__init__`, and overrides what raises
    NotImplementedError here.

    Args:
        what: of what it is a browser, in the plural, for labels.
        tip: the tooltip of the search field.
    """

    opened = Signal()

    list: QListWidget | QTreeWidget

    def __init__(self, what: str, tip: str, parent: QWidget | None) -> None:
        super().__init__(parent)
        self.setObjectName("browser")
        self.setAccessibleName(f"Browser of {what}")
        self._before: QWidget | None = None  # had the focus
        self.search = QLineEdit(placeholderText=f"Search {what}")
        self.search.setAccessibleName(f"Search {what}")
        self.search.setToolTip(tip)
        self.search.setClearButtonEnabled(True)

    def watch_keys(self) -> None:
        """Takes the keys of search and list, and hides the browser; to be called once both are made."""
        for widget in (self.search, self.list):
            widget.installEventFilter(self)
        if (parent := self.parentWidget()) is not None:
            parent.installEventFilter(self)
        self.hide()

    def show_over(self) -> None:
        """Opens with the focus in the search field."""
        self._before = QApplication.focusWidget()
        self.opened.emit()
        self.place()
        self.show()
        self.raise_()
        self.search.setFocus()
        self.search.selectAll()
        if (item := self.list.currentItem()) is not None:
            self.list.scrollToItem(item)  # type: ignore[arg-type]

    def dismiss(self) -> None:
        """Closes, and gives the focus back; a filter that nothing passes is cleared."""
        self.hide()
        if self._before is not None and self._before.isVisible():
            self._before.setFocus()
        if not self.lists_any():  # next and previous would lead nowhere
            self.clear_filter()

    # For subclasses

    def place(self) -> None:
        """Sets the geometry within the parent; called when opened and when the parent is resized."""
        raise NotImplementedError

    def press(self, event: QKeyEvent) -> None:
        """Handles one of MOVES, Space, Ctrl+D or one of CLOSES."""
        raise NotImplementedError

    def lists_any(self) -> bool:
        """Whether anything passes the filter."""
        raise NotImplementedError

    def clear_filter(self) -> None:
        """Lists everything again; emits the change of the filter once."""
        raise NotImplementedError

    def page(self) -> int:
        """Rows that a page up or down goes."""
        return max(1, self.list.viewport().height() // max(1, self.list.sizeHintForRow(0)) - 1)

    def step(self, key: Qt.Key) -> int:
        """Rows that one of MOVES goes."""
        page = self.page()
        return {KEYS.Key_Up: -1, KEYS.Key_Down: 1, KEYS.Key_PageUp: -page, KEYS.Key_PageDown: page}[key]

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self.parent():
            if event.type() == QEvent.Type.Resize and self.isVisible():
                self.place()
            return False
        if not isinstance(event, QKeyEvent):
            return False
        if event.type() == QEvent.Type.ShortcutOverride:
            if self._is_ours(watched, event) or (event.text() and event.text().isprintable()):
                event.accept()  # or a shortcut of the window would get it
                return True
        elif event.type() == QEvent.Type.KeyPress:
            if self._is_ours(watched, event):
                self.press(event)
                return True
            typed = event.key() == KEYS.Key_Backspace or (event.text().strip() and event.text().isprintable())
            if watched is self.list and typed:
                self.search.setFocus()
                return QApplication.sendEvent(self.search, event)
        return False

    def _is_ours(self, watched: QObject, event: QKeyEvent) -> bool:
        control = event.modifiers() == Qt.KeyboardModifier.ControlModifier
        if event.key() == KEYS.Key_D:
            return control
        if event.key() == KEYS.Key_Space and watched is self.search:
            return not control and self.search.selectedText() == self.search.text()  # nothing is being written
        return event.key() in (*CLOSES, KEYS.Key_Space, *MOVES) and not control
