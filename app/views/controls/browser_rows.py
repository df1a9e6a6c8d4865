"""What a browser lists: rows under headings, in a table model, and a proxy that filters and sorts them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, QSortFilterProxyModel, Qt
from PySide6.QtGui import QColor, QFont

from app.views import theme
from app.views.controls.plain import plain_tip

Index = QModelIndex | QPersistentModelIndex
Role = Qt.ItemDataRole
STAR, TITLE = range(2)  # columns
FAVOURITE, NO_FAVOURITE = "★", "☆"
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


@dataclass(frozen=True)
class Row:
    """An entry, as it is listed.

    Attributes:
        name: which entry it is; title: its name for people.
        heading: under which it is listed.
        searched: its text for the search, in lower case.
        kinds: for each filter its value, and that in words.
        card: gives its facts as rich text.
        cells: further columns, with their tooltips.
        tip: of the title.
        ranks: for each order what is sorted by, the smallest first.
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
class Column:
    """A further column: its heading, a tooltip, and whether it is aligned to the right."""

    title: str
    tip: str = ""
    right: bool = False


class RowsModel(QAbstractTableModel):
    """All rows, each heading before the first of its own; the first column has a star.

    Attributes:
        lines: a row, or a heading's text.
        favourites: names of rows.
    """

    def __init__(self, columns: Sequence[Column]) -> None:
        super().__init__()
        self._columns = columns
        self.lines: list[Row | str] = []
        self.favourites: Collection[str] = ()

    def show(self, rows: Sequence[Row], favourites: Collection[str]) -> None:
        self.beginResetModel()
        self.favourites = favourites
        self.lines = []
        for heading in dict.fromkeys(row.heading for row in rows):
            self.lines += [heading, *(row for row in rows if row.heading == heading)]
        self.endResetModel()

    @property
    def rows(self) -> list[Row]:
        return [line for line in self.lines if isinstance(line, Row)]

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(self.lines)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008
        return 0 if parent.isValid() else 1 + len(self._columns)

    def flags(self, index: Index) -> Qt.ItemFlag:
        """Headings cannot be selected."""
        return Qt.ItemFlag.ItemIsEnabled if isinstance(self.lines[index.row()], str) else super().flags(index)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Role.DisplayRole) -> Any:
        if orientation == Qt.Orientation.Horizontal and section > STAR:
            column = self._columns[section - 1]
            return {Role.DisplayRole: column.title, Role.ToolTipRole: column.tip}.get(Role(role))
        return "" if role == Role.DisplayRole else None

    def data(self, index: Index, role: int = Role.DisplayRole) -> Any:
        line, column = self.lines[index.row()], index.column()
        if isinstance(line, str):
            return _of_heading(line, Role(role)) if column == STAR else None
        if role == Role.TextAlignmentRole and column > STAR and self._columns[column - 1].right:
            return RIGHT
        star = FAVOURITE if line.name in self.favourites else NO_FAVOURITE
        cells = ((star, "Favourite (Ctrl+D)"), (line.title, line.tip), *line.cells)
        if role == Role.DisplayRole:
            return cells[column][0]
        return plain_tip(cells[column][1]) if role == Role.ToolTipRole else None


class ListedRows(QSortFilterProxyModel):
    """The rows that pass the filter: under each heading favourites first, then in the chosen order.

    Attributes:
        words: all of them must occur, in lower case; kinds: for each filter the wanted value, "" for any.
        starred: only favourites; order: which of `Row.ranks`.
    """

    def __init__(self, rows: RowsModel) -> None:
        super().__init__()
        self._model = rows
        self.words: tuple[str, ...] = ()
        self.kinds: tuple[object, ...] = ()
        self.starred, self.order = False, 0
        self.setSourceModel(rows)

    def refresh(self) -> None:
        """Filters and sorts again."""
        self.invalidate()
        self.sort(STAR)

    @property
    def listed(self) -> list[Row]:
        """In the order that is shown, without the headings."""
        lines = (self.line(self.index(row, STAR)) for row in range(self.rowCount()))
        return [line for line in lines if isinstance(line, Row)]

    def line(self, index: Index) -> Row | str:
        return self._model.lines[self.mapToSource(index).row()]

    def index_of(self, name: str) -> QModelIndex:
        """Of a listed row's title; the invalid one for any other."""
        indexes = (self.index(row, TITLE) for row in range(self.rowCount()))
        return next((index for index in indexes if _name(self.line(index)) == name), QModelIndex())

    def passes(self, row: Row) -> bool:
        kinds = zip(self.kinds, row.kinds, strict=False)
        return (
            all(word in row.searched for word in self.words)
            and all(wanted in ("", found) for wanted, (found, _) in kinds)
            and (not self.starred or row.name in self._model.favourites)
        )

    def filterAcceptsRow(self, number: int, parent: Index) -> bool:
        line = self._model.lines[number]
        if isinstance(line, Row):
            return self.passes(line)
        return any(self.passes(row) for row in self._model.rows if row.heading == line)

    def lessThan(self, left: Index, right: Index) -> bool:
        return self._rank(left.row()) < self._rank(right.row())

    def _rank(self, number: int) -> tuple[int, bool, bool, tuple[bool, float], int]:
        line, lines = self._model.lines[number], self._model.lines
        if isinstance(line, str):
            return number, False, False, (False, 0.0), 0
        starred = line.name in self._model.favourites
        return lines.index(line.heading), True, not starred, line.ranks[self.order], number


def _of_heading(text: str, role: Role) -> Any:
    if role == Role.FontRole:
        font = QFont()
        font.setBold(True)
        return font
    return {Role.DisplayRole: text, Role.ForegroundRole: QColor(theme.FAINT)}.get(role)


def _name(line: Row | str) -> str:
    return line.name if isinstance(line, Row) else ""
