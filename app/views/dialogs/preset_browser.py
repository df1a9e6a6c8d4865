"""The preset browser: a search, a list under two headings (studio, research) and a card. It stays open while in use.

type              filters the list (words in any order) and selects the best hit, which the card shows
arrows            load what is selected, or move in the list and load
Space             loads what is selected and plucks; while text is typed in the search it is a space
Ctrl+D            adds to the favourites, or removes
Enter, Escape     close
"""

from __future__ import annotations

from collections.abc import Collection, MutableSequence, Sequence
from html import escape

from PySide6.QtCore import QModelIndex, QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QAbstractItemView,
    QGridLayout,
    QHBoxLayout,
    QHeaderView,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from app.presets.filter import PresetFilter
from app.presets.library import PresetEntry
from app.presets.words import error_word, model_word, rate_word, string_word
from app.views.controls.browser import SHORTEST_CHOICE, Browser
from app.views.controls.parts import combo_box, scrolled, tool_button
from app.views.controls.plain import Label
from app.views.dialogs.preset_card import preset_card
from training.heard_words import HEARD_TIP, heard_sentence, heard_word

_STAR, _TITLE, _RATE, _ERROR, _HEARD = range(5)
_HEADINGS = {True: "STUDIO PRESETS", False: "RESEARCH PRESETS"}
_HINT = "Type to search   ·   ↑ ↓ load   ·   Space plucks   ·   Ctrl+D favourite   ·   Enter closes"
_NONE = "No matching preset: clear the search or filters."


class PresetBrowser(Browser):
    """Shows what it is given; hidden at first."""

    list: QTreeWidget

    filter_changed = Signal(object)  # PresetFilter
    pluck_asked = Signal()
    folder_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("presets", "Words in any order, separated by spaces or commas", parent)
        self._entries: Sequence[PresetEntry] = ()
        self._rows: MutableSequence[QTreeWidgetItem] = []  # of the entries, without the headings
        self.search.textChanged.connect(self._tell_filter)
        self._strings = combo_box(
            "String", [("All strings", ""), ("Linear", "linear"), ("With pitch glide", "nonlinear")]
        )
        self._models = combo_box("Model", [("All models", "")])
        self._rates = combo_box("Rate", [("All rates", 0)])
        for box in (self._strings, self._models, self._rates):
            box.setToolTip(f"Show only presets of this {box.accessibleName().lower()}")
            box.setMinimumContentsLength(SHORTEST_CHOICE)
            box.currentIndexChanged.connect(self._tell_filter)
        self._order = combo_box(
            "Order", [("Truest first", "truest"), ("By name", "name"), ("Smallest error", "error")]
        )
        self._order.setToolTip(
            "Sort by distance of the sound from the truth, by name or by error; favourites first in each group"
        )
        self._order.setMinimumContentsLength(SHORTEST_CHOICE)
        self._order.currentIndexChanged.connect(self._tell_filter)
        self._starred = tool_button("★  Favourites", "Favourites only", "Show only favourites")
        self._starred.setCheckable(True)
        self._starred.toggled.connect(self._tell_filter)
        self.list = self._build_list()
        self._card = Label(textFormat=Qt.TextFormat.RichText, wordWrap=True)
        self._card.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._card.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._state = Label()
        self._state.setObjectName("faint")
        self._lay_out()
        self.watch_keys()

    def _build_list(self) -> QTreeWidget:
        made = QTreeWidget()
        made.setAccessibleName("Presets")
        made.setToolTip("Arrows load, Space plucks, Enter closes")
        made.setHeaderLabels(["", "Preset", "Rate", "Error", "Heard"])
        made.setRootIsDecorated(False)
        made.setIndentation(0)
        made.setItemsExpandable(False)
        made.setUniformRowHeights(True)
        made.setTextElideMode(Qt.TextElideMode.ElideMiddle)  # presets of one string differ at the end
        made.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        made.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        columns = made.headerItem()
        columns.setToolTip(_ERROR, "Relative mean absolute error of the model on validation data")
        columns.setToolTip(_HEARD, HEARD_TIP)
        header = made.header()
        header.setStretchLastSection(False)
        header.setSectionsClickable(False)
        header.setMinimumSectionSize(26)
        for column in (_STAR, _RATE, _ERROR, _HEARD):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(_TITLE, QHeaderView.ResizeMode.Stretch)
        made.currentItemChanged.connect(lambda item: self.load(_name_of(item)))
        made.itemClicked.connect(self._clicked)
        made.itemDoubleClicked.connect(lambda _item, column: self.dismiss() if column != _STAR else None)
        return made

    def _lay_out(self) -> None:
        close = tool_button("✕", "Close the browser", "Close (Escape)")
        close.clicked.connect(self.dismiss)
        folder = tool_button(
            "Open folder",
            tip="Show the folder of your presets; a preset file dropped on the window is copied there",
        )
        folder.clicked.connect(self.folder_asked)
        head = QHBoxLayout()
        head.addWidget(self.search, 1)
        for widget in (self._strings, self._models, self._rates, self._order, self._starred, close):
            head.addWidget(widget)
        self._card.setContentsMargins(14, 4, 10, 10)
        hint = Label(_HINT)
        hint.setObjectName("faint")
        foot = QHBoxLayout()
        foot.addWidget(self._state, 1)
        foot.addWidget(folder)
        grid = QGridLayout(self)
        grid.setContentsMargins(14, 14, 14, 12)
        grid.setSpacing(10)
        grid.addLayout(head, 0, 0, 1, 2)
        grid.addWidget(self.list, 1, 0)
        grid.addWidget(scrolled(self._card), 1, 1)
        grid.addLayout(foot, 2, 0, 1, 2)
        grid.addWidget(hint, 3, 0, 1, 2)
        grid.setColumnStretch(0, 7)
        grid.setColumnStretch(1, 4)
        grid.setRowStretch(1, 1)

    # What is shown

    def set_kinds(self, models: Sequence[str], rates_hz: Sequence[int]) -> None:
        """What the presets can be filtered by."""
        for box, entries in (
            (self._models, [("All models", ""), *((model_word(model), model) for model in models)]),
            (self._rates, [("All rates", 0), *((rate_word(rate), rate) for rate in rates_hz)]),
        ):
            with QSignalBlocker(box):
                chosen = box.currentData()
                box.clear()
                for text, data in entries:
                    box.addItem(text, data)
                box.setCurrentIndex(max(0, box.findData(chosen)))

    def show_entries(
        self, entries: Sequence[PresetEntry], favourites: Collection[str], chosen: str, total: int, folder: str
    ) -> None:
        """The presets that pass the filter, of `total`; `folder`: of the user's own."""
        self._entries = entries
        with QSignalBlocker(self.list):
            self.list.clear()
            headings = {studio: self._add_heading(studio) for studio in dict.fromkeys(e.studio for e in entries)}
            self._rows = []
            for entry in entries:
                info = entry.info
                star = "★" if entry.name in favourites else "☆"
                heard = heard_word(entry.heard)
                item = QTreeWidgetItem([star, entry.title, rate_word(info.rate_hz), error_word(info), heard])
                kind = f"{model_word(info.model)}, {string_word(info.tension_modulated)}"
                item.setData(_TITLE, Qt.ItemDataRole.UserRole, entry.name)
                item.setToolTip(_TITLE, _tip(entry.title, kind, entry.path.name))
                item.setToolTip(_HEARD, _tip(heard_sentence(entry.heard, entry.name)))
                item.setToolTip(_STAR, "Favourite (Ctrl+D)")
                for column in (_RATE, _ERROR):
                    item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                headings[entry.studio].addChild(item)
                self._rows.append(item)
            self.list.expandAll()
        found = f"{len(entries)} of {total} presets" if len(entries) < total else f"{total} presets"
        self._state.setText(f"{found}   ·   your own: {folder}" if total else f"No presets   ·   your own: {folder}")
        if chosen != self.loaded:
            self.loaded = self.selected = chosen
        self.select(self.selected)

    def _add_heading(self, studio: bool) -> QTreeWidgetItem:
        heading = QTreeWidgetItem(self.list, [_HEADINGS[studio]])
        heading.setFlags(Qt.ItemFlag.ItemIsEnabled)
        heading.setFirstColumnSpanned(True)
        font = heading.font(0)
        font.setBold(True)
        heading.setFont(0, font)
        return heading

    @property
    def listed(self) -> Sequence[str]:
        return [entry.name for entry in self._entries]

    def title(self, name: str) -> str:
        return self._entries[self.listed.index(name)].title

    def mark(self, name: str) -> None:
        if name:
            self.list.setCurrentItem(self._rows[self.listed.index(name)], _TITLE)
        else:
            self.list.setCurrentIndex(QModelIndex())

    def show_card(self, name: str) -> None:
        self._card.setText(preset_card(self._entries[self.listed.index(name)]) if name else _NONE)

    # What is asked

    def clear_filter(self) -> None:
        """Lists all presets again; emits `filter_changed` once."""
        boxes = (self._strings, self._models, self._rates)
        for widget in (self.search, *boxes, self._starred):
            widget.blockSignals(True)
        self.search.clear()
        for box in boxes:
            box.setCurrentIndex(0)
        self._starred.setChecked(False)
        for widget in (self.search, *boxes, self._starred):
            widget.blockSignals(False)
        self._tell_filter()

    def _tell_filter(self) -> None:
        self.selected = ""  # the best hit is selected
        self.filter_changed.emit(
            PresetFilter(
                self.search.text(),
                self._strings.currentData(),
                self._models.currentData(),
                self._rates.currentData(),
                self._starred.isChecked(),
                self._order.currentData(),
            )
        )

    def _clicked(self, item: QTreeWidgetItem, column: int) -> None:
        if not (name := _name_of(item)):
            self.select(self.selected)  # a heading took the mark
        elif column == _STAR:
            self.favourite_asked.emit(name)
        else:
            self.load(name)  # the best hit may be selected and not loaded

    def play(self) -> None:
        self.load(self.selected)
        self.pluck_asked.emit()

    def place(self) -> None:
        """Under the preset bar; the transport bar stays visible where the window is high enough."""
        parent = self.parentWidget()
        if parent is not None:
            top = self.top
            width, height = min(1240, parent.width() - 28), min(560, parent.height() - top - 140)
            self.setGeometry(14, top, width, max(300, height))


def _name_of(item: QTreeWidgetItem | None) -> str:
    """The name of a row's preset; empty for a heading and for none."""
    return (item.data(_TITLE, Qt.ItemDataRole.UserRole) or "") if item is not None else ""


def _tip(*lines: str) -> str:
    """A tooltip of plain text, which may come from a file."""
    return f"<p>{'<br>'.join(map(escape, lines))}</p>"
