"""The strip and its bar: surfaces, knobs on demand, macros, recording and scales."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton, QInputDialog, QLabel, QMenu, QStackedWidget
from pytestqt.qtbot import QtBot

from app.instruments.instrument import Instrument, Macro, MacroTarget
from app.instruments.scales import SCALES
from app.instruments.tuning import TuningChoice
from app.player.events import Meter
from app.views.instrument.instrument_bar import InstrumentBar
from app.views.instrument.panel import InstrumentPanel
from tests.app.gestures import LEFT, RIGHT, named, press_keys, reported


@pytest.fixture
def panel(show: Callable[..., InstrumentPanel]) -> InstrumentPanel:
    made = show(InstrumentPanel(), 1500, 300)
    made.set_range(40, 86)
    return made


@pytest.fixture
def bar(show: Callable[..., InstrumentBar], guitar: Instrument) -> InstrumentBar:
    made = show(InstrumentBar(), 1250, 64)
    made.set_bodies([("guitar", "Guitar")])
    made.show_instrument(guitar, own=True, changed=True)
    made.show_octave(3, 2, 6)
    return made


def click(qtbot: QtBot, panel: InstrumentPanel, name: str) -> None:
    qtbot.mouseClick(named(panel, name, QAbstractButton), LEFT)


def test_either_surface_is_played_and_sees_what_sounds(qtbot: QtBot, panel: InstrumentPanel) -> None:
    for name, words, surface in (("neck", "Surface: Strings", panel.neck), ("keys", "Surface: Keys", panel.keys)):
        click(qtbot, panel, words)
        assert panel.surface == name and surface.isVisible()
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

    hint, facts = panel.findChild(QLabel, "hint"), panel.knobs.facts
    assert seen() == (True, False, True), "they are folded at first"
    panel.set_low(True)
    height = panel.sizeHint().height()
    assert hint.isVisible()
    click(qtbot, panel, "String knobs")
    assert panel.unfolded and seen() == (True, True, False) and not hint.isVisible()
    assert panel.sizeHint().height() <= height, "the strip takes no more room"
    panel.set_low(False)
    assert seen() == (True, True, True)
    assert panel.sizeHint().height() > height
    qtbot.waitUntil(lambda: facts.visibleRegion().boundingRect().height() == facts.height())  # and is not cut
    panel.set_low(True)
    for name, words in (("keys", "Surface: Keys"), ("neck", "Surface: Strings")):  # also the one checked already
        panel.set_unfolded(True)
        click(qtbot, panel, words)
        assert (panel.unfolded, panel.knobs.isVisible(), panel.surface) == (False, False, name)
        assert panel.findChild(QStackedWidget).isVisible()


def test_the_touch_is_chosen_and_fingers_are_lifted_by_a_button_that_is_there_only_then(
    qtbot: QtBot, panel: InstrumentPanel
) -> None:
    chosen, switched = reported(panel.touch_chosen), reported(panel.technique_switched)
    for part, names in ((panel.touch, "legato slide pluck"), (panel.techniques, "strum tremolo strum harmonics")):
        for name in names.split():
            qtbot.mouseClick(part.findChild(QAbstractButton, name), LEFT)
    assert chosen == ["legato", "slide", "pluck"]
    assert switched == [("strum", True), ("tremolo", True), ("strum", False), ("harmonics", True)]
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
    panel.set_drums(True)
    assert not panel.touch.isEnabled() and not panel.techniques.isEnabled()


def test_macros_are_those_of_the_instrument_and_say_what_they_change(bar: InstrumentBar, guitar: Instrument) -> None:
    def shown(*macros: Macro) -> int:
        bar.show_instrument(guitar.model_copy(update={"macros": macros}), own=True)
        return sum(knob.isVisible() for knob in bar.macros)

    values = [(knob.accessibleName(), knob.value) for knob in bar.macros if knob.isVisible()]
    assert values == [(each.name, each.value) for each in guitar.macros]
    turned = reported(bar.macro_turned)
    press_keys(bar.macros[1], Qt.Key.Key_Home)
    assert turned == [(1, 0.0)]
    for fields, words in (
        (("pluck.position", "knobs.brightness_decay"), "Tone: changes pluck position, HF loss"),
        (("pickup.points.0",), "Tone: changes listening point"),  # of the same name, with other targets
    ):
        macro = Macro(name="Tone", targets=tuple(MacroTarget(field=field, low=0.2, high=0.4) for field in fields))
        assert shown(macro) == 1 and bar.macros[0].toolTip().splitlines()[0] == words
    assert (shown(*[macro] * 8), shown()) == (8, 0)


def test_the_record_button_shows_its_time_and_the_menu_beside_it_takes_and_settings(
    qtbot: QtBot, bar: InstrumentBar, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seconds, text in ((73.4, "■  1:13"), (3.0, "■  0:03"), (-0.2, "■  −1"), (-1.5, "■  −2"), (None, "●  Record")):
        bar.show_recording(seconds)
        assert (bar.record.text(), bar.record.isChecked()) == (text, seconds is not None)
    menu, played = bar.takes, list[str]()
    for _ in range(2):
        assert menu.actions()[0].text() == "No takes yet" and not menu.actions()[0].isEnabled()
        menu.show_takes([("a & b:  12:01, 3 s", {"Play": lambda: played.append("a & b")}), ("c", {"Play": list})])
        assert [each.text() for each in menu.actions()[:2]] == ["a && b:  12:01, 3 s", "c"]
        menu.actions()[0].menu().actions()[0].trigger()  # type: ignore[union-attr]
        menu.show_takes(())
    assert played == ["a & b", "a & b"]
    actions = {each.text(): each for part in (menu, *menu.findChildren(QMenu)) for each in part.actions()}
    typed = iter(["1e9", "90 or so", "90"])  # the first two are asked again
    monkeypatch.setattr(QInputDialog, "getText", lambda *_, text: (next(typed), bool(text)))
    for name in ("Metronome", "2 bars", "Tempo: 120 beats a minute …", "3"):
        actions[name].trigger()
    assert menu.meter == Meter(count_in_bars=2, metronome=True, tempo_bpm=90, beats=3) and not list(typed)
    assert {name for name, each in actions.items() if each.isChecked()} == {"Metronome", "2 bars", "3"}
    with qtbot.waitSignal(bar.record_asked):
        qtbot.mouseClick(bar.record, LEFT)


def test_a_scale_is_chosen_shown_by_name_and_left_again(bar: InstrumentBar, guitar: Instrument) -> None:
    scale = "! a.scl\n!\nTwo <b>halves</b>\n 2\n!\n 600.\n 2/1\n"
    keymap = "2\n0\n127\n60\n69\n440\n2\n0\n1\n"
    actions = {each.text(): each for each in bar.scale.menu().actions()}

    def shown(**tuning: str) -> tuple[str, list[str]]:
        bar.show_instrument(guitar.model_copy(update={"tuning": TuningChoice(**tuning)}), own=True)
        tip = bar.scale.toolTip()
        assert ("halves" in tip, "keyboard mapping" in tip) == (tuning.get("scale") == scale, "keymap" in tuning)
        assert "<b>" not in tip
        return bar.scale.text(), [name for name, each in actions.items() if each.isChecked()]

    assert shown(scale=scale)[0] == shown(scale=scale, keymap=keymap)[0] == "Two <b>halves</b>  ▾"
    assert shown(keymap=keymap)[0] == "Twelve equal steps  ▾"
    asked = reported(bar.scale_asked)
    actions["Vallotti"].trigger()
    assert shown(scale=SCALES["Vallotti"]) == ("Vallotti  ▾", ["Vallotti"])
    actions["Twelve equal steps"].trigger()
    assert asked == ["Vallotti", ""]
    assert shown() == ("Scale  ▾", ["Twelve equal steps"])
