"""The patch bar asks for what is clicked, and shows what a patch says as it is."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMenu
from pytestqt.qtbot import QtBot

from app.patches.patch import Macro, MacroTarget, Patch
from app.patches.scales import SCALES
from app.patches.tuning import TuningChoice
from app.views.instrument.patch_bar import PatchBar
from tests.app.gestures import LEFT, press_keys, reported


@pytest.fixture
def bar(qtbot: QtBot, guitar: Patch) -> PatchBar:
    made = PatchBar()
    qtbot.addWidget(made)
    made.resize(1250, 64)
    made.set_bodies([("guitar", "Guitar")])
    made.show_patch(guitar, own=True, changed=True)
    made.show_octave(3, 2, 6)
    made.show()
    return made


def test_macros_are_those_of_the_patch_and_say_what_they_change(bar: PatchBar, guitar: Patch) -> None:
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
        bar.show_patch(guitar.model_copy(update={"macros": macros}), own=True)
        assert sum(knob.isVisible() for knob in bar.macros) == count
    for fields, words in (
        (("pluck.position", "knobs.brightness_decay"), "Tone: changes pluck position, HF loss"),
        (("pickup.points.0",), "Tone: changes listening point"),  # of the same name, with other targets
    ):
        macro = Macro(name="Tone", targets=tuple(MacroTarget(field=field, low=0.2, high=0.4) for field in fields))
        bar.show_patch(guitar.model_copy(update={"macros": (macro,)}), own=True)
        assert bar.macros[0].toolTip().splitlines()[0] == words


def test_the_record_button_shows_its_time_and_saves_or_discards_what_is_not_saved(
    qtbot: QtBot, bar: PatchBar
) -> None:
    bar.show_recording(73.4)
    assert (bar.record.text(), bar.record.isChecked()) == ("■  1:13", True)
    bar.show_recording(None)
    bar.show_unsaved(1)
    assert bar.record.text().startswith("●  Unsaved")
    asked = [reported(bar.recording_save_asked), reported(bar.recording_discard_asked)]
    for action in bar.record.findChild(QMenu).actions():
        action.trigger()
    assert [len(each) for each in asked] == [1, 1]
    bar.show_recording(3.0)  # another was begun before the first turned out not to be written
    assert (bar.record.text(), bar.record.menu()) == ("■  0:03", None)
    bar.show_recording(None)
    bar.show_unsaved(0)
    assert (bar.record.text(), bar.record.isChecked()) == ("●  Record", False)
    with qtbot.waitSignal(bar.record_asked):
        qtbot.mouseClick(bar.record, LEFT)


def test_a_scale_is_chosen_shown_by_name_and_left_again(bar: PatchBar, guitar: Patch) -> None:
    scale = "! a.scl\n!\nTwo <b>halves</b>\n 2\n!\n 600.\n 2/1\n"
    keymap = "2\n0\n127\n60\n69\n440\n2\n0\n1\n"
    for tuning in ({"scale": scale}, {"keymap": keymap}, {"scale": scale, "keymap": keymap}):
        bar.show_patch(guitar.model_copy(update={"tuning": TuningChoice(**tuning)}), own=True)
        assert bar.scale.text() == ("Two <b>halves</b>  ▾" if "scale" in tuning else "Twelve equal steps  ▾")
        assert ("halves" in bar.scale.toolTip()) == ("scale" in tuning)
        assert ("keyboard mapping" in bar.scale.toolTip()) == ("keymap" in tuning)
        assert "<b>" not in bar.scale.toolTip()
    asked, actions = reported(bar.scale_asked), {each.text(): each for each in bar.scale.menu().actions()}
    actions["Vallotti"].trigger()
    bar.show_patch(guitar.model_copy(update={"tuning": TuningChoice(scale=SCALES["Vallotti"])}), own=True)
    assert bar.scale.text() == "Vallotti  ▾"
    assert [name for name, each in actions.items() if each.isChecked()] == ["Vallotti"]
    actions["Twelve equal steps"].trigger()
    assert asked == ["Vallotti", ""]
    bar.show_patch(guitar, own=True)
    assert bar.scale.text() == "Scale  ▾"
    assert [name for name, each in actions.items() if each.isChecked()] == ["Twelve equal steps"]
