"""Fields for numbers in every locale: shown text is read, either sign too, and a refused text changes nothing."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QLocale, Qt
from PySide6.QtWidgets import QDialog, QPushButton, QToolTip, QVBoxLayout
from pytestqt.qtbot import QtBot

import app
from app.views.controls.form import count_box, spin_box
from app.views.controls.number_box import CountBox, NumberBox

KINDS = {  # as in the dialogs
    "length": ((0, 5), " m", 3, ""),
    "seconds": ((0.1, 600), " s", 1, "at most "),
    "decay": ((20, 120), " dB", 0, "by "),
    "gain": ((-20, 60), " dB", 0, "+"),
}


@pytest.fixture(params=["de_DE", "fr_FR", "C", "en_US", "ar_EG"])
def locale(request: pytest.FixtureRequest) -> Iterator[str]:
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    yield request.param
    QLocale.setDefault(before)


def made(qtbot: QtBot, kind: str, value: float) -> NumberBox:
    limits, suffix, decimals, prefix = KINDS[kind]
    box = spin_box("number", limits, value, "", suffix, decimals, prefix=prefix)
    qtbot.addWidget(box)
    box.show()
    return box


def type_in(qtbot: QtBot, box: NumberBox | CountBox, text: str, whole: bool = False) -> None:
    """Types over the number, or over all of the field, and Enter."""
    if whole:
        box.lineEdit().selectAll()
    else:
        box.selectAll()
    qtbot.keyClicks(box, text)
    qtbot.keyClick(box, Qt.Key.Key_Return)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_shown_is_read(qtbot: QtBot, locale: str, kind: str) -> None:
    draw, (limits, suffix, decimals, _) = random.Random(0), KINDS[kind]
    box = made(qtbot, kind, limits[0])
    for _ in range(10):
        value = round(draw.uniform(*limits), decimals)
        box.setValue(value)
        shown = box.text()
        assert f"{value:.{decimals}f}" in shown, "a point, as on knobs"
        number = f"{value:.{decimals}f}"
        for text in (shown, number, number.replace(".", ","), number + suffix, number + suffix.strip()):
            for whole in (False, True):
                if text == shown and not whole:
                    continue
                box.setValue(limits[1])
                type_in(qtbot, box, text, whole)
                assert (box.value(), box.text()) == (value, shown), text


@pytest.mark.parametrize("text", ["", "x", "2.5.1", "0.3 cm", "1e", "65", "-1", "nan"])
def test_a_refused_text_leaves_the_value_and_says_so(qtbot: QtBot, locale: str, text: str) -> None:
    QToolTip.hideText()
    qtbot.waitUntil(lambda: not QToolTip.isVisible())
    box = made(qtbot, "length", 0.65)
    changes: list[float] = []
    box.valueChanged.connect(changes.append)
    box.selectAll()
    qtbot.keyClick(box, Qt.Key.Key_Delete)
    type_in(qtbot, box, text)
    assert (box.value(), box.text(), changes) == (0.65, "0.650 m", [])
    assert QToolTip.isVisible() and "0.650 m is" in QToolTip.text()


def test_a_refused_text_does_not_press_the_dialogs_button(qtbot: QtBot) -> None:
    dialog, box, button = QDialog(), spin_box("number", (0, 5), 1, "", " m", 2), QPushButton("Do it", default=True)
    qtbot.addWidget(dialog)
    column = QVBoxLayout(dialog)
    for part in (box, button):
        column.addWidget(part)
    pressed: list[bool] = []
    button.clicked.connect(lambda: pressed.append(True))
    dialog.show()
    type_in(qtbot, box, "1.2.3")
    assert pressed == []
    type_in(qtbot, box, "1,2")
    assert pressed == [True] and box.value() == 1.2


def test_a_word_for_no_value(qtbot: QtBot, locale: str) -> None:
    box = made(qtbot, "length", 0)
    box.setSpecialValueText("assumed")
    assert box.text() == "assumed"
    type_in(qtbot, box, "0,65", whole=True)
    assert (box.value(), box.text()) == (0.65, "0.650 m")
    box.lineEdit().selectAll()
    qtbot.keyClick(box, Qt.Key.Key_Delete)
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert (box.value(), box.text()) == (0, "assumed")


def test_counts_are_whole(qtbot: QtBot, locale: str) -> None:
    box = count_box("trials", 5000, 16, "")
    qtbot.addWidget(box)
    box.show()
    for text, value in (("12", 12), ("2.5", 12), ("1 234", 1234), ("5001", 1234), ("0", 1234), ("8.0", 8), ("a", 8)):
        type_in(qtbot, box, text)
        assert (box.value(), box.text()) == (value, str(value)), text
    qtbot.keyClick(box, Qt.Key.Key_Up)
    assert box.value() == 9


def test_every_number_field_of_the_app_is_one_of_these() -> None:
    """Qt's own would follow the locale."""
    own = re.compile(r"\b(QDoubleSpinBox|QSpinBox|QDoubleValidator|QIntValidator|getDouble|getInt)\(")
    files = [path for path in Path(app.__path__[0]).rglob("*.py") if own.search(path.read_text())]
    assert files == []
