"""Fields for numbers in every locale: shown text is read, either sign too, and a refused text changes nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from PySide6.QtCore import QLocale, Qt
from PySide6.QtWidgets import QAbstractSpinBox, QDialog, QPushButton, QToolTip, QVBoxLayout
from pytestqt.qtbot import QtBot

from app.views.controls.number_box import CountBox, NoteBox, NumberBox
from tests.app.gestures import reported


@pytest.fixture(params=["de_DE", "fr_FR", "C", "ar_EG"])
def locale(request: pytest.FixtureRequest) -> Iterator[str]:
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    yield request.param
    QLocale.setDefault(before)


def type_in(qtbot: QtBot, box: QAbstractSpinBox, text: str) -> None:
    """Type over the number, and Enter."""
    box.selectAll()
    qtbot.keyClicks(box, text)
    qtbot.keyClick(box, Qt.Key.Key_Return)


def test_a_refused_text_leaves_the_value_says_so_and_presses_no_button(
    qtbot: QtBot, locale: str, show: Callable[..., QDialog]
) -> None:
    dialog, button = QDialog(), QPushButton("Do it", default=True)
    box = NumberBox("length", (0, 5), 0.65, "", " m", 3)
    column = QVBoxLayout(dialog)
    for part in (box, button):
        column.addWidget(part)
    pressed, changes = reported(button.clicked), reported(box.valueChanged)
    show(dialog)
    for text in ("", "x", "2.5.1", "0.3 cm", "1e", "65", "-1", "nan"):
        QToolTip.hideText()
        qtbot.waitUntil(lambda: not QToolTip.isVisible())
        box.selectAll()
        qtbot.keyClick(box, Qt.Key.Key_Delete)
        type_in(qtbot, box, text)
        assert (box.value(), box.text(), changes, pressed) == (0.65, "0.650 m", [], []), text
        assert QToolTip.isVisible() and "0.650 m is" in QToolTip.text()
    type_in(qtbot, box, "1,2")
    assert len(pressed) == 1 and box.value() == 1.2


def test_counts_are_whole(qtbot: QtBot, locale: str, show: Callable[..., CountBox]) -> None:
    box = show(CountBox("trials", 5000, 16, ""))
    for text, value in (("12", 12), ("2.5", 12), ("1 234", 1234), ("5001", 1234), ("0", 1234), ("8.0", 8), ("a", 8)):
        type_in(qtbot, box, text)
        assert (box.value(), box.text()) == (value, str(value)), text
    qtbot.keyClick(box, Qt.Key.Key_Up)
    assert box.value() == 9


def test_a_note_is_typed_by_its_name_and_one_out_of_range_is_not_taken(
    qtbot: QtBot, show: Callable[..., NoteBox]
) -> None:
    box = show(NoteBox("Lowest key", ""))
    box.setRange(40, 76)
    box.setValue(52)
    assert box.text() == "E3"
    box.selectAll()
    qtbot.keyClicks(box, "bb2")
    assert box.value() == 52  # only when it is whole
    for text in ("bb2", "C9", "x"):
        type_in(qtbot, box, text)
        assert (box.value(), box.text()) == (46, "A♯2")
    qtbot.keyClick(box, Qt.Key.Key_Up)
    assert box.text() == "B2"
