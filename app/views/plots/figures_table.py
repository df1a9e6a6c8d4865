"""A table of figures: sorted by any column, copied as text, its rows chosen by mouse or keyboard."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import (
    QAbstractTableModel,
    QEvent,
    QModelIndex,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QGuiApplication, QKeyEvent, QKeySequence, QPalette
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableView,
    QWidget,
)

from app.views import theme
from app.views.controls.parts import ENTER_KEYS, keeps_own_keys, lay_out_view, tool_button
from app.views.controls.plain import plain_tip
from app.views.controls.segments import SMALL

Index = QModelIndex | QPersistentModelIndex
Value = str | float | int | None
RIGHT_ALIGNED = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
NARROWEST_PIXELS, WIDEST_PIXELS = 46, 260
LEFT_ALIGNED = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter


@dataclass(frozen=True)
class Column:
    """A column: the field it shows, its heading, its tooltip, how a value is written, and whose colour it has."""

    field: str
    title: str
    tip: str
    text: Callable[[Any], str] = str
    source: str = ""  # a key of `theme.SOURCE_COLOURS`; "": no colour of its own


def values_of(row: object, columns: Sequence[Column]) -> tuple[Value, ...]:
    """The values of a record in the order of the columns."""
    return tuple(getattr(row, column.field) for column in columns)


@dataclass(frozen=True)
class TableRow:
    """A row: its key, its values in the order of the columns, how it looks, and its tooltip."""

    key: object
    values: tuple[Value, ...]
    grey: bool = False
    bold: bool = False
    tip: str = ""


def _colour(column: Column) -> str:
    return theme.SOURCE_COLOURS[column.source] if column.source else theme.TEXT


class FiguresTable(QTableView):
    """A value of None is written as "–" and sorted last in either order."""

    row_clicked = Signal(object)  # its key
    row_double_clicked = Signal(object)
    row_entered = Signal(object)  # by Enter
    row_deleted = Signal(object)  # by Delete
    escaped = Signal()

    def __init__(self, name: str, columns: Sequence[Column], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(name)
        self._rows = _Rows(columns)
        self._sorted = _NoneLast()
        self._sorted.setSourceModel(self._rows)
        self.setModel(self._sorted)
        self.setItemDelegate(_OwnColours(self))
        self.setSortingEnabled(True)
        self.sortByColumn(0, Qt.SortOrder.AscendingOrder)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setTextElideMode(Qt.TextElideMode.ElideMiddle)  # names of one kind differ at the end
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(22)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setMinimumSectionSize(NARROWEST_PIXELS)
        self.horizontalHeader().setMaximumSectionSize(WIDEST_PIXELS)
        self.horizontalHeader().setStretchLastSection(True)
        self.horizontalHeader().setHighlightSections(False)
        self.clicked.connect(lambda index: self.row_clicked.emit(self._key(index)))
        self.doubleClicked.connect(lambda index: self.row_double_clicked.emit(self._key(index)))

    def show_rows(self, rows: Sequence[TableRow]) -> None:
        """Replaces all rows; the chosen one stays chosen where it is still there."""
        chosen = self.chosen_key
        self._rows.replace(rows)
        self.choose(chosen)

    def set_dimmed(self, dimmed: bool) -> None:
        """Makes all rows grey: they are of an earlier pluck."""
        self._rows.dimmed = dimmed
        self.viewport().update()

    @property
    def rows(self) -> list[TableRow]:
        """In the order in which they are shown."""
        return [self._row(self._sorted.index(place, 0)) for place in range(self._sorted.rowCount())]

    @property
    def chosen_key(self) -> object:
        """The key of the selected row; None: none is."""
        index = self.currentIndex()
        return self._key(index) if index.isValid() else None

    def choose(self, key: object) -> None:
        """Marks the row of a key; one that is not there clears the mark."""
        for place, row in enumerate(self.rows):
            if row.key == key:
                if place != self.currentIndex().row():
                    self.selectRow(place)
                return
        self.clearSelection()
        self.setCurrentIndex(QModelIndex())

    def text(self) -> str:
        """All that is shown, sorted as it is: headings and rows, tabs between, to paste into a spreadsheet."""
        lines = [[column.title for column in self._rows.columns]]
        lines += [["" if value is None else f"{value}" for value in row.values] for row in self.rows]
        return "\n".join("\t".join(line) for line in lines) + "\n"

    def copy(self) -> None:
        QGuiApplication.clipboard().setText(self.text())

    def event(self, event: QEvent) -> bool:
        """Keeps Enter and Esc, which are shortcuts of the window, while the table has the focus."""
        return keeps_own_keys(event) or super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.matches(QKeySequence.StandardKey.Copy):
            self.copy()
        elif event.key() in ENTER_KEYS:
            if self.currentIndex().isValid():
                self.row_entered.emit(self.chosen_key)
        elif event.key() == Qt.Key.Key_Delete:
            if self.currentIndex().isValid():
                self.row_deleted.emit(self.chosen_key)
        elif event.key() == Qt.Key.Key_Escape:
            self.escaped.emit()
        else:
            super().keyPressEvent(event)

    def _row(self, index: QModelIndex) -> TableRow:
        return self._rows.rows[self._sorted.mapToSource(index).row()]

    def _key(self, index: QModelIndex) -> object:
        return self._row(index).key


class _Rows(QAbstractTableModel):
    """The model of `FiguresTable`."""

    def __init__(self, columns: Sequence[Column]) -> None:
        super().__init__()
        self.columns = columns
        self.rows: list[TableRow] = []
        self.dimmed = False

    def replace(self, rows: Sequence[TableRow]) -> None:
        if [row.key for row in rows] == [row.key for row in self.rows]:  # the place of the scroll bar stays
            self.rows = list(rows)
            if rows:
                self.dataChanged.emit(self.index(0, 0), self.index(len(rows) - 1, len(self.columns) - 1))
            return
        self.beginResetModel()
        self.rows = list(rows)
        self.endResetModel()

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 (Qt's own default)
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008
        return 0 if parent.isValid() else len(self.columns)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        if orientation == Qt.Orientation.Horizontal:
            if role == Qt.ItemDataRole.DisplayRole:
                return self.columns[section].title
            if role == Qt.ItemDataRole.ToolTipRole:
                return self.columns[section].tip + "\nClick to sort"
            if role == Qt.ItemDataRole.TextAlignmentRole:
                return self._alignment(section)
        return None

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        row, column = self.rows[index.row()], self.columns[index.column()]
        value = row.values[index.column()]
        if role == Qt.ItemDataRole.DisplayRole:
            return "–" if value is None else column.text(value)
        if role == Qt.ItemDataRole.UserRole:
            return value
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return self._alignment(index.column())
        if role == Qt.ItemDataRole.FontRole and row.bold:
            return theme.small_font(12, bold=True)
        if role == Qt.ItemDataRole.ForegroundRole:
            return QColor(theme.FAINT if self.dimmed or row.grey or value is None else _colour(column))
        if role == Qt.ItemDataRole.ToolTipRole:
            return plain_tip(row.tip) or None
        return None

    def _alignment(self, column: int) -> Qt.AlignmentFlag:
        return LEFT_ALIGNED if self.columns[column].text is str else RIGHT_ALIGNED


class _OwnColours(QStyledItemDelegate):
    """Keeps the colours of the columns in the selected row."""

    def initStyleOption(self, option: QStyleOptionViewItem, index: Index) -> None:
        super().initStyleOption(option, index)
        colour = index.data(Qt.ItemDataRole.ForegroundRole)
        option.palette.setColor(QPalette.ColorRole.HighlightedText, colour)


class _NoneLast(QSortFilterProxyModel):
    """Sorts by value, with what has none at the end in either order."""

    def lessThan(self, left: Index, right: Index) -> bool:
        one, other = (self.sourceModel().data(index, Qt.ItemDataRole.UserRole) for index in (left, right))
        descending = self.sortOrder() == Qt.SortOrder.DescendingOrder
        if one is None or other is None:
            return (one is None) == descending if (one is None) != (other is None) else False
        return bool(one < other)


def lay_out_table(
    view: QWidget,
    before: Sequence[QWidget],
    words: QWidget,
    behind: Sequence[QWidget],
    progress: QWidget,
    table: FiguresTable,
) -> None:
    """As `lay_out_view`, with a button that copies the table."""
    copy = tool_button("Copy", "Copy the table", "Copy the table as text with tabs (Ctrl+C)")
    copy.clicked.connect(table.copy)
    for control in (*before, *behind, copy):
        control.setStyleSheet(SMALL)
    lay_out_view(view, before, words, (*behind, copy), progress, table)
