"""The strip: one surface at a time, the string's knobs on demand, a hint until the first note."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton
from pytestqt.qtbot import QtBot

from app.views.instrument.panel import InstrumentPanel


@pytest.fixture
def panel(qtbot: QtBot) -> InstrumentPanel:
    made = InstrumentPanel()
    qtbot.addWidget(made)
    made.resize(1250, 300)
    made.show()
    return made


def test_either_surface_is_played_and_sees_what_sounds(qtbot: QtBot, panel: InstrumentPanel) -> None:
    panel.set_range(40, 86)
    for name, surface in (("keys", panel.keys), ("neck", panel.neck)):
        panel.show_surface(name)
        assert panel.surface == name
        assert surface.isVisible()
        with qtbot.waitSignals([panel.pressed, panel.released], order="strict"):
            qtbot.mouseClick(surface, Qt.MouseButton.LeftButton, pos=surface.key_rect(60).center().toPoint())
    panel.show_sounding({62: 0.5})
    assert panel.keys.level(62) == panel.neck.level(62) > 0


def test_the_hint_goes_with_the_first_note(qtbot: QtBot, panel: InstrumentPanel) -> None:
    assert panel._hint.isVisible()
    panel.show_sounding({})
    assert panel._hint.isVisible()
    panel.show_sounding({60: 0.2})
    assert not panel._hint.isVisible()


def test_the_hint_is_not_cut_when_the_theme_changes(qtbot: QtBot, panel: InstrumentPanel) -> None:
    before = panel._hint.size()
    panel.setStyleSheet("QLabel#hint { padding: 3px 30px; font-size: 20px; }")
    qtbot.waitUntil(lambda: panel._hint.size() == panel._hint.sizeHint() != before)


def test_a_note_of_the_other_surface_ends_when_it_is_hidden(qtbot: QtBot, panel: InstrumentPanel) -> None:
    qtbot.mouseClick(panel.keys, Qt.MouseButton.RightButton, pos=panel.keys.key_rect(60).center().toPoint())
    with qtbot.waitSignal(panel.released):
        panel.show_surface("neck")


def test_the_knobs_of_the_string_are_folded_at_first(qtbot: QtBot, panel: InstrumentPanel) -> None:
    assert not panel.knobs.isVisible()
    qtbot.mouseClick(panel._fold, Qt.MouseButton.LeftButton)
    assert panel.unfolded
    assert panel.knobs.isVisible()
    facts = panel.knobs.facts
    qtbot.waitUntil(lambda: facts.visibleRegion().boundingRect().height() == facts.height())  # and is not cut


def test_in_a_low_window_the_knobs_take_the_place_of_the_keys(qtbot: QtBot, panel: InstrumentPanel) -> None:
    def seen() -> tuple[bool, bool, bool]:
        return panel.bar.isVisible(), panel.knobs.isVisible(), panel.keys.isVisible()

    panel.resize(1500, 300)  # without scroll bars
    panel.set_low(True)
    assert seen() == (True, False, True)
    height = panel.sizeHint().height()
    assert panel._hint.isVisible()
    qtbot.mouseClick(panel._fold, Qt.MouseButton.LeftButton)
    assert seen() == (True, True, False)
    assert not panel._hint.isVisible()
    assert panel.sizeHint().height() <= height, "the strip takes no more room"
    panel.set_low(False)
    assert seen() == (True, True, True)
    assert panel.sizeHint().height() > height
    panel.set_low(True)
    for name in ("keys", "neck"):  # also the one that is checked already
        panel.set_unfolded(True)
        button = next(each for each in panel._choice.findChildren(QAbstractButton) if each.objectName() == name)
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
        assert (panel.unfolded, panel.knobs.isVisible(), panel._stack.isVisible()) == (False, False, True)
        assert panel.surface == name


def test_what_keys_play_is_chosen_from_words(qtbot: QtBot, panel: InstrumentPanel) -> None:
    for plays, words in (("place", "Keys set pluck position"), ("pitch", "Keys play notes")):
        with qtbot.waitSignal(panel.keys_play_asked) as reported:
            panel._plays[plays].trigger()
        assert reported.args == [plays]
        panel.show_keys_play(plays, possible=True)
        assert panel.plays.text().startswith(words)
        assert panel.bar.octave.isVisible() == panel.bar.velocity.isVisible() == (plays == "pitch")
    panel.show_keys_play("place", possible=False)
    assert not panel.plays.isEnabled()
    assert "Choose an instrument" in panel.plays.toolTip()


def test_what_keys_do_is_chosen(qtbot: QtBot, panel: InstrumentPanel) -> None:
    for name in ("legato", "slide", "pluck"):
        with qtbot.waitSignal(panel.touch_chosen, check_params_cb=lambda chosen, name=name: chosen == name):
            qtbot.mouseClick(panel.touch.findChild(QAbstractButton, name), Qt.MouseButton.LeftButton)
    for name, on in (("strum", True), ("tremolo", True), ("strum", False), ("harmonics", True)):
        with qtbot.waitSignal(panel.technique_switched) as switched:
            qtbot.mouseClick(panel.techniques.findChild(QAbstractButton, name), Qt.MouseButton.LeftButton)
        assert switched.args == [name, on]
    panel.set_drums(True)
    assert not panel.touch.isEnabled()
    assert not panel.techniques.isEnabled()


def test_fingers_are_lifted_by_a_button_that_is_there_only_then(qtbot: QtBot, panel: InstrumentPanel) -> None:
    panel.neck.set_strings((("A2", 45), ("D3", 50)))
    panel.set_range(45, 70)
    panel.show_surface("neck")
    button = next(each for each in panel.findChildren(QAbstractButton) if each.text() == "Lift fingers")
    assert button.isHidden()
    qtbot.mouseClick(panel.neck, Qt.MouseButton.RightButton, pos=panel.neck.cell(0, 3).center().toPoint())
    assert panel.neck.fingers == {0: 3} and not button.isHidden()
    panel.show_surface("keys")
    assert button.isHidden()
    panel.show_surface("neck")
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert panel.neck.fingers == {} and button.isHidden()
