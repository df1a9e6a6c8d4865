"""The window as a whole, both directions: gestures change the session, the session changes the view."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QToolButton
from pytestqt.qtbot import QtBot

from app.instrument.events import NoteOn as MidiNote
from app.playing.notes import Note
from app.session.choices import Choices
from app.shared.vocabulary import Face
from app.views.stage import MARGIN_X
from app.window.controller import FRAME_MS, IDLE_MS, Controller
from app.window.main_window import MainWindow
from app.window.settings import Settings, load_settings
from engine.values.ear import Ear

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def face() -> Face:
    return "lab"


def view(controller: Controller, key: str) -> Any:
    """The view of a panel."""
    return next(getattr(panel, "view", panel) for panel in controller.panels if panel.key == key)


def notes(controller: Controller) -> list[Note]:
    """Those that are heard and have not been asked to end, the oldest first."""
    return [note for note in controller.performance.notes._notes if not note.over and not note.released]


def gains(controller: Controller) -> dict[str, float]:
    """With which the voices of the latest note sound, or fade to; without those of matched levels."""
    (*_, note) = notes(controller)
    match = note.match or {}
    return {
        name: float(voice.record["wanted_gain"]) / (match.get(name, 1.0) or 1.0)
        for name, voice in note.voices.items()
    }


def wait_for_take(qtbot: QtBot, controller: Controller) -> None:
    """Until what is chosen is rendered; the words alone may be of the pluck before."""
    label = controller.window.error_label
    qtbot.waitUntil(lambda: controller.performance.ready and "Error of this pluck" in label.text())


def test_a_drag_on_the_string_plucks_there(qtbot: QtBot, controller: Controller) -> None:
    string = view(controller, "string")
    wait_for_take(qtbot, controller)
    x = round(MARGIN_X + 0.6 * (string.width() - 2 * MARGIN_X))
    qtbot.mousePress(string, LEFT, pos=QPoint(x, string.height() // 2))
    qtbot.mouseMove(string, QPoint(x, string.height() // 4))
    assert string._drag == "pluck"
    assert not controller.performance.playing
    qtbot.mouseRelease(string, LEFT, pos=QPoint(x, string.height() // 4))
    assert controller.session.choices.position == pytest.approx(0.6, abs=0.01)
    assert 1 < controller.session.choices.amplitude_mm < 5
    qtbot.waitUntil(lambda: controller.performance.playing)
    qtbot.waitUntil(lambda: controller.performance.position_s > 0.05)


def test_the_listening_point_is_dragged_by_its_marker(qtbot: QtBot, controller: Controller) -> None:
    string = view(controller, "string")
    width = string.width() - 2 * MARGIN_X
    start = QPoint(round(MARGIN_X + controller.session.choices.listen * width), string.height() - 30)
    qtbot.mousePress(string, LEFT, pos=start)
    qtbot.mouseMove(string, QPoint(round(MARGIN_X + 0.8 * width), string.height() - 30))
    qtbot.mouseRelease(string, LEFT, pos=QPoint(round(MARGIN_X + 0.8 * width), string.height() - 30))
    assert controller.session.choices.listen == pytest.approx(0.8, abs=0.01)
    assert controller.window.transport.knobs["listen"].value == controller.session.choices.listen


def test_the_handle_sets_width_and_shape_and_resets(qtbot: QtBot, controller: Controller) -> None:
    string, session = view(controller, "string"), controller.session
    string.width_stepped.emit(1.0)
    assert session.choices.width == pytest.approx(0.063)
    string.shape_stepped.emit(1)
    assert session.choices.shape == "triangular"
    string.width_stepped.emit(1.0)  # a triangle has none
    assert session.choices.width == pytest.approx(0.063)
    session.update(position=0.6, amplitude_mm=7)
    string.pluck_reset.emit()
    assert (session.choices.position, session.choices.amplitude_mm, session.choices.width) == (0.35, 4.0, 0.06)
    session.update(listen=0.9)
    string.listening_point_reset.emit("left")
    assert session.choices.listen == Choices().listen
    assert string._listening == {"left": Choices().listen}


def test_the_motion_can_be_switched_off(qtbot: QtBot, controller: Controller) -> None:
    string = view(controller, "string")
    wait_for_take(qtbot, controller)
    controller.performance.seek(0.1)
    qtbot.waitUntil(lambda: string._frame is not None and bool(string._frame.envelopes))
    qtbot.mouseClick(string._toggles[1], LEFT)
    assert not controller.session.choices.envelope
    qtbot.waitUntil(lambda: not string._frame.envelopes)
    controller.session.update(motion=False)
    assert not string._toggles[0].isChecked()
    qtbot.waitUntil(lambda: string._frame is None)


def test_gestures_are_undone_one_by_one(qtbot: QtBot, controller: Controller) -> None:
    window, session, string = controller.window, controller.session, view(controller, "string")
    start = session.choices
    assert not controller.history.undo_words
    at = string._handle(string._axes()).toPoint()
    qtbot.mousePress(string, LEFT, pos=at)
    for moved in range(5):
        qtbot.mouseMove(string, at + QPoint(10 * moved, 5 * moved))
    qtbot.mouseRelease(string, LEFT, pos=at + QPoint(40, 20))
    plucked = session.choices
    assert plucked.position > start.position
    knob = window.transport.knobs["width"]
    qtbot.mousePress(knob, LEFT, pos=QPoint(30, 40))
    for moved in range(3):
        qtbot.mouseMove(knob, QPoint(30, 35 - 5 * moved))
    qtbot.mouseRelease(knob, LEFT, pos=QPoint(30, 25))
    assert session.choices.width > plucked.width
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert session.choices == plucked
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert session.choices == start
    assert knob.value == start.width
    redo = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    qtbot.keyClick(window, Qt.Key.Key_Z, redo)
    assert session.choices == plucked
    assert string._pluck.position == plucked.position


def test_keys(qtbot: QtBot, controller: Controller) -> None:
    window, session, string = controller.window, controller.session, view(controller, "string")
    wait_for_take(qtbot, controller)
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: controller.performance.playing)
    qtbot.keyClick(window, Qt.Key.Key_B)
    assert session.choices.source_heard == "truth"
    qtbot.waitUntil(lambda: gains(controller) == {"model": 0.0, "truth": 1.0})
    qtbot.keyClick(window, Qt.Key.Key_L, Qt.KeyboardModifier.ControlModifier)
    assert session.choices.loop
    qtbot.keyClick(window, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: not controller.performance.playing)
    qtbot.keyClick(string, Qt.Key.Key_Right)
    assert session.choices.position == pytest.approx(0.36)
    qtbot.keyClick(string, Qt.Key.Key_Up)
    assert session.choices.amplitude_mm == 4.5
    qtbot.keyClick(string, Qt.Key.Key_Left, Qt.KeyboardModifier.ShiftModifier)
    assert session.choices.listen == pytest.approx(0.36)


def test_the_keyboard_is_an_instrument(qtbot: QtBot, controller: Controller) -> None:
    window, session = controller.window, controller.session
    wait_for_take(qtbot, controller)
    plucks: list[float] = []
    controller.instruments.played.connect(lambda: plucks.append(session.choices.position))
    for number, key in enumerate((Qt.Key.Key_A, Qt.Key.Key_Semicolon, Qt.Key.Key_A, Qt.Key.Key_A, Qt.Key.Key_L), 1):
        qtbot.keyClick(window, key)
        assert len(notes(controller)) == number, "it is struck before the window knows of it"
        qtbot.waitUntil(lambda number=number: len(plucks) == number)
    assert plucks == pytest.approx([0.3, 0.7, 0.3, 0.3, 0.6556])
    assert not controller.history.undo_words
    qtbot.waitUntil(lambda: controller.performance.playing)
    qtbot.keyClick(window, Qt.Key.Key_9)
    assert session.choices.amplitude_mm == pytest.approx(10)
    qtbot.keyClick(window, Qt.Key.Key_C)
    assert 7 < session.choices.amplitude_mm < 8
    qtbot.wait(20)
    assert len(plucks) == 5
    knob = window.transport.knobs["seconds"]
    qtbot.keyClicks(knob, "2")
    assert knob._editor is not None
    qtbot.keyClicks(knob._editor, ".5s")  # the unit of the knob, and no pluck
    assert (knob._editor.text(), len(plucks)) == ("2.5s", 5)
    qtbot.keyClick(knob._editor, Qt.Key.Key_A)  # no number has it
    assert knob._editor is None and len(notes(controller)) == 6
    assert session.choices.seconds != 2.5
    assert 7 < session.choices.amplitude_mm < 8


def test_midi_plays_and_what_it_learned_is_saved(qtbot: QtBot, controller: Controller, tmp_path: Path) -> None:
    wait_for_take(qtbot, controller)
    midi = controller.instruments.midi
    midi._receive(MidiNote(96, 127))  # as in the input's thread
    (note,) = notes(controller)
    assert (note.request.pluck.position, note.request.pluck.amplitude_mm) == pytest.approx((0.7, 10))
    assert controller.session.choices.position == Choices().position, "the window has had no time yet"
    qtbot.waitUntil(lambda: controller.session.choices.position == pytest.approx(0.7))
    assert controller.session.choices.amplitude_mm == pytest.approx(10)
    assert not controller.history.undo_words
    qtbot.waitUntil(lambda: controller.performance.position_s > 0)
    midi.performed.emit({"width": 0.1})
    assert controller.session.choices.width == 0.1
    qtbot.keyClick(controller.window, Qt.Key.Key_M, Qt.KeyboardModifier.ControlModifier)
    assert midi._dialog is not None
    assert midi._dialog.isVisible()
    midi._remember(midi.choices.learned("width", 74))
    controller.window.close()
    assert load_settings(tmp_path / "settings.json")[0].midi.controllers == {"width": 74}


def test_presets_are_stepped_and_chosen(qtbot: QtBot, controller: Controller) -> None:
    assert controller.session.choices.preset == "first"
    qtbot.keyClick(controller.window, Qt.Key.Key_PageDown)
    assert controller.session.choices.preset == "second"
    assert controller.entry is not None
    assert controller.entry.name == "second"
    qtbot.keyClick(controller.window, Qt.Key.Key_PageUp)
    assert controller.session.choices.preset == "first"


def test_a_knob_asks_and_shows(qtbot: QtBot, controller: Controller) -> None:
    knob = controller.window.transport.knobs["amplitude_mm"]
    knob.setFocus()
    qtbot.keyClick(knob, Qt.Key.Key_Up)
    assert controller.session.choices.amplitude_mm == 4.25
    qtbot.keyClicks(knob, "7")
    editor = knob.findChild(type(knob._editor)) if knob._editor else None
    assert editor is not None
    qtbot.keyClicks(editor, ".5")
    qtbot.keyClick(editor, Qt.Key.Key_Return)
    assert controller.session.choices.amplitude_mm == 7.5
    controller.session.update(amplitude_mm=2.0)
    assert knob.value == 2.0
    qtbot.mouseDClick(knob, LEFT)
    assert controller.session.choices.amplitude_mm == 4.0


def test_a_key_waits_for_one_picture_at_a_time(
    qtbot: QtBot, controller: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The string's and a deck's are no part of one event: between two events keys are heard."""
    wait_for_take(qtbot, controller)
    controller._timer.stop()
    qtbot.wait(50)
    shown: list[str] = []
    for panel in controller.panels:
        monkeypatch.setattr(panel, "show_moment", lambda moment, panel=panel: shown.append(panel.key))
    decks = []
    for _ in range(4):
        controller._tick()
        assert shown == ["string"]
        qtbot.waitUntil(lambda: len(shown) > 1)
        decks.append(shown[1:])
        shown.clear()
    assert sorted(decks[:2]) == [["spectrum"], ["waveform"]]
    assert decks[:2] == decks[2:]  # by turns


def test_both_sources_are_drawn(qtbot: QtBot, controller: Controller) -> None:
    wait_for_take(qtbot, controller)
    controller.performance.seek(0.1)
    qtbot.waitUntil(lambda: view(controller, "string")._frame is not None)
    frame = view(controller, "string")._frame
    assert frame is not None
    assert set(frame.shapes) == {"model", "truth"}
    for plot in (view(controller, "spectrum"), view(controller, "waveform")):
        for curve in plot._curves.values():
            qtbot.waitUntil(lambda curve=curve: curve.getData()[0] is not None)
            assert np.isfinite(curve.getData()[1]).all()
            assert np.ptp(curve.getData()[1]) > 0


def test_a_pluck_is_struck_before_its_motion_is_rendered(qtbot: QtBot, controller: Controller) -> None:
    """The picture follows when it is there."""
    wait_for_take(qtbot, controller)
    controller.session.update(position=0.61)
    controller.pluck()
    performance, (note,) = controller.performance, notes(controller)
    assert not performance.ready
    assert note.request.pluck.position == 0.61
    qtbot.waitUntil(lambda: any(voice.sounding for voice in note.voices.values()))
    qtbot.waitUntil(lambda: performance.ready)
    assert performance.take is not None
    seconds = performance.take.seconds  # where the picture ends; the note may be past it before it is rendered
    qtbot.waitUntil(lambda: performance.position_s == pytest.approx(min(note.seconds, seconds), abs=0.05))
    assert performance.position_s > 0


def test_a_pluck_outside_training_or_silent_is_explained(controller: Controller) -> None:
    controller.session.update(position=0.1)
    assert "outside the trained" in view(controller, "string")._warning
    controller.session.update(position=0.5, amplitude_mm=0)
    assert "silent" in view(controller, "string")._warning
    controller.session.update(amplitude_mm=5, listen=1.0)
    assert "fixed end" in view(controller, "string")._warning
    controller.session.update(listen=0.3)
    assert view(controller, "string")._warning == ""


def test_no_device_is_reported_once_and_the_picture_moves(qtbot: QtBot, controller: Controller) -> None:
    qtbot.waitUntil(lambda: "without sound" in controller.window.notices.text)
    assert len(controller.window.notices.notices) == 1
    wait_for_take(qtbot, controller)
    controller.pluck()
    qtbot.waitUntil(lambda: controller.performance.position_s > 0.1)


def test_a_broken_preset_is_reported_and_the_app_goes_on(
    qtbot: QtBot, controller: Controller, preset_folder: Path
) -> None:
    wait_for_take(qtbot, controller)
    (preset_folder / "damaged").write_bytes(b"damaged")
    (preset_folder / "damaged").replace(preset_folder / "second.safetensors")  # not in place, while it may be read
    controller.session.update(preset="second")
    qtbot.waitUntil(lambda: "second.safetensors" in controller.window.notices.text)
    controller.session.update(preset="first", position=0.45)
    wait_for_take(qtbot, controller)


def test_choices_are_restored(qtbot: QtBot, controller: Controller, tmp_path: Path) -> None:
    controller.session.update(position=0.61, heard="b", a="preset:second", volume_db=-12)
    controller.window.resize(1190, 610)
    geometry = controller.window.geometry_text()
    controller.window.close()
    settings, notice = load_settings(tmp_path / "settings.json")
    assert notice == ""
    assert settings.choices == controller.session.choices
    assert settings.window_geometry == geometry
    window = MainWindow()
    qtbot.addWidget(window)
    window.restore_geometry(geometry)
    assert window.height() == 610  # the width of the screen without a screen is too small


def test_settings_that_cannot_be_saved_do_not_hinder_closing(
    qtbot: QtBot, preset_folder: Path, tmp_path: Path
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    window = MainWindow()
    qtbot.addWidget(window)
    made = Controller(window, Settings(choices=Choices(seconds=0.5)), blocked / "settings.json")
    window.close()
    assert "cannot be written" in made.window.notices.notices[-1].message


def test_every_control_has_a_name(controller: Controller) -> None:
    from PySide6.QtWidgets import QAbstractButton, QComboBox

    window = controller.window
    for control in [*window.findChildren(QAbstractButton), *window.findChildren(QComboBox)]:
        if control.focusPolicy() != Qt.FocusPolicy.NoFocus and control.isVisible():
            assert control.accessibleName() or control.text(), control


def test_decks_and_session_agree_on_the_views(controller: Controller) -> None:
    left, session = controller.window.left, controller.session
    assert left.currentWidget() is view(controller, session.choices.left_view)
    left.chosen.emit("spectrum")
    assert session.choices.left_view == "spectrum"
    session.update(left_view="none such")  # of another version: what is in front stays
    assert left.currentWidget() is view(controller, "spectrum")


def test_plucks_ring_beside_each_other_and_a_knob_strikes_none(qtbot: QtBot, controller: Controller) -> None:
    controller.session.update(seconds=3.0)
    wait_for_take(qtbot, controller)
    controller.pluck()
    controller.pluck()  # the same again
    assert len(notes(controller)) == 2
    controller.session.update(position=0.5)
    controller.pluck()  # another one
    assert [note.request.pluck.position for note in notes(controller)] == [0.35, 0.35, 0.5]
    struck = notes(controller)
    controller.session.update(position=0.6)  # a knob that is turned
    qtbot.waitUntil(lambda: controller.performance.ready)
    assert notes(controller) == struck
    assert controller.performance.position_s == 0, "what is shown is not struck"
    controller.play_or_stop()
    assert not controller.performance.playing
    qtbot.waitUntil(lambda: all(note.over for note in struck))


def test_another_preset_leaves_what_rings(qtbot: QtBot, controller: Controller) -> None:
    controller.session.update(seconds=3.0)
    wait_for_take(qtbot, controller)
    controller.pluck()
    (note,) = notes(controller)
    qtbot.waitUntil(lambda: note.seconds > 0.05)
    controller.session.update(preset="second")
    qtbot.waitUntil(lambda: controller.performance.ready)
    assert notes(controller) == [note]
    assert note.request.preset.stem == "first"
    assert not controller.performance.moving
    before_s = note.seconds
    qtbot.waitUntil(lambda: note.seconds > before_s + 0.05)
    controller.pluck()
    assert [each.request.preset.stem for each in notes(controller)] == ["first", "second"]


def test_plucks_that_are_overtaken_sound_all_the_same(qtbot: QtBot, controller: Controller) -> None:
    controller.session.update(seconds=3.0)
    wait_for_take(qtbot, controller)
    for position in (0.45, 0.55):  # before the first is rendered
        controller.session.update(position=position)
        controller.pluck()
    struck = notes(controller)
    assert [note.request.pluck.position for note in struck] == [0.45, 0.55]
    qtbot.waitUntil(lambda: all(note.seconds > 0 for note in struck))


def test_only_what_concerns_the_sound_is_reported_to_the_notes(
    qtbot: QtBot, controller: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait_for_take(qtbot, controller)
    reported: list[object] = []
    notes = controller.performance.notes
    monkeypatch.setattr(notes, "set_monitor", lambda monitor, compared: reported.append((monitor, compared)))
    monkeypatch.setattr(notes, "listen", reported.append)
    controller.session.update(left_view="waveform", speed=0.1, position=0.4)
    assert reported == []
    controller.session.update(heard="b")
    heard = controller.session.choices
    controller.session.update(listen=0.2)
    ear = controller.session.choices.ear
    assert reported == [(heard, True), ear]
    controller.session.update(face="play")
    assert reported[2:] == [(controller.session.choices, False)]


def test_while_nothing_moves_pictures_are_looked_at_less_often(qtbot: QtBot, controller: Controller) -> None:
    wait_for_take(qtbot, controller)
    qtbot.waitUntil(lambda: controller._timer.interval() == IDLE_MS)
    controller.session.update(listen=0.3)
    assert controller._timer.interval() == FRAME_MS


def test_while_the_string_is_drawn_the_last_pluck_rings_on(qtbot: QtBot, controller: Controller) -> None:
    controller.session.update(seconds=3.0)
    wait_for_take(qtbot, controller)
    controller.pluck()
    take, string, (note,) = controller.performance.take, view(controller, "string"), notes(controller)
    at = QPoint(string.width() // 2, string.height() // 4)
    qtbot.mousePress(string, LEFT, pos=at)
    qtbot.waitUntil(lambda: controller.performance.take is not take)
    assert notes(controller) == [note]
    qtbot.mouseRelease(string, LEFT, pos=at)
    first, second = notes(controller)
    assert first is note
    qtbot.waitUntil(lambda: controller.performance._shown.note is second)


def test_slots_are_chosen_heard_and_reported(qtbot: QtBot, controller: Controller) -> None:
    slots, session = controller.window.transport.slots, controller.session
    wait_for_take(qtbot, controller)
    slots.change_asked.emit("b", "preset:second")
    controller.pluck()
    (note,) = notes(controller)
    qtbot.waitUntil(lambda: note.seconds > 0)
    assert set(note.voices) == {"model", "preset:second"}
    assert gains(controller) == {"model": 1.0, "preset:second": 0.0}
    qtbot.mouseClick(slots._buttons["b"], LEFT)
    assert session.choices.source_heard == "preset:second"
    assert gains(controller) == {"model": 0.0, "preset:second": 1.0}
    assert slots._buttons["b"].objectName() == "other"
    qtbot.keyClick(controller.window, Qt.Key.Key_B)
    assert gains(controller) == {"model": 1.0, "preset:second": 0.0}
    session.update(a="difference", difference_gain_db=30, level_match=False)
    controller.pluck()
    qtbot.waitUntil(lambda: notes(controller)[-1].seconds > 0)
    loud = pytest.approx(10 ** (30 / 20))
    assert gains(controller)["model"] == loud
    assert -gains(controller)["truth"] == loud
    qtbot.waitUntil(lambda: "+30 dB" in slots._buttons["a"].text())


def test_what_a_slot_holds_is_drawn_and_named(qtbot: QtBot, controller: Controller) -> None:
    """From the slot's menu to every view of the sound, and from the session too."""
    slots, session = controller.window.transport.slots, controller.session
    views = [view(controller, "string"), view(controller, "waveform"), view(controller, "spectrum")]
    menu = next(
        button.menu() for button in slots.findChildren(QToolButton) if button.accessibleName() == "Source of B"
    )
    slots._fill(menu, "b")
    next(action for action in menu.actions() if action.text().startswith("Difference")).trigger()
    assert session.choices.b == "difference"
    assert set(views[1]._curves) == set(views[2]._curves) == {"model", "difference"}
    assert [source.title for source in views[0]._sources] == ["model", "difference"]
    wait_for_take(qtbot, controller)
    session.update(a="preset:second", heard="a")
    title = controller.library.find("second").info.title
    qtbot.waitUntil(lambda: controller.performance.take.motions.keys() > {"model", "truth"})
    qtbot.waitUntil(lambda: views[1]._curves["preset:second"].getData()[0] is not None)
    assert views[1].legend.text == f"A  {title} · heard   B  difference +20 dB"
    controller.play_or_stop()
    controller.performance.seek(0.2)
    qtbot.waitUntil(
        lambda: views[0]._frame is not None and set(views[0]._frame.shapes) == {"preset:second", "difference"}
    )


def test_a_slot_whose_preset_is_gone_falls_back(qtbot: QtBot, preset_folder: Path, tmp_path: Path) -> None:
    window = MainWindow()
    qtbot.addWidget(window)
    made = Controller(window, Settings(choices=Choices(seconds=0.5, b="preset:gone")), tmp_path / "settings.json")
    assert made.session.choices.b == "truth"
    assert any("gone" in each.message for each in window.notices.notices)
    window.close()


def test_solo_is_shown_and_left_with_escape(qtbot: QtBot, controller: Controller) -> None:
    window, session = controller.window, controller.session
    parts = (window.presets.card, view(controller, "string"), window.left, window.error_label)
    wait_for_take(qtbot, controller)
    qtbot.waitUntil(lambda: "without sound" in window.notices.text)  # it takes a line
    before = [(part.y(), part.height()) for part in parts]
    session.update(solo=3)
    assert window._solo.isVisible()
    assert "Mode 3" in window._solo.text()
    qtbot.wait(20)
    assert [(part.y(), part.height()) for part in parts] == before  # nothing has moved
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert session.choices.solo == 0
    assert not window._solo.isVisible()


def test_stereo_and_pickup_ask_and_show(qtbot: QtBot, controller: Controller) -> None:
    transport, session = controller.window.transport, controller.session
    assert not transport.knobs["listen_right"].isEnabled()
    places = [knob.pos() for knob in transport.knobs.values()]
    transport._stereo.click()
    transport._pickup.activated.emit(transport._pickup.findData("velocity"))
    assert session.choices.stereo
    assert session.choices.pickup == "velocity"
    assert transport.knobs["listen_right"].isEnabled()
    qtbot.wait(20)
    assert [knob.pos() for knob in transport.knobs.values()] == places
    wait_for_take(qtbot, controller)
    ears = []
    for choices in ({}, {"stereo": False, "pickup": "displacement"}):
        session.update(**choices)
        controller.pluck()
        ears.append(notes(controller)[-1].request.ear)
    left, right = session.choices.listen, session.choices.listen_right
    assert ears == [Ear((left, right), "velocity"), Ear((left,))]
    assert not transport._stereo.isChecked()
    assert transport._pickup.currentData() == "displacement"
