"""Base of both browsers: a search field and a list over the window. Typing searches wherever the focus is."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QEvent, QObject, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QFrame, QLineEdit, QListWidget, QTreeWidget, QWidget

from app.views.controls.notice_bar import NoticeBar

KEYS = Qt.Key
MOVES = (KEYS.Key_Up, KEYS.Key_Down, KEYS.Key_PageUp, KEYS.Key_PageDown)
CLOSES = (KEYS.Key_Return, KEYS.Key_Enter, KEYS.Key_Escape)
NARROWEST_SEARCH, SHORTEST_CHOICE = 120, 6  # pixels; letters of a box beside it
TOP = 52  # pixels: of its place without notices
_COMMAND = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier
_ALT_GR = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier  # on Windows


class Browser(QFrame):
    """Hidden at first; closing gives the focus back to the widget that had it.

    One entry of the list is selected, loaded or not: card and keys are for it.

    A subclass makes `list`, calls `watch_keys` at the end of its `__init__`, and overrides what raises
    NotImplementedError here.

    Args:
        what: of what it is a browser, in the plural, for labels.
        tip: the tooltip of the search field.

    Attributes:
        loaded: the name of the entry that is loaded, listed or not.
        selected: the name of the selected entry; "" where none is listed.
    """

    opened = Signal()
    chosen = Signal(str)  # the name of an entry: to be loaded
    favourite_asked = Signal(str)  # add or remove

    list: QListWidget | QTreeWidget

    def __init__(self, what: str, tip: str, parent: QWidget | None) -> None:
        super().__init__(parent)
        self.setObjectName("browser")
        self.setAccessibleName(f"Browser of {what}")
        self.loaded = self.selected = ""
        self._before: QWidget | None = None  # had the focus
        self.search = QLineEdit(placeholderText=f"Search {what}")
        self.search.setAccessibleName(f"Search {what}")
        self.search.setToolTip(tip)
        self.search.setClearButtonEnabled(True)
        self.search.setMinimumWidth(NARROWEST_SEARCH)

    def watch_keys(self) -> None:
        """Watches the keys of all its widgets, and hides the browser; to be called once all are made."""
        for widget in self.findChildren(QWidget):
            if widget.focusPolicy() != Qt.FocusPolicy.NoFocus and widget.window() is self.window():  # no pop-up
                widget.installEventFilter(self)
        if (parent := self.parentWidget()) is not None:
            parent.installEventFilter(self)
        self.hide()

    def show_over(self) -> None:
        """Opens with the focus in the search field."""
        self._before = QApplication.focusWidget()
        self.opened.emit()
        self.select()
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
        if not self.listed:  # next and previous would lead nowhere
            self.clear_filter()

    def reveal(self, name: str) -> None:
        """Clears a filter that hides an entry."""
        if name not in self.listed:
            self.clear_filter()

    def take_typed(self, event: QKeyEvent) -> bool:
        """Gives a key that writes to the search, wherever the focus is; False for another key."""
        held = event.modifiers() & _COMMAND
        writes = event.key() == KEYS.Key_Backspace or (event.text().strip() and event.text().isprintable())
        if not writes or (held and held != _ALT_GR):
            return False
        if event.type() == QEvent.Type.ShortcutOverride:
            event.accept()  # or a shortcut of the window would get it
        elif event.type() == QEvent.Type.KeyPress:
            self.search.setFocus()
            self.search.event(event)  # not sent: what it ignores would come back here
        return True

    @property
    def top(self) -> int:
        """Its upper edge in the window: that of notices, which it covers."""
        notices = self.window().findChild(NoticeBar)
        return TOP if notices is None else notices.y()

    @property
    def words(self) -> tuple[str, ...]:
        """The words that are searched for, in lower case."""
        return tuple(self.search.text().casefold().replace(",", " ").split())

    @property
    def best_hit(self) -> str:
        """Of the entries with all the words in their titles, else of all listed ones, the loaded one, else the first.

        "" where none is listed.
        """
        listed, words = self.listed, self.words
        hits = tuple(name for name in listed if all(word in self.title(name).casefold() for word in words)) or listed
        return self.loaded if self.loaded in hits else next(iter(hits), "")

    def set_chosen(self, name: str) -> None:
        """Selects an entry that was loaded, if it is listed."""
        if name != self.loaded:
            self.loaded = name
            self.select(name)

    def select(self, name: str = "") -> None:
        """Selects an entry, or the best hit where it is not listed. Loads nothing."""
        self.selected = name if name in self.listed else self.best_hit
        with QSignalBlocker(self.list):
            self.mark(self.selected)
        self.show_card(self.selected)

    def load(self, name: str) -> None:
        """Selects a listed entry and has it loaded, unless it is loaded already."""
        if name:
            self.select(name)
        if name not in ("", self.loaded):
            self.loaded = name
            self.chosen.emit(name)

    def move_selection(self, key: Qt.Key) -> None:
        """Loads the selected entry, or, where it is loaded already, the one that one of MOVES goes to."""
        listed = self.listed
        if listed:
            self.list.setFocus()  # where Space plays
            row = listed.index(self.selected) + (self.step(key) if self.selected == self.loaded else 0)
            self.load(listed[min(max(row, 0), len(listed) - 1)])

    def press(self, key: Qt.Key) -> None:
        """Handles one of MOVES, Space, D or one of CLOSES."""
        if key in MOVES:
            self.move_selection(key)
        elif key == KEYS.Key_Space:
            self.play()
        elif key == KEYS.Key_D:
            self.ask_favourite()
        else:
            if key != KEYS.Key_Escape:
                self.load(self.selected)
            self.dismiss()

    def ask_favourite(self) -> None:
        """Asks for the selected entry to become a favourite, or none."""
        if self.selected:
            self.favourite_asked.emit(self.selected)

    # For subclasses

    def place(self) -> None:
        """Sets the geometry within the parent; called when opened and when the parent is resized."""
        raise NotImplementedError

    def play(self) -> None:
        """Plays the selected entry."""
        raise NotImplementedError

    @property
    def listed(self) -> Sequence[str]:
        """The names of the entries that pass the filter, in the order shown."""
        raise NotImplementedError

    def title(self, name: str) -> str:
        """The title of a listed entry."""
        raise NotImplementedError

    def mark(self, name: str) -> None:
        """Makes an entry the list's current one; "" leaves none."""
        raise NotImplementedError

    def show_card(self, name: str) -> None:
        """Shows the card of an entry; "" of none."""
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
        if not isinstance(event, QKeyEvent) or event.type() == QEvent.Type.KeyRelease:
            return False
        if self._is_ours(watched, event):
            if event.type() == QEvent.Type.ShortcutOverride:
                event.accept()  # or a shortcut of the window would get it
            else:
                self.press(KEYS(event.key()))
            return True
        return watched is not self.search and self.take_typed(event)

    def _is_ours(self, watched: QObject, event: QKeyEvent) -> bool:
        """Whether a key is one of `press`; buttons and boxes keep all of these but Escape."""
        control = event.modifiers() == Qt.KeyboardModifier.ControlModifier
        if watched not in (self.search, self.list):
            return event.key() == KEYS.Key_Escape
        if event.key() == KEYS.Key_D:
            return control
        if event.key() == KEYS.Key_Space and watched is self.search:
            return not control and self.search.selectedText() == self.search.text()  # nothing is being written
        return event.key() in (*CLOSES, KEYS.Key_Space, *MOVES) and not control


def open_browser(window: QWidget) -> Browser | None:
    """The browser that is open over a window."""
    children = window.findChildren(Browser, options=Qt.FindChildOption.FindDirectChildrenOnly)
    return next((browser for browser in children if browser.isVisible()), None)
