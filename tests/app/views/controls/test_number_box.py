"""Fields for numbers in every locale: shown text is read, either sign too, and a refused text changes nothing."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QLocale, Qt
from PySide6.QtWidgets import QAbstractSpinBox, QDialog, QPushButton, QToolTip, QVBoxLayout
from pytestqt.qtbot import QtBot

import app
from app.views.controls.number_box import CountBox, NoteBox, NumberBox
from tests.app.gestures import reported

KINDS = {  # as in the dialogs
    "length": ((0, 5), " m", 3, ""),
    "seconds": ((0.1, 600), " s", 1, "at most "),
    "decay": ((20, 120), " dB", 0, "by "),
    "gain": ((-20, 60), " dB", 0, "+"),
}


@pytest.fixture(params=["de_DE", "fr_FR", "C", "ar_EG"])
def locale(request: pytest.FixtureRequest) -> Iterator[str]:
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    yield request.param
    QLocale.setDefault(before)


def made(qtbot: QtBot, kind: str, value: float) -> NumberBox:
    limits, suffix, decimals, prefix = KINDS[kind]
    box = NumberBox("number", limits, value, "", suffix, decimals, prefix=prefix)
    qtbot.addWidget(box)
    box.show()
    return box


def type_in(qtbot: QtBot, box: QAbstractSpinBox, text: str, whole: bool = False) -> None:
    """Types over the number, or over all of the field, and Enter."""
    (box.lineEdit() if whole else box).selectAll()
    qtbot.keyClicks(box, text)
    qtbot.keyClick(box, Qt.Key.Key_Return)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_shown_is_read(qtbot: QtBot, locale: str, kind: str) -> None:
    draw, (limits, suffix, decimals, _) = random.Random(0), KINDS[kind]
    box = made(qtbot, kind, limits[0])
    for _ in range(3):
        value = round(draw.uniform(*limits), decimals)
        box.setValue(value)
        shown, number = box.text(), f"{value:.{decimals}f}"
        assert number in shown, "a point, as on knobs"
        for text in (shown, number, number.replace(".", ","), number + suffix, number + suffix.strip()):
            for whole in (False, True):
                if text == shown and not whole:
                    continue
                box.setValue(limits[1])
                type_in(qtbot, box, text, whole)
                assert (box.value(), box.text()) == (value, shown), text


@pytest.mark.parametrize("text", ["", "x", "2.5.1", "0.3 cm", "1e", "65", "-1", "nan"])
def test_a_refused_text_leaves_the_value_says_so_and_presses_no_button(qtbot: QtBot, locale: str, text: str) -> None:
    QToolTip.hideText()
    qtbot.waitUntil(lambda: not QToolTip.isVisible())
    dialog, box, button = QDialog(), made(qtbot, "length", 0.65), QPushButton("Do it", default=True)
    qtbot.addWidget(dialog)
    column = QVBoxLayout(dialog)
    for part in (box, button):
        column.addWidget(part)
    pressed, changes = reported(button.clicked), reported(box.valueChanged)
    dialog.show()
    box.selectAll()
    qtbot.keyClick(box, Qt.Key.Key_Delete)
    type_in(qtbot, box, text)
    assert (box.value(), box.text(), changes, pressed) == (0.65, "0.650 m", [], [])
    assert QToolTip.isVisible() and "0.650 m is" in QToolTip.text()
    type_in(qtbot, box, "1,2")
    assert len(pressed) == 1 and box.value() == 1.2


def test_counts_are_whole(qtbot: QtBot, locale: str) -> None:
    box = CountBox("trials", 5000, 16, "")
    qtbot.addWidget(box)
    box.show()
    for text, value in (("12", 12), ("2.5", 12), ("1 234", 1234), ("5001", 1234), ("0", 1234), ("8.0", 8), ("a", 8)):
        type_in(qtbot, box, text)
        assert (box.value(), box.text()) == (value, str(value)), text
    qtbot.keyClick(box, Qt.Key.Key_Up)
    assert box.value() == 9


def test_a_note_is_typed_by_its_name_and_one_out_of_range_is_not_taken(qtbot: QtBot) -> None:
    box = NoteBox("Lowest key", "")
    qtbot.addWidget(box)
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


def test_every_number_field_of_the_app_is_one_of_these() -> None:
    """Qt's own would follow the locale."""
    own = re.compile(r"\b(QDoubleSpinBox|QSpinBox|QDoubleValidator|QIntValidator|getDouble|getInt)\(")
    files = [path for path in Path(app.__path__[0]).rglob("*.py") if own.search(path.read_text())]
    assert files == []
