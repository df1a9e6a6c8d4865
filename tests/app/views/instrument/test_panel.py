"""The strip: one surface at a time, the string's knobs on demand, a hint until the first note."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QAbstractButton, QLabel, QStackedWidget
from pytestqt.qtbot import QtBot

from app.views.instrument.panel import InstrumentPanel
from tests.app.gestures import LEFT, RIGHT, named, reported


@pytest.fixture
def panel(qtbot: QtBot) -> InstrumentPanel:
    made = InstrumentPanel()
    qtbot.addWidget(made)
    made.resize(1500, 300)
    made.set_range(40, 86)
    made.show()
    return made


def click(qtbot: QtBot, panel: InstrumentPanel, name: str) -> None:
    qtbot.mouseClick(named(panel, name, QAbstractButton), LEFT)


def hint_of(panel: InstrumentPanel) -> QLabel:
    return panel.findChild(QLabel, "hint")


def test_either_surface_is_played_and_sees_what_sounds(qtbot: QtBot, panel: InstrumentPanel) -> None:
    for name, words, surface in (("neck", "Surface: Strings", panel.neck), ("keys", "Surface: Keys", panel.keys)):
        click(qtbot, panel, words)
        assert panel.surface == name
        assert surface.isVisible()
        with qtbot.waitSignals([panel.pressed, panel.released], order="strict"):
            qtbot.mouseClick(surface, LEFT, pos=surface.key_rect(60).center().toPoint())
    panel.show_sounding({62: 0.5})
    assert panel.keys.level(62) == panel.neck.level(62) > 0
    qtbot.mouseClick(panel.keys, RIGHT, pos=panel.keys.key_rect(60).center().toPoint())
    with qtbot.waitSignal(panel.released):  # of the surface that is hidden
        panel.show_surface("neck")


def test_in_a_low_window_the_knobs_of_the_string_take_the_place_of_the_keys(
    qtbot: QtBot, panel: InstrumentPanel
) -> None:
    def seen() -> tuple[bool, bool, bool]:
        return panel.bar.isVisible(), panel.knobs.isVisible(), panel.keys.isVisible()

    assert seen() == (True, False, True), "they are folded at first"
    panel.set_low(True)
    height = panel.sizeHint().height()
    assert hint_of(panel).isVisible()
    click(qtbot, panel, "String knobs")
    assert panel.unfolded and seen() == (True, True, False)
    assert not hint_of(panel).isVisible()
    assert panel.sizeHint().height() <= height, "the strip takes no more room"
    panel.set_low(False)
    assert seen() == (True, True, True)
    assert panel.sizeHint().height() > height
    facts = panel.knobs.facts
    qtbot.waitUntil(lambda: facts.visibleRegion().boundingRect().height() == facts.height())  # and is not cut
    panel.set_low(True)
    for name, words in (("keys", "Surface: Keys"), ("neck", "Surface: Strings")):  # also the one checked already
        panel.set_unfolded(True)
        click(qtbot, panel, words)
        assert (panel.unfolded, panel.knobs.isVisible(), panel.surface) == (False, False, name)
        assert panel.findChild(QStackedWidget).isVisible()


def test_what_keys_do_is_chosen(qtbot: QtBot, panel: InstrumentPanel) -> None:
    chosen, switched = reported(panel.touch_chosen), reported(panel.technique_switched)
    for name in ("legato", "slide", "pluck"):
        qtbot.mouseClick(panel.touch.findChild(QAbstractButton, name), LEFT)
    assert chosen == ["legato", "slide", "pluck"]
    for name in ("strum", "tremolo", "strum", "harmonics"):
        qtbot.mouseClick(panel.techniques.findChild(QAbstractButton, name), LEFT)
    assert switched == [("strum", True), ("tremolo", True), ("strum", False), ("harmonics", True)]
    panel.set_drums(True)
    assert not panel.touch.isEnabled() and not panel.techniques.isEnabled()


def test_fingers_are_lifted_by_a_button_that_is_there_only_then(qtbot: QtBot, panel: InstrumentPanel) -> None:
    panel.neck.set_strings((("A2", 45), ("D3", 50)))
    panel.show_surface("neck")
    button = named(panel, "Lift fingers", QAbstractButton)
    assert button.isHidden()
    qtbot.mouseClick(panel.neck, RIGHT, pos=panel.neck.cell(0, 3).center().toPoint())
    assert panel.neck.fingers == {0: 3}
    for surface, hidden in (("neck", False), ("keys", True), ("neck", False)):
        panel.show_surface(surface)
        assert button.isHidden() == hidden
    qtbot.mouseClick(button, LEFT)
    assert panel.neck.fingers == {} and button.isHidden()
