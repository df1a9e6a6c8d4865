"""A table of figures: sorted by any column, copied as text, its rows chosen by mouse or keyboard."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

from PySide6.QtCore import QEvent, QModelIndex, QPersistentModelIndex, Qt, Signal
from PySide6.QtGui import QColor, QGuiApplication, QKeyEvent, QKeySequence, QPalette
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.views import theme
from app.views.controls.parts import ENTER_KEYS, keeps_keys, lay_out_view, tool_button
from app.views.controls.plain import plain_tip

Index = QModelIndex | QPersistentModelIndex
Value = str | float | int | None
NARROWEST_PIXELS, WIDEST_PIXELS = 46, 260  # of a column


@dataclass(frozen=True)
class FigureColumn:
    """A column: the field it shows, its heading, its tooltip, how a value is written, and whose colour it has."""

    field: str
    title: str
    tip: str
    text: Callable[[Any], str] = str
    source: str = ""  # a key of `theme.SOURCE_COLOURS`; "": no colour of its own


def values_of(row: object, columns: Sequence[FigureColumn]) -> tuple[Value, ...]:
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


class FiguresTable(QTableWidget):
    """A table of records, one a row. A value of None is written as "–" and sorted last in either order."""

    row_clicked = Signal(object)  # its key
    row_double_clicked = Signal(object)
    row_entered = Signal(object)  # by Enter
    row_deleted = Signal(object)  # by Delete
    escaped = Signal()

    def __init__(self, name: str, columns: Sequence[FigureColumn], parent: QWidget | None = None) -> None:
        super().__init__(0, len(columns), parent)
        self.setAccessibleName(name)
        self._columns, self._dimmed = columns, False  # dimmed: all rows are grey
        for place, column in enumerate(columns):
            heading = QTableWidgetItem(column.title)
            heading.setToolTip(f"{column.tip}\nClick to sort")
            heading.setTextAlignment(_alignment(column))
            self.setHorizontalHeaderItem(place, heading)
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
        theme.changes.theme_changed.connect(self._take_theme)

    def show_rows(self, rows: Sequence[TableRow]) -> None:
        """Replace all rows; the chosen one stays chosen where it is still there."""
        key = self.chosen_key
        self._fill(rows)
        self.choose(key)

    def _fill(self, rows: Sequence[TableRow]) -> None:
        """Replace all cells by those of rows, sorted as the heading says; the selection may be lost."""
        self.setSortingEnabled(False)
        self.setRowCount(len(rows))
        for place, row in enumerate(rows):
            for number, column in enumerate(self._columns):
                self.setItem(place, number, _Cell(column, row, row.values[number], self._dimmed))
        self.setSortingEnabled(True)  # sorts them again

    def _take_theme(self) -> None:
        self._fill(self.rows)

    def set_dimmed(self, dimmed: bool) -> None:
        """Make all rows grey: they are of an earlier pluck."""
        self._dimmed = dimmed
        self._fill(self.rows)

    @property
    def rows(self) -> list[TableRow]:
        """The rows in the order in which they are shown."""
        return [self._row(place) for place in range(self.rowCount())]

    @property
    def chosen_key(self) -> object:
        """The key of the selected row; None: none is."""
        index = self.currentIndex()
        return self._key(index) if index.isValid() else None

    def choose(self, key: object) -> None:
        """Mark the row of a key; one that is not there clears the mark."""
        for place, row in enumerate(self.rows):
            if row.key == key:
                if place != self.currentIndex().row():
                    self.selectRow(place)
                return
        self.clearSelection()
        self.setCurrentIndex(QModelIndex())

    def text(self) -> str:
        """The shown rows, sorted as they are: headings and rows, tabs between, to paste into a spreadsheet."""
        lines = [[column.title for column in self._columns]]
        lines += [["" if value is None else f"{value}" for value in row.values] for row in self.rows]
        return "\n".join("\t".join(line) for line in lines) + "\n"

    def copy(self) -> None:
        QGuiApplication.clipboard().setText(self.text())

    def event(self, event: QEvent) -> bool:
        """Keep Enter and Esc, which are shortcuts of the window, while the table has the focus."""
        return keeps_keys(event, *ENTER_KEYS, Qt.Key.Key_Escape) or super().event(event)

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

    def _row(self, place: int) -> TableRow:
        return cast("_Cell", self.item(place, 0)).row_shown

    def _key(self, index: QModelIndex) -> object:
        return self._row(index.row()).key


class _Cell(QTableWidgetItem):
    """A value of a row."""

    def __init__(self, column: FigureColumn, row: TableRow, value: Value, dimmed: bool) -> None:
        super().__init__("–" if value is None else column.text(value))
        self.row_shown, self._value = row, value
        self.setTextAlignment(_alignment(column))
        self.setToolTip(plain_tip(row.tip))
        if row.bold:
            self.setFont(theme.small_font(12, bold=True))
        column_colour = theme.SOURCE_COLOURS[column.source] if column.source else theme.TEXT
        self.setForeground(QColor(theme.FAINT if dimmed or row.grey or value is None else column_colour))

    def __lt__(self, other: QTableWidgetItem) -> bool:
        """Compare by value for Qt's sorting; None is last in either order."""
        one, another = self._value, cast("_Cell", other)._value
        if one is None or another is None:
            descending = self.tableWidget().horizontalHeader().sortIndicatorOrder() == Qt.SortOrder.DescendingOrder
            return (one is None) == descending if (one is None) != (another is None) else False
        return bool(one < another)  # type: ignore[operator]


class _OwnColours(QStyledItemDelegate):
    """A delegate that keeps the colours of the columns in the selected row."""

    def initStyleOption(self, option: QStyleOptionViewItem, index: Index) -> None:
        super().initStyleOption(option, index)
        option.palette.setBrush(QPalette.ColorRole.HighlightedText, index.data(Qt.ItemDataRole.ForegroundRole))


def _alignment(column: FigureColumn) -> Qt.AlignmentFlag:
    side = Qt.AlignmentFlag.AlignLeft if column.text is str else Qt.AlignmentFlag.AlignRight
    return side | Qt.AlignmentFlag.AlignVCenter


def lay_out_table(
    view: QWidget,
    before: Sequence[QWidget],
    words: QWidget,
    behind: Sequence[QWidget],
    progress: QWidget,
    table: FiguresTable,
) -> None:
    """Lay out a table as `lay_out_view`, with a button that copies the table."""
    copy = tool_button("Copy", "Copy the table", "Copy the table as text with tabs (Ctrl+C)")
    copy.clicked.connect(table.copy)
    lay_out_view(view, before, words, (*behind, copy), progress, table)
