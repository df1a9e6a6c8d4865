"""A browser over the window: a search, filters, a list under headings, and a card. It stays open while in use.

type              filters the list (words in any order) and selects the best hit, which the card shows
arrows            load what is selected, or move in the list and load
Space             loads what is selected and plays it; while text is typed in the search it is a space
Ctrl+D            adds to the favourites, or removes
Enter, Escape     close
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from PySide6.QtCore import QEvent, QModelIndex, QObject, Qt, QTimer, Signal, SignalInstance
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QFrame,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QVBoxLayout,
    QWidget,
)

from app.views.controls.browser_rows import STAR, TITLE, BrowserColumn, BrowserRow, RowList, listed_rows
from app.views.controls.notice_bar import NoticeBar
from app.views.controls.parts import combo_box, faint, filled, push_button, refill, scrolled, tool_button, words_label
from app.views.controls.plain import Label

KEYS = Qt.Key
MOVES = (KEYS.Key_Up, KEYS.Key_Down, KEYS.Key_PageUp, KEYS.Key_PageDown)
CLOSES = (KEYS.Key_Return, KEYS.Key_Enter, KEYS.Key_Escape)
NARROWEST_SEARCH, SHORTEST_CHOICE = 120, 6  # pixels; letters of a box beside it
TOP = 52  # pixels: its upper edge in a window without a notice bar
REST_MS = 160  # from the last step in the list to the playing of the loaded row, where `at_rest`
DELETE, REALLY = "Delete", "Delete it for good?"
_COMMAND = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier
_PLACES = {QEvent.Type.Resize, QEvent.Type.Move, QEvent.Type.Show, QEvent.Type.Hide}  # what it keeps clear of
_ALT_GR = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier  # on Windows


class Browser(QFrame):
    """A browser that is hidden at first; closing gives the focus back to the widget that had it.

    A row is an entry, a preset or an instrument, known by its name. It is listed where it passes search and filters.
    The loaded row is the one in use. One listed row is selected, loaded or not: card and keys are for it.

    Args:
        what: of what it is a browser, in the plural.
        searched: what the words are searched in.
        columns: of the list, the title's first; one alone has no heading.
        filters: the accessible name of each box, and the words for no filter.
        orders: in which the list can be sorted.
        plays: the word for playing what is selected.
        at_rest: whether a row that arrows or a click loaded is played too, after REST_MS.
        size: largest width and height, and how much of the window stays free below it, in pixels.
        folder_tip: the tooltip of the button that opens the user's folder.

    Attributes:
        loaded: the name of the row that is loaded, listed or not.
        selected: the name of the selected row; "" where none is listed.
    """

    opened = Signal()
    chosen = Signal(str)  # the name of a row: to be loaded
    played = Signal(str)  # a row that is loaded: to be played
    favourite_asked = Signal(str)  # add or remove
    rename_asked = Signal(str)
    delete_asked = Signal(str)  # and confirmed
    folder_asked = Signal()
    listed_changed = Signal()

    def __init__(
        self,
        what: str,
        searched: str,
        columns: Sequence[BrowserColumn],
        filters: Sequence[tuple[str, str]],
        orders: Sequence[str],
        plays: str,
        at_rest: bool,
        size: tuple[int, int, int],
        folder_tip: str,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("browser")
        self.setAccessibleName(f"Browser of {what}")
        self.what = what
        self._size = size
        self._at_rest = at_rest
        self.loaded = self.selected = self._folder = ""
        self._before: QWidget | None = None  # had the keyboard focus before it was opened
        self._filling = False  # list and boxes change by the code: their signals are no choices of the user
        self._rest = QTimer(self, interval=REST_MS, singleShot=True)
        self._rest.timeout.connect(self.play)
        self._rows: Sequence[BrowserRow] = ()
        self._favourites: Collection[str] = ()
        self.search = QLineEdit(placeholderText=f"Search {what}")
        self.search.setAccessibleName(f"Search {what}")
        self.search.setToolTip(f"Words in any order, separated by spaces or commas: {searched}")
        self.search.setClearButtonEnabled(True)
        self.search.setMinimumWidth(NARROWEST_SEARCH)
        self.search.textChanged.connect(self._filter_changed)
        self.filters = {
            name: combo_box(name, [(anything, "")], tip=f"Show only {what} of this {name.lower()}")
            for name, anything in filters
        }
        tip = "Sort the list; favourites first under each heading"
        self.order = combo_box("Order", [(order, number) for number, order in enumerate(orders)], tip=tip)
        self.order.setVisible(len(orders) > 1)
        for box in (*self.filters.values(), self.order):
            box.setMinimumContentsLength(SHORTEST_CHOICE)
            box.currentIndexChanged.connect(self._filter_changed)
        self.starred = tool_button("★  Favourites", "Favourites only", "Show only favourites", checkable=True)
        self.starred.toggled.connect(self._filter_changed)
        self.list = self._build_list(columns)
        self.card = Label(textFormat=Qt.TextFormat.RichText, wordWrap=True)
        self.card.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.card.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.card.setContentsMargins(14, 4, 10, 10)
        self.state = words_label()  # the path of a folder may be longer than the window is wide
        self.play_button = push_button(f"▶  {plays}", f"{plays} (Space)", plays, pressed=self.play)
        tip = "Add to the favourites, or remove (Ctrl+D)"
        self.star = push_button("☆  Favourite", tip, "Favourite", pressed=self.ask_favourite)
        tip = "Give your own another name"
        self.rename = push_button("Rename …", tip, pressed=lambda: self._emit_selected(self.rename_asked))
        tip = "Delete your own; needs a second click"
        self.delete = push_button(DELETE, tip, DELETE, pressed=self._ask_delete)
        self._lay_out(folder_tip, f"↑ ↓ load{' and play' if at_rest else ''}")
        for widget in self.findChildren(QWidget):
            if widget.focusPolicy() != Qt.FocusPolicy.NoFocus and widget.window() is self.window():  # no pop-up
                widget.installEventFilter(self)
        if parent is not None:
            parent.installEventFilter(self)
        self.hide()

    def _build_list(self, columns: Sequence[BrowserColumn]) -> RowList:
        rows = RowList(columns)
        rows.setAccessibleName(self.what.capitalize())
        rows.setToolTip("Arrows load, Space plays, Enter closes")
        rows.setTextElideMode(Qt.TextElideMode.ElideMiddle)  # some differ at the end
        rows.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        rows.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        rows.setHeaderHidden(len(columns) == 1)
        header = rows.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(26)
        for column in range(1 + len(columns)):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(TITLE, QHeaderView.ResizeMode.Stretch)
        rows.selectionModel().currentChanged.connect(self._current_changed)
        rows.clicked.connect(self._click_row)
        rows.doubleClicked.connect(self._double_click_row)
        return rows

    def _lay_out(self, folder_tip: str, arrows: str) -> None:
        close = tool_button("✕", "Close the browser", "Close (Escape)", pressed=self.dismiss)
        folder = tool_button("Open folder", tip=folder_tip, pressed=self.folder_asked)
        head = filled(QHBoxLayout(), self.search, *self.filters.values(), self.order, self.starred, close)
        foot = filled(QHBoxLayout(), self.state, folder)
        buttons = filled(QHBoxLayout(), self.play_button, self.star, self.rename, self.delete, None)
        aside = filled(QVBoxLayout(), scrolled(self.card), buttons)
        for layout in (head, foot, aside):
            layout.setStretch(0, 1)
        hint = f"Type to search   ·   {arrows}   ·   Space plays   ·   Ctrl+D favourite   ·   Enter closes"
        middle = filled(QHBoxLayout(), self.list, aside)
        middle.setStretch(0, 6)
        middle.setStretch(1, 4)
        column = filled(QVBoxLayout(self), head, middle, foot, faint(hint), spacing=10)
        column.setContentsMargins(14, 14, 14, 12)
        column.setStretch(1, 1)

    # What is shown

    def show_rows(self, rows: Sequence[BrowserRow], favourites: Collection[str], loaded: str, folder: str) -> None:
        """Show all rows there are; which are favourites; which one is loaded; the user's own folder."""
        self._folder = folder
        self._filling = True
        for number, box in enumerate(self.filters.values()):
            kinds = sorted({row.kinds[number] for row in rows}, key=lambda kind: (str(type(kind[0])), kind[0]))
            entries = [(box.itemText(0), ""), *((words, value) for value, words in kinds)]  # the first: no filter
            refill(box, entries, box.currentData())
        self._rows, self._favourites = rows, favourites
        if loaded != self.loaded:
            self.loaded = self.selected = loaded
        self._fill()

    def _fill(self) -> None:
        """List the rows that pass search and filters, with their number; select the selected one, or the best hit."""
        kinds = [box.currentData() for box in self.filters.values()]
        order = max(0, self.order.currentIndex())
        self._filling = True
        self.list.show_rows(
            listed_rows(self._rows, self._favourites, self.words, kinds, self.starred.isChecked(), order),
            self._favourites,
        )
        self._filling = False
        matches, total = len(self.listed), self.total
        count = f"{matches} of {total} {self.what}" if matches < total else f"{total} {self.what}"
        self.state.say(f"{count}   ·   your own: {self._folder}", count)
        self.select(self.selected)
        self.listed_changed.emit()

    @property
    def listed(self) -> list[str]:
        """The names that pass the filter, in the order shown: previous and next go through these."""
        return [row.name for row in self.list.rows]

    @property
    def total(self) -> int:
        return len(self._rows)

    def clear_filter(self) -> None:
        """List all again; the order is no filter. Emits `listed_changed` once."""
        self._filling = True
        self.search.clear()
        for box in self.filters.values():
            box.setCurrentIndex(0)
        self.starred.setChecked(False)
        self._filling = False
        self._filter_changed()

    def _filter_changed(self) -> None:
        if not self._filling:
            self.selected = ""  # the best hit is selected
            self._fill()

    def show_card(self, name: str) -> None:
        """Show the card of a listed row; for another name, as "", the advice to clear search or filters."""
        row = next((row for row in self.list.rows if row.name == name), None)
        self.delete.setText(DELETE)
        for button in (self.play_button, self.star):
            button.setVisible(row is not None)
        for button in (self.rename, self.delete):
            button.setVisible(row is not None and row.own)
        nothing = f"No matching {self.what.removesuffix('es').removesuffix('s')}: clear the search or filters."
        self.card.setText(nothing if row is None else row.card())
        self.star.setText("★  Favourite" if name in self._favourites else "☆  Favourite")

    def place(self) -> None:
        """Set the geometry within the parent, under its notice; called when opened and when either changes."""
        parent = self.parentWidget()
        if parent is not None:
            for notices in self.window().findChildren(NoticeBar):
                notices.installEventFilter(self)  # again is the same as once
            most, high, below = self._size
            width, height = min(most, parent.width() - 28), min(high, parent.height() - self.top - below)
            self.setGeometry(14, self.top, width, max(300, height))

    def show_over(self) -> None:
        """Open with the focus in the search field."""
        self._before = QApplication.focusWidget()
        self.opened.emit()
        self.select()
        self.place()
        self.show()
        self.raise_()
        self.search.setFocus()
        self.search.selectAll()
        self.list.scrollTo(self.list.currentIndex())

    def dismiss(self) -> None:
        """Close, and give the focus back; a filter that nothing passes is cleared."""
        self._rest.stop()
        self.hide()
        if self._before is not None and self._before.isVisible():
            self._before.setFocus()
        if not self.listed:  # next and previous would lead nowhere
            self.clear_filter()

    def reveal(self, name: str) -> None:
        """Clear search and filters where they hide the row of this name."""
        if name not in self.listed:
            self.clear_filter()

    def take_typed(self, event: QKeyEvent) -> bool:
        """Give a key that writes to the search, wherever the focus is; False for another key."""
        modifiers = event.modifiers() & _COMMAND
        writes = event.key() == KEYS.Key_Backspace or (event.text().strip() and event.text().isprintable())
        if not writes or (modifiers and modifiers != _ALT_GR):
            return False
        if event.type() == QEvent.Type.ShortcutOverride:
            event.accept()  # or a shortcut of the window would get it
        elif event.type() == QEvent.Type.KeyPress:
            self.search.setFocus()
            self.search.event(event)  # not sent: what it ignores would come back here
        return True

    @property
    def top(self) -> int:
        """The upper edge of the browser in the window: under the notice, if one is shown."""
        notices = self.window().findChild(NoticeBar)
        if notices is None:
            return TOP
        return notices.y() if notices.isHidden() else notices.geometry().bottom() + 4

    @property
    def words(self) -> tuple[str, ...]:
        return tuple(self.search.text().casefold().replace(",", " ").split())

    @property
    def best_hit(self) -> str:
        """The name of the best hit: of entries with all the words in their titles, else of all listed.

        The loaded one of these is taken, else the first. "" where none is listed.
        """
        rows, words = self.list.rows, self.words
        hits = [row.name for row in rows if all(word in row.title.casefold() for word in words)]
        hits = hits or [row.name for row in rows]
        return self.loaded if self.loaded in hits else next(iter(hits), "")

    def set_chosen(self, name: str) -> None:
        """Take note that the row of this name was loaded elsewhere, and select it if listed; emit nothing."""
        if name != self.loaded:
            self.loaded = name
            self.select(name)

    def select(self, name: str = "") -> None:
        """Select the row of a name, or the best hit where it is not listed. Load nothing."""
        self.selected = name if name in self.listed else self.best_hit
        self._filling = True
        self.list.setCurrentIndex(self.list.index_of(self.selected))
        self._filling = False
        self.show_card(self.selected)

    def load(self, name: str) -> None:
        """Select a listed entry and have it loaded, unless it is loaded already."""
        if name:
            self.select(name)
        if name not in ("", self.loaded):
            self.loaded = name
            self.chosen.emit(name)

    def move_selection(self, key: Qt.Key) -> None:
        """Load the selected row, or where it is loaded already, the row to which a key of MOVES leads from it."""
        names = self.listed
        if names:
            self.list.setFocus()  # where Space plays
            page = max(1, self.list.viewport().height() // max(1, self.list.sizeHintForRow(0)) - 1)
            steps = dict(zip(MOVES, (-1, 1, -page, page), strict=True))
            row = names.index(self.selected) + (steps[key] if self.selected == self.loaded else 0)
            self.load(names[min(max(row, 0), len(names) - 1)])
            if self._at_rest:
                self._rest.start()

    def press(self, key: Qt.Key) -> None:
        """Handle a key of MOVES, Space, D or one of CLOSES."""
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
        self._emit_selected(self.favourite_asked)

    def play(self) -> None:
        self._rest.stop()
        self.load(self.selected)
        self._emit_selected(self.played)

    def _emit_selected(self, signal: SignalInstance) -> None:
        if self.selected:
            signal.emit(self.selected)

    def _ask_delete(self) -> None:
        if self.delete.text() == DELETE:
            self.delete.setText(REALLY)
        else:
            self.delete.setText(DELETE)
            self._emit_selected(self.delete_asked)

    def _current_changed(self, index: QModelIndex) -> None:
        if not self._filling and index.isValid() and isinstance(line := self.list.line(index), BrowserRow):
            self.load(line.name)

    def _click_row(self, index: QModelIndex) -> None:
        """Load the row that was clicked, or ask to change its favourite where the star was."""
        line = self.list.line(index)
        if isinstance(line, str):
            self.select(self.selected)  # Qt made the heading current
        elif index.column() == STAR:
            self.favourite_asked.emit(line.name)
        else:
            self.load(line.name)  # the best hit may be selected and not loaded
            if self._at_rest:
                self._rest.start()

    def _double_click_row(self, index: QModelIndex) -> None:
        if index.column() != STAR and isinstance(self.list.line(index), BrowserRow):
            self.dismiss()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Take the keys of `press`, and typed characters for the search, from all widgets of the browser.

        Also follow the sizes of parent and notice. Return True for a key that was taken.
        """
        if watched is self.parent() or isinstance(watched, NoticeBar):
            if event.type() in _PLACES and self.isVisible():
                self.place()
            return False
        if not isinstance(event, QKeyEvent) or event.type() == QEvent.Type.KeyRelease:
            return False
        if self._is_browser_key(watched, event):
            if event.type() == QEvent.Type.ShortcutOverride:
                event.accept()  # or a shortcut of the window would get it
            else:
                self.press(KEYS(event.key()))
            return True
        return watched is not self.search and self.take_typed(event)

    def _is_browser_key(self, watched: QObject, event: QKeyEvent) -> bool:
        """Return True if a key is for `press`; with the focus on a button or a box, only Escape is."""
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
