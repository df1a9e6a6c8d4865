"""The rows of a browser, under headings, filtered and sorted."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import groupby

from PySide6.QtCore import QModelIndex, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QTreeWidget, QTreeWidgetItem

from app.views import theme
from app.views.controls.plain import plain_tip

STAR, TITLE = range(2)  # columns
FAVOURITE, NO_FAVOURITE = "★", "☆"
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


@dataclass(frozen=True)
class BrowserRow:
    """An entry, as it is listed.

    Attributes:
        name: which entry it is; title: its name for people.
        heading: under which it is listed.
        searched: its text for the search, in lower case.
        kinds: (value, its words) for each filter of the browser.
        card: gives its facts as rich text.
        cells: (text, tooltip) for each column behind the title's.
        tip: of the title.
        ranks: for each order of the browser what is sorted by: (whether unknown, value), the smallest first.
        own: whether it can be renamed and deleted.
    """

    name: str
    title: str
    heading: str
    searched: str
    kinds: tuple[tuple[object, str], ...]
    card: Callable[[], str]
    cells: tuple[tuple[str, str], ...] = ()
    tip: str = ""
    ranks: tuple[tuple[bool, float], ...] = ((False, 0.0),)
    own: bool = False


@dataclass(frozen=True)
class BrowserColumn:
    """A further column: its heading, a tooltip, and whether it is aligned to the right."""

    title: str
    tip: str = ""
    right: bool = False


def listed_rows(
    rows: Sequence[BrowserRow],
    favourites: Collection[str],
    words: Collection[str] = (),
    kinds: Sequence[object] = (),
    starred: bool = False,
    order: int = 0,
) -> list[BrowserRow]:
    """The rows that pass the filter: under each heading favourites first, then in the chosen order.

    Args:
        words: all of them must occur, in lower case.
        kinds: for each filter the wanted value, "" for any.
        starred: only favourites.
        order: which of `BrowserRow.ranks`.
    """
    headings = list(dict.fromkeys(row.heading for row in rows))
    hits = [
        row
        for row in rows
        if all(word in row.searched for word in words)
        and all(filter_kind in ("", kind) for filter_kind, (kind, _) in zip(kinds, row.kinds, strict=False))
        and (not starred or row.name in favourites)
    ]
    return sorted(hits, key=lambda row: (headings.index(row.heading), row.name not in favourites, row.ranks[order]))


class RowList(QTreeWidget):
    """Rows under headings. A heading cannot be selected. The first column has the star of a favourite."""

    def __init__(self, columns: Sequence[BrowserColumn]) -> None:
        super().__init__()
        self.setIndentation(0)
        self.setItemsExpandable(False)
        self.setUniformRowHeights(True)
        self._columns = columns
        self.setHeaderLabels(["", *(column.title for column in columns)])
        for place, column in enumerate(columns, TITLE):
            self.headerItem().setToolTip(place, column.tip)
        self._lines: list[BrowserRow | str] = []  # for each line shown its row, or a heading's text

    def show_rows(self, rows: Sequence[BrowserRow], favourites: Collection[str]) -> None:
        """List rows in their order, each heading before the first of its own."""
        self.clear()
        self._lines = []
        for heading, under in groupby(rows, lambda row: row.heading):
            self._lines.append(heading)
            head = QTreeWidgetItem(self, [heading])
            head.setFlags(Qt.ItemFlag.ItemIsEnabled)
            head.setFirstColumnSpanned(True)
            head.setForeground(STAR, QColor(theme.FAINT))
            font = self.font()
            font.setBold(True)
            head.setFont(STAR, font)
            for row in under:
                self._lines.append(row)
                star = FAVOURITE if row.name in favourites else NO_FAVOURITE
                cells = ((star, "Favourite (Ctrl+D)"), (row.title, row.tip), *row.cells)
                item = QTreeWidgetItem(self, [text for text, _ in cells])
                for place, (_, tip) in enumerate(cells):
                    item.setToolTip(place, plain_tip(tip))
                    if place > STAR and self._columns[place - 1].right:
                        item.setTextAlignment(place, RIGHT)

    @property
    def rows(self) -> list[BrowserRow]:
        """The rows in the order that is shown, without the headings."""
        return [line for line in self._lines if isinstance(line, BrowserRow)]

    def line(self, index: QModelIndex) -> BrowserRow | str:
        return self._lines[index.row()]

    def index_of(self, name: str) -> QModelIndex:
        """The index of a listed row's title; the invalid one for any other."""
        names = [line.name if isinstance(line, BrowserRow) else "" for line in self._lines]
        return self.model().index(names.index(name), TITLE) if name and name in names else QModelIndex()
