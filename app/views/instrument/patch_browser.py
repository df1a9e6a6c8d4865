"""The patch browser: a search, a list under the categories and a card. It stays open while in use.

type              filters the list (words in any order) and selects the best hit, which the card shows
arrows            load what is selected, or move in the list and load; and play a note
Space             plays a note; while text is typed in the search it is a space
Ctrl+D            adds to the favourites, or removes
Enter, Escape     close
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import QSignalBlocker, Qt, QTimer, Signal, SignalInstance
from PySide6.QtGui import QColor, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QGridLayout,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.shared.key_names import note_name
from app.views import theme
from app.views.controls.browser import SHORTEST_CHOICE, Browser
from app.views.controls.parts import combo_box, label, scrolled, tool_button
from app.views.controls.plain import Label, plain_tip

if TYPE_CHECKING:
    from app.patches.library import PatchEntry

_HINT = "Type to search   ·   ↑ ↓ load and play   ·   Space plays   ·   Ctrl+D favourite   ·   Enter closes"
_NAME = Qt.ItemDataRole.UserRole
REST_MS = 160  # after the last step in the list, a note is played
DELETE, REALLY = "Delete", "Delete it for good?"


class PatchBrowser(Browser):
    """Shows what it is given; hidden at first."""

    list: QListWidget

    audition_asked = Signal(str)  # to be loaded and heard
    rename_asked = Signal(str)
    delete_asked = Signal(str)  # and confirmed
    folder_asked = Signal()
    file_dropped = Signal(str)  # the path of a .json
    listed_changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("patches", "Words in any order: name, category, description, author", parent)
        self.setAcceptDrops(True)
        self._entries: dict[str, PatchEntry] = {}
        self._favourites: Collection[str] = ()
        self._rest = QTimer(self, interval=REST_MS, singleShot=True)
        self._rest.timeout.connect(self.play)
        self.search.textChanged.connect(self._filter_changed)
        self._category = combo_box("Category", [("All categories", "")])
        self._category.setToolTip("Show only patches of this category")
        self._whose = combo_box("Whose", [("Shipped and own", ""), ("Shipped", "shipped"), ("Own", "own")])
        self._whose.setToolTip("Show only patches that came with the program, or only your own")
        for box in (self._category, self._whose):
            box.setMinimumContentsLength(SHORTEST_CHOICE)
            box.currentIndexChanged.connect(self._filter_changed)
        self._starred = tool_button("★  Favourites", "Favourites only", "Show only favourites")
        self._starred.setCheckable(True)
        self._starred.toggled.connect(self._filter_changed)
        self.list = QListWidget()
        self.list.setAccessibleName("Patches")
        self.list.setToolTip("Arrows load and play, Space plays, Enter closes")
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.list.currentItemChanged.connect(lambda item: self.load(_name_of(item)))
        self.list.itemClicked.connect(self._clicked)
        self.list.itemDoubleClicked.connect(lambda item: self.dismiss() if _name_of(item) else None)
        self._lay_out()
        self.watch_keys()

    def _lay_out(self) -> None:
        close = tool_button("✕", "Close the browser", "Close (Escape)")
        close.clicked.connect(self.dismiss)
        head = QHBoxLayout()
        head.addWidget(self.search, 1)
        for widget in (self._category, self._whose, self._starred, close):
            head.addWidget(widget)
        self._state = Label()
        self._state.setObjectName("faint")
        folder = tool_button(
            "Open folder",
            tip="Show the folder of your patches, to which Save writes. A patch file dropped here is loaded",
        )
        folder.clicked.connect(self.folder_asked)
        foot = QHBoxLayout()
        foot.addWidget(self._state, 1)
        foot.addWidget(folder)
        hint = Label(_HINT)
        hint.setObjectName("faint")
        grid = QGridLayout(self)
        grid.setContentsMargins(14, 14, 14, 12)
        grid.setSpacing(10)
        grid.addLayout(head, 0, 0, 1, 2)
        grid.addWidget(self.list, 1, 0)
        grid.addLayout(self._build_card(), 1, 1)
        grid.addLayout(foot, 2, 0, 1, 2)
        grid.addWidget(hint, 3, 0, 1, 2)
        grid.setColumnStretch(0, 5)
        grid.setColumnStretch(1, 4)
        grid.setRowStretch(1, 1)

    def _build_card(self) -> QVBoxLayout:
        self._title, self._kind, self._words, self._facts = (
            label("title"),
            label("faint"),
            label(),
            label("faint", selectable=True),
        )
        self._play = QPushButton("▶  Play a note")
        self._play.setToolTip("Play a note of this patch (Space)")
        self._play.clicked.connect(self.play)
        self._star = QPushButton("☆  Favourite")
        self._star.setToolTip("Add to the favourites, or remove (Ctrl+D)")
        self._star.clicked.connect(self.ask_favourite)
        self._rename = QPushButton("Rename …")
        self._rename.setToolTip("Give your own patch another name")
        self._rename.clicked.connect(lambda: self._tell(self.rename_asked))
        self._delete = QPushButton(DELETE)
        self._delete.setToolTip("Delete your own patch; needs a second click")
        self._delete.clicked.connect(self._ask_delete)
        hearing, own = QHBoxLayout(), QHBoxLayout()
        for row, buttons in ((hearing, (self._play, self._star)), (own, (self._rename, self._delete))):
            for button in buttons:
                row.addWidget(button)
            row.addStretch(1)
        told = QWidget()
        lines = QVBoxLayout(told)
        lines.setContentsMargins(0, 0, 0, 0)
        lines.setSpacing(8)
        lines.addWidget(self._words)
        lines.addWidget(self._facts)
        lines.addStretch(1)
        column = QVBoxLayout()
        column.setContentsMargins(8, 4, 4, 4)
        column.setSpacing(8)
        for widget in (self._title, self._kind):
            column.addWidget(widget)
        column.addWidget(scrolled(told), 1)
        column.addLayout(hearing)
        column.addLayout(own)
        return column

    # What is shown

    def show_entries(self, entries: Sequence[PatchEntry], favourites: Collection[str], chosen: str) -> None:
        """All patches there are, in their order; which are favourites; which one is loaded."""
        self._entries = {entry.name: entry for entry in entries}
        self._favourites = frozenset(favourites)
        if chosen != self.loaded:
            self.loaded = self.selected = chosen
        with QSignalBlocker(self._category):
            kept = self._category.currentData()
            self._category.clear()
            self._category.addItem("All categories", "")
            for category in dict.fromkeys(entry.patch.category for entry in entries):
                self._category.addItem(category.capitalize(), category)
            self._category.setCurrentIndex(max(0, self._category.findData(kept)))
        self._fill()

    @property
    def listed(self) -> tuple[str, ...]:
        """The names that pass the filter, in the order shown: previous and next go through these."""
        return tuple(name for row in range(self.list.count()) if (name := _name_of(self.list.item(row))))

    def clear_filter(self) -> None:
        """Lists all patches again; emits `listed_changed` once."""
        parts = (self.search, self._category, self._whose, self._starred)
        for widget in parts:
            widget.blockSignals(True)
        self.search.clear()
        self._category.setCurrentIndex(0)
        self._whose.setCurrentIndex(0)
        self._starred.setChecked(False)
        for widget in parts:
            widget.blockSignals(False)
        self._filter_changed()

    def _filter_changed(self) -> None:
        self.selected = ""  # the best hit is selected
        self._fill()

    def _passes(self, entry: PatchEntry) -> bool:
        patch, whose = entry.patch, self._whose.currentData()
        text = f"{patch.name} {patch.category} {patch.description} {patch.author}".casefold()
        return (
            all(word in text for word in self.words)
            and self._category.currentData() in ("", patch.category)
            and (not whose or (whose == "own") == entry.own)
            and (not self._starred.isChecked() or entry.name in self._favourites)
        )

    def _fill(self) -> None:
        listed = [entry for entry in self._entries.values() if self._passes(entry)]
        with QSignalBlocker(self.list):
            self.list.clear()
            heading = ""
            for entry in listed:
                if entry.patch.category != heading:
                    heading = entry.patch.category
                    self._add_heading(heading)
                star = "★" if entry.name in self._favourites else "☆"
                item = QListWidgetItem(f"{star}   {entry.patch.name}{'   (own)' if entry.own else ''}", self.list)
                item.setData(_NAME, entry.name)
                item.setToolTip(plain_tip(f"{entry.patch.name}\n{entry.patch.description}".strip()))
        total = len(self._entries)
        found = f"{len(listed)} of {total} patches" if len(listed) < total else f"{total} patches"
        self._state.setText(found if listed else f"{found}: clear the search or the filters")
        self.select(self.selected)
        self.listed_changed.emit()

    def _add_heading(self, category: str) -> None:
        item = QListWidgetItem(category.upper(), self.list)
        item.setFlags(Qt.ItemFlag.ItemIsEnabled)
        item.setForeground(QColor(theme.FAINT))
        font = item.font()
        font.setBold(True)
        item.setFont(font)

    def title(self, name: str) -> str:
        return self._entries[name].patch.name

    def mark(self, name: str) -> None:
        names = [_name_of(self.list.item(row)) for row in range(self.list.count())]
        self.list.setCurrentRow(names.index(name) if name else -1)

    def show_card(self, name: str) -> None:
        entry = self._entries.get(name)
        self._delete.setText(DELETE)
        for button in (self._play, self._star):
            button.setVisible(entry is not None)
        for button in (self._rename, self._delete):
            button.setVisible(entry is not None and entry.own)
        if entry is None:
            self._title.setText("No matching patch")
            for shown in (self._kind, self._words, self._facts):
                shown.clear()
            return
        patch = entry.patch
        self._title.setText(patch.name)
        by = f"   ·   {patch.author}" if patch.author else ""
        self._kind.setText(f"{patch.category.capitalize()}   ·   {'your own' if entry.own else 'shipped'}{by}")
        self._words.setText(patch.description)
        self._facts.setText(_facts(entry))
        self._star.setText("★  Favourite" if name in self._favourites else "☆  Favourite")

    # What is asked

    def dismiss(self) -> None:
        self._rest.stop()
        super().dismiss()

    def _clicked(self, item: QListWidgetItem) -> None:
        if name := _name_of(item):
            self.load(name)  # the best hit may be selected and not loaded
            self._rest.start()
        else:
            self.select(self.selected)  # a heading took the mark

    def play(self) -> None:
        self._rest.stop()
        self._tell(self.audition_asked)

    def _tell(self, signal: SignalInstance) -> None:
        if self.selected:
            signal.emit(self.selected)

    def _ask_delete(self) -> None:
        if self._delete.text() == DELETE:
            self._delete.setText(REALLY)
        else:
            self._delete.setText(DELETE)
            self._tell(self.delete_asked)

    # Moves, drops and place

    def move_selection(self, key: Qt.Key) -> None:
        super().move_selection(key)
        self._rest.start()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if _patches(event):
            event.setDropAction(Qt.DropAction.CopyAction)  # never a move, which would delete the user's file
            event.accept()

    def dropEvent(self, event: QDropEvent) -> None:
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
        for path in _patches(event):
            self.file_dropped.emit(path)

    def place(self) -> None:
        """Above the instrument, whose keys stay visible and can be played."""
        parent = self.parentWidget()
        if parent is not None:
            top = self.top
            width, height = min(1000, parent.width() - 28), min(520, parent.height() - top - 240)
            self.setGeometry(14, top, width, max(300, height))


def _name_of(item: QListWidgetItem | None) -> str:
    """The name of a row's patch; empty for a heading and for none."""
    return (item.data(_NAME) or "") if item is not None else ""


def _patches(event: QDropEvent) -> list[str]:
    return [
        url.toLocalFile()
        for url in event.mimeData().urls()
        if url.isLocalFile() and url.toLocalFile().lower().endswith(".json")
    ]


def _facts(entry: PatchEntry) -> str:
    patch = entry.patch
    low, high = patch.range
    strings = (
        f"{len(patch.strings.strings)} strings"
        if patch.strings.kind == "set"
        else "one string, shortened for every key"
    )
    lines = [strings, f"{note_name(low)} to {note_name(high)}"]
    if patch.mode != "poly":
        lines.append({"guitar": "each MIDI channel is a string", "mpe": "MPE"}[patch.mode])
    if patch.body.name:
        lines.append(f"body: {patch.body.name}")
    if patch.macros:
        lines.append(f"knobs: {', '.join(macro.name for macro in patch.macros)}")
    lines.append(f"model: {patch.preset}")
    lines.append(entry.path.name)
    return "\n".join(lines)
