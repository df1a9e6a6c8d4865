"""A table of figures: its order, its text, its keys."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from pytestqt.qtbot import QtBot

from app.views.plots.figures_table import Column, FiguresTable, TableRow

COLUMNS = (Column("name", "name", "a name"), Column("level", "level", "in dB", lambda v: f"{v:.1f}"))


@pytest.fixture
def table(qtbot: QtBot) -> FiguresTable:
    made = FiguresTable("Figures", COLUMNS)
    qtbot.addWidget(made)
    made.show_rows([TableRow("b", ("b", 2.0)), TableRow("a", ("a", None)), TableRow("c", ("c", -10.0))])
    return made


def test_figures_are_sorted_as_numbers_and_none_is_last_either_way(table: FiguresTable) -> None:
    assert [row.key for row in table.rows] == ["a", "b", "c"]
    table.sortByColumn(1, Qt.SortOrder.AscendingOrder)
    assert [row.key for row in table.rows] == ["c", "b", "a"]
    table.sortByColumn(1, Qt.SortOrder.DescendingOrder)
    assert [row.key for row in table.rows] == ["b", "c", "a"]


def test_it_is_copied_as_it_is_sorted_with_all_digits(table: FiguresTable, qtbot: QtBot) -> None:
    table.show_rows([TableRow("b", ("b", 2.12345)), TableRow("a", ("a", None))])
    qtbot.keyClick(table, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    assert QGuiApplication.clipboard().text() == "name\tlevel\na\t\nb\t2.12345\n"


def test_the_chosen_row_stays_chosen(table: FiguresTable) -> None:
    table.choose("c")
    table.show_rows([TableRow("c", ("c", 3.0)), TableRow("d", ("d", 1.0))])
    assert table.chosen_key == "c"
    table.show_rows([TableRow("d", ("d", 1.0))])
    assert table.chosen_key is None


def test_its_keys(table: FiguresTable, qtbot: QtBot) -> None:
    table.show()
    table.choose("a")
    qtbot.keyClick(table, Qt.Key.Key_Down)
    with qtbot.waitSignal(table.row_entered) as entered:
        qtbot.keyClick(table, Qt.Key.Key_Return)
    assert entered.args == ["b"]
    with qtbot.waitSignal(table.row_deleted) as deleted:
        qtbot.keyClick(table, Qt.Key.Key_Delete)
    assert deleted.args == ["b"]
    with qtbot.waitSignal(table.escaped):
        qtbot.keyClick(table, Qt.Key.Key_Escape)


def test_clicks(table: FiguresTable, qtbot: QtBot) -> None:
    table.show()
    place = table.visualRect(table.model().index(2, 0)).center()
    with qtbot.waitSignal(table.row_clicked) as clicked:
        qtbot.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert clicked.args == ["c"]
    with qtbot.waitSignal(table.row_double_clicked) as twice:
        qtbot.mouseDClick(table.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert twice.args == ["c"]
