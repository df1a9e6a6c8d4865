"""Every knob and number field of the window reads what it shows, in any locale."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QEvent, QLocale, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QDialog, QLineEdit, QWidget
from pytestqt.qtbot import QtBot

from app.shared.typed_number import SIGNS, typed_number
from app.views.controls.knob import Knob
from app.views.controls.notice_bar import NoticeList
from app.views.controls.number_box import CountBox, NumberBox
from app.views.dialogs.abx_dialog import AbxDialog
from app.views.dialogs.audio_dialog import AudioDialog
from app.views.dialogs.export_dialog import ExportDialog
from app.views.dialogs.help_dialog import HelpDialog
from app.views.dialogs.learn_dialog import LearnDialog
from app.views.dialogs.midi_dialog import MidiDialog
from app.window.controller import Controller
from tests.app.window.driver import Window


@pytest.fixture(params=["de_DE", "fr_FR", "C"])
def locale(request: pytest.FixtureRequest) -> Iterator[str]:
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    yield request.param
    QLocale.setDefault(before)


def type_in(widget: QWidget, text: str) -> None:
    """By keys, of any keyboard."""
    for character in text:
        for kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
            QApplication.sendEvent(widget, QKeyEvent(kind, 0, Qt.KeyboardModifier.NoModifier, character))


def typed_on(qtbot: QtBot, knob: Knob, text: str) -> None:
    """Typing begins with a digit or a sign: what stands before it is typed once the field is there."""
    type_in(knob, text[0] if text[0] in SIGNS else "0")
    editor = next(each for each in knob.findChildren(QLineEdit) if not each.isHidden())
    editor.selectAll()
    editor.setText(text)  # by keys its letters would play
    qtbot.keyClick(editor, Qt.Key.Key_Return)
    editor.hide()


def test_every_knob(qtbot: QtBot, locale: str, lab: Window) -> None:
    lab.controller.instruments.choose("classical_guitar")
    lab.wait(lambda: lab.choices.string is not None)
    knobs = [knob for knob in lab.window.findChildren(Knob) if knob.isEnabled() and not knob.isHidden()]
    assert len(knobs) > 30
    for knob in knobs:
        asked: list[float] = []
        figures: list[float] = []
        knob.value_asked.connect(asked.append)
        knob.figure_asked.connect(figures.append)
        figure = knob.accessibleDescription().removesuffix(f" ({knob.text})")
        shown = figure if figure != knob.text else knob.text
        for text in (shown, shown.replace(".", ","), shown.replace("-", "\u2212"), shown + " and"):
            typed_on(qtbot, knob, text)
        if figures:
            assert figures == [typed_number(shown, knob.parameter.figure_unit or "")] * 3 and asked == []
        else:
            assert [knob.parameter.shown(value) for value in asked] == [shown] * 3


OPENED: dict[type[QDialog], Callable[[Controller, Path], object]] = {
    ExportDialog: lambda controller, sound: controller.exports.open("note"),
    LearnDialog: lambda controller, sound: controller.take_file(sound),
    AbxDialog: lambda controller, sound: controller.listening_test(),
    AudioDialog: lambda controller, sound: controller.audio.show_dialog(),
    MidiDialog: lambda controller, sound: controller.inputs.midi.show_dialog(controller.window),
    HelpDialog: lambda controller, sound: controller.show_help(),
    NoticeList: lambda controller, sound: controller.window.notices.show_all(),
}
FIELDS = {ExportDialog: 9, LearnDialog: 2, AbxDialog: 1}  # of numbers


def kinds_of(kind: type[QDialog]) -> Iterator[type[QDialog]]:
    """The app's dialogs that are derived from this one, without those from which others are."""
    for each in kind.__subclasses__():
        if not each.__subclasses__() and each.__module__.startswith("app."):
            yield each
        yield from kinds_of(each)


def texts_of(box: NumberBox | CountBox) -> Iterator[tuple[str, bool]]:
    """What people type for the field's value, and whether they type over its prefix and unit too."""
    shown, number = box.text(), box.textFromValue(box.value())
    with_units = {number + box.suffix().replace(" ", space) for space in (" ", "", "\u00a0")}
    for text in {shown, number, *with_units}:
        for typed in {text, text.replace(".", ",")}:
            yield typed, True
    for typed in {number, number.replace(".", ",")}:
        yield typed, False


def test_every_field_of_every_dialog(locale: str, lab: Window, tmp_path: Path) -> None:
    controller = lab.controller
    assert set(kinds_of(QDialog)) == set(OPENED)
    soundfile.write(tmp_path / "sound.wav", np.zeros(24_000), 48_000)
    for kind, show in OPENED.items():
        show(controller, tmp_path / "sound.wav")
        dialog = controller.window.findChild(kind)
        assert dialog is not None, kind
        boxes = dialog.findChildren(QAbstractSpinBox)
        assert len(boxes) == FIELDS.get(kind, 0), kind
        for box in boxes:
            assert isinstance(box, NumberBox | CountBox)
            box.setEnabled(True)
            for value in (box.minimum(), box.maximum(), (box.minimum() + box.maximum()) // 2):
                box.setValue(value)
                value, shown = box.value(), box.text()
                other = box.maximum() if value == box.minimum() else box.minimum()
                for text, whole in (*texts_of(box), (f"{shown}?", True)):
                    box.setValue(value if text.endswith("?") else other)
                    (box.lineEdit() if whole else box).selectAll()
                    type_in(box, text)
                    box.interpretText()
                    assert (box.value(), box.text()) == (value, shown), (box.accessibleName(), text)
        dialog.done(0)
