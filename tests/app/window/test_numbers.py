"""Every knob and number field of the window reads what it shows, in any locale."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QLocale, Qt
from PySide6.QtWidgets import QAbstractSpinBox
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.shared.typed_number import typed_number
from app.shared.vocabulary import Face
from app.views.controls.knob import Knob
from app.views.controls.number_box import CountBox, NumberBox
from app.views.dialogs.export_dialog import ExportDialog
from app.window.controller import Controller


@pytest.fixture
def face() -> Face:
    return "lab"


@pytest.fixture(params=["de_DE", "fr_FR", "C"])
def locale(request: pytest.FixtureRequest) -> Iterator[str]:
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    yield request.param
    QLocale.setDefault(before)


@pytest.fixture
def patched(qtbot: QtBot, controller: Controller) -> Controller:
    controller.patches.choose("classical_guitar")
    qtbot.waitUntil(lambda: controller.session.choices.string is not None)
    return controller


def typed_on(qtbot: QtBot, knob: Knob, text: str) -> None:
    knob._type(text)
    assert knob._editor is not None
    qtbot.keyClick(knob._editor, Qt.Key.Key_Return)


def test_every_knob(qtbot: QtBot, locale: str, patched: Controller) -> None:
    knobs = [knob for knob in patched.window.findChildren(Knob) if knob.isEnabled() and not knob.isHidden()]
    assert len(knobs) > 30
    for knob in knobs:
        asked: list[float] = []
        figures: list[float] = []
        knob.value_asked.connect(asked.append)
        knob.figure_asked.connect(figures.append)
        shown = knob._figure or knob.text
        for text in (shown, shown.replace(".", ","), shown.replace("-", "\u2212"), shown + " and"):
            typed_on(qtbot, knob, text)
        if knob._figure:
            assert figures == [typed_number(shown, knob.parameter.figure_unit or "")] * 3 and asked == []
        else:
            assert [knob.parameter.shown(value) for value in asked] == [shown] * 3 and figures == []


def test_every_field_of_the_export_dialog(qtbot: QtBot, locale: str) -> None:
    dialog = ExportDialog(ExportChoices(), SampledChoices())
    qtbot.addWidget(dialog)
    boxes = dialog.findChildren(QAbstractSpinBox)
    assert len(boxes) > 6
    for box in boxes:
        assert isinstance(box, NumberBox | CountBox)
        for value in (box.minimum(), box.maximum(), (box.minimum() + box.maximum()) // 2):
            box.setValue(value)
            value, shown = box.value(), box.text()
            for text in (shown, shown.replace(".", ","), shown.replace(" ", "\u00a0"), shown + "?", ""):
                box.lineEdit().setText(text)
                box.interpretText()
                assert (box.value(), box.text()) == (value, shown), (box.accessibleName(), text)
