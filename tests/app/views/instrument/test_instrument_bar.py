"""The instrument bar asks for what is clicked, and shows what an instrument says as it is."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QInputDialog, QMenu
from pytestqt.qtbot import QtBot

from app.instruments.instrument import Instrument, Macro, MacroTarget
from app.instruments.scales import SCALES
from app.instruments.tuning import TuningChoice
from app.player.events import Meter
from app.views.instrument.instrument_bar import InstrumentBar
from tests.app.gestures import LEFT, press_keys, reported


@pytest.fixture
def bar(qtbot: QtBot, guitar: Instrument) -> InstrumentBar:
    made = InstrumentBar()
    qtbot.addWidget(made)
    made.resize(1250, 64)
    made.set_bodies([("guitar", "Guitar")])
    made.show_instrument(guitar, own=True, changed=True)
    made.show_octave(3, 2, 6)
    made.show()
    return made


def test_macros_are_those_of_the_instrument_and_say_what_they_change(bar: InstrumentBar, guitar: Instrument) -> None:
    shown = [knob for knob in bar.macros if knob.isVisible()]
    assert [(knob.accessibleName(), knob.value) for knob in shown] == [
        (each.name, each.value) for each in guitar.macros
    ]
    turned = reported(bar.macro_turned)
    press_keys(shown[1], Qt.Key.Key_Home)
    assert turned == [(1, 0.0)]
    for count in (8, 0):
        macros = tuple(
            Macro(name=f"m{n}", targets=(MacroTarget(field="room.mix", low=0, high=1),)) for n in range(count)
        )
        bar.show_instrument(guitar.model_copy(update={"macros": macros}), own=True)
        assert sum(knob.isVisible() for knob in bar.macros) == count
    for fields, words in (
        (("pluck.position", "knobs.brightness_decay"), "Tone: changes pluck position, HF loss"),
        (("pickup.points.0",), "Tone: changes listening point"),  # of the same name, with other targets
    ):
        macro = Macro(name="Tone", targets=tuple(MacroTarget(field=field, low=0.2, high=0.4) for field in fields))
        bar.show_instrument(guitar.model_copy(update={"macros": (macro,)}), own=True)
        assert bar.macros[0].toolTip().splitlines()[0] == words


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
    for tuning in ({"scale": scale}, {"keymap": keymap}, {"scale": scale, "keymap": keymap}):
        bar.show_instrument(guitar.model_copy(update={"tuning": TuningChoice(**tuning)}), own=True)
        assert bar.scale.text() == ("Two <b>halves</b>  ▾" if "scale" in tuning else "Twelve equal steps  ▾")
        assert ("halves" in bar.scale.toolTip()) == ("scale" in tuning)
        assert ("keyboard mapping" in bar.scale.toolTip()) == ("keymap" in tuning)
        assert "<b>" not in bar.scale.toolTip()
    asked, actions = reported(bar.scale_asked), {each.text(): each for each in bar.scale.menu().actions()}
    actions["Vallotti"].trigger()
    bar.show_instrument(guitar.model_copy(update={"tuning": TuningChoice(scale=SCALES["Vallotti"])}), own=True)
    assert bar.scale.text() == "Vallotti  ▾"
    assert [name for name, each in actions.items() if each.isChecked()] == ["Vallotti"]
    actions["Twelve equal steps"].trigger()
    assert asked == ["Vallotti", ""]
    bar.show_instrument(guitar, own=True)
    assert bar.scale.text() == "Scale  ▾"
    assert [name for name, each in actions.items() if each.isChecked()] == ["Twelve equal steps"]
