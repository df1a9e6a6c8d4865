"""The Lab: gestures and keys change the session, the session picture and sound; notes sound in their own time."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint
from PySide6.QtWidgets import QAbstractButton, QComboBox, QLineEdit, QToolButton

from app.audio.devices import AudioDevice
from app.audio.sound import Sound
from app.instruments.library import find_instrument
from app.player.events import PluckAt
from app.playing.note import PluckVoices
from app.session.choices import Choices
from app.views.stage import MARGIN_X
from app.views.string.view import StringView
from app.window.main_window import MainWindow
from app.window.performance import growth_words
from app.window.settings import load_settings
from engine.kernels.constants import QUANTUM
from engine.models.koopman_var import KoopmanVar
from engine.pluck import Pluck
from engine.presets import SHIPPED
from engine.values.ear import Ear
from tests.app.window.conftest import SPEAKERS, Open
from tests.app.window.driver import CONTROL, KEY, LEFT, SHIFT, Window, choose, find
from tests.app.window.panels.conftest import curves

KNOWN = ("gaussian_4k_koopman", "gaussian_4k_koopman_var", "noise_4k_koopman")
RATE_HZ = 48_000
TURN_S = 1.0  # of a loop; it is handed over by so much early, so that a busy computer does not come too late


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the picture of the string was given last, by the method that it was given to."""
    found: dict[str, Any] = {}

    def watch(name: str) -> None:
        method = getattr(StringView, name)

        def watched(view: StringView, *given: Any) -> None:
            found[name] = given[0]
            method(view, *given)

        monkeypatch.setattr(StringView, name, watched)

    for name in ("show_frame", "set_warning", "set_sources"):
        watch(name)
    return found


def place(view: StringView, x: float, y: float) -> QPoint:
    """The pixel of a place along the string, and of a share of the height from above."""
    return QPoint(round(MARGIN_X + x * (view.width() - 2 * MARGIN_X)), round(y * view.height()))


def gains(note: PluckVoices) -> dict[str, float]:
    """With which the voices of a note sound, or fade to; without those of matched levels."""
    match = note.match or {}
    wanted = {name: float(voice.record["wanted_gain"]) for name, voice in note.voices.items()}
    return {name: gain / (match.get(name, 1.0) or 1.0) for name, gain in wanted.items()}


def test_gestures_on_the_string_and_knobs_pluck_listen_and_are_undone_one_by_one(
    lab: Window, shown: dict[str, Any]
) -> None:
    view, session, knobs = lab.controller.string.view, lab.session, lab.window.transport.knobs
    lab.wait_for_take()
    start = lab.choices
    lab.drag(view, place(view, 0.6, 0.5), place(view, 0.6, 0.3), place(view, 0.6, 0.25))
    plucked = lab.choices
    assert plucked.position == pytest.approx(0.6, abs=0.01) and 1 < plucked.amplitude_mm < 5
    lab.wait(lambda: lab.performance.position_s > 0.05)
    knob = knobs["width"]
    lab.drag(knob, QPoint(30, 40), QPoint(30, 35), QPoint(30, 30), QPoint(30, 25))
    assert lab.choices.width > plucked.width
    foot = 1 - 30 / view.height()
    lab.drag(view, place(view, lab.choices.listen, foot), place(view, 0.7, foot), place(view, 0.8, foot))
    assert lab.choices.listen == pytest.approx(0.8, abs=0.01) == knobs["listen"].value
    undone = [lab.key(KEY.Key_Z, CONTROL) or lab.choices for _ in range(3)]
    assert undone[1:] == [plucked, start] and undone[0].listen == start.listen
    assert knob.value == start.width
    lab.key(KEY.Key_Z, CONTROL | SHIFT)
    assert lab.choices == plucked
    assert view.accessibleDescription().startswith(f"position {plucked.position:.2f}, ")
    width = lab.choices.width
    view.width_stepped.emit(1.0)
    assert lab.choices.width == pytest.approx(1.05 * width)
    view.shape_stepped.emit(1)
    view.width_stepped.emit(1.0)  # a triangle has none
    assert (lab.choices.shape, lab.choices.width) == ("triangular", pytest.approx(1.05 * width))
    view.pluck_reset.emit()
    view.listening_point_reset.emit("left")
    default = Choices()
    assert lab.choices.pluck == Pluck(default.position, default.amplitude_mm, "triangular", default.width)
    assert lab.choices.listen == default.listen
    for choices, words in (
        ({"shape": "gaussian", "position": 0.1}, "outside the trained"),
        ({"position": 0.5, "amplitude_mm": 0}, "silent"),
        ({"amplitude_mm": 5, "listen": 1.0}, "fixed end"),
        ({"listen": 0.3}, ""),
    ):
        session.update(**choices)
        assert words in shown["set_warning"] and bool(words) == bool(shown["set_warning"])


def test_what_is_drawn_while_a_string_rings_is_struck_beside_it(lab: Window) -> None:
    view = lab.controller.string.view
    lab.change(seconds=3.0)
    lab.wait_for_take()
    note, take = lab.pluck(), lab.performance.take
    at = place(view, 0.5, 0.25)
    lab.qtbot.mousePress(view, LEFT, pos=at)
    lab.wait(lambda: lab.performance.take is not take)
    assert lab.rings == [note]
    lab.qtbot.mouseRelease(view, LEFT, pos=at)
    assert lab.rings[0] is note and len(lab.rings) == 2
    lab.change(position=0.5)
    lab.pluck()
    lab.change(position=0.55)  # before that one is rendered
    last = lab.pluck()
    assert [each.request.pluck.position for each in lab.rings][2:] == [0.5, 0.55]
    lab.wait(lambda: all(each.seconds > 0 for each in lab.struck))
    lab.change(preset="second", position=0.6)  # knobs strike none
    lab.wait(lambda: lab.performance.ready)
    assert len(lab.rings) == 4 and not lab.performance.moving and lab.performance.position_s == 0
    assert last.request.preset.stem == "first" and lab.pluck().request.preset.stem == "second"
    lab.controller.play_or_stop()
    assert not lab.performance.playing
    lab.wait(lambda: all(each.over for each in lab.struck))


def test_keys_pluck_stop_switch_loop_and_step_and_the_computer_is_an_instrument(lab: Window) -> None:
    view = lab.controller.string.view
    lab.wait_for_take()
    lab.key(KEY.Key_Space)
    lab.wait(lambda: lab.performance.playing)
    lab.key(KEY.Key_B)
    assert lab.choices.source_heard == "truth"
    lab.wait(lambda: gains(lab.struck[-1]) == {"model": 0.0, "truth": 1.0})
    lab.key(KEY.Key_L, CONTROL)
    assert lab.choices.loop
    lab.key(KEY.Key_L, CONTROL)
    lab.key(KEY.Key_Space)
    lab.wait(lambda: not lab.performance.playing)
    for key, held, field, value in (
        (KEY.Key_Right, None, "position", 0.36),
        (KEY.Key_Up, None, "amplitude_mm", 4.5),
        (KEY.Key_Left, SHIFT, "listen", 0.36),
    ):
        lab.key(key, *([held] if held else []), on=view)
        assert getattr(lab.choices, field) == pytest.approx(value)
    for key, preset in ((KEY.Key_PageDown, "second"), (KEY.Key_PageUp, "first")):
        lab.key(key)
        assert lab.choices.preset == lab.performance.entry.name == preset  # type: ignore[union-attr]
    lab.wait_for_take()
    plucks, words = list[float](), lab.session.undo_words
    lab.session.changed.connect(lambda names: names & {"note"} and plucks.append(lab.choices.position))
    for count, key in enumerate((KEY.Key_A, KEY.Key_Semicolon, KEY.Key_A, KEY.Key_A, KEY.Key_L), 1):
        before = len(lab.struck)
        lab.key(key)
        assert len(lab.struck) == before + 1, "it is struck before the window knows of it"
        lab.wait(lambda count=count: len(plucks) == count)
    assert plucks == pytest.approx([0.3, 0.7, 0.3, 0.3, 0.6556])
    assert lab.session.undo_words == words
    lab.key(KEY.Key_9)
    assert lab.choices.amplitude_mm == pytest.approx(10)
    lab.key(KEY.Key_C)
    assert 7 < lab.choices.amplitude_mm < 8 and len(plucks) == 5
    knob = lab.window.transport.knobs["seconds"]
    lab.qtbot.keyClicks(knob, "2")
    editor = find(knob, QLineEdit, "duration, typed")
    lab.qtbot.keyClicks(editor, ".5s")  # the unit of the knob, and no pluck
    assert (editor.text(), len(plucks)) == ("2.5s", 5)
    lab.key(KEY.Key_A, on=editor)  # no number has it
    lab.wait(lambda: len(plucks) == 6 and not knob.findChildren(QLineEdit))
    assert lab.choices.seconds != 2.5


def test_knobs_ask_and_show_and_stereo_and_pick_up_are_of_the_next_note(lab: Window) -> None:
    knobs = lab.window.transport.knobs
    knob = knobs["amplitude_mm"]
    lab.key(KEY.Key_Up, on=knob)
    assert lab.choices.amplitude_mm == 4.25
    lab.qtbot.keyClicks(knob, "7")
    editor = find(knob, QLineEdit)
    lab.qtbot.keyClicks(editor, ".5")
    lab.key(KEY.Key_Return, on=editor)
    assert lab.choices.amplitude_mm == 7.5
    lab.change(amplitude_mm=2.0)
    assert knob.value == 2.0
    lab.qtbot.mouseDClick(knob, LEFT)
    assert lab.choices.amplitude_mm == 4.0
    assert not knobs["listen_right"].isEnabled()
    places = [each.pos() for each in knobs.values()]
    stereo, pickup = lab.find(QToolButton, "Stereo"), lab.find(QComboBox, "Pick-up")
    stereo.click()
    choose(pickup, "velocity")
    assert lab.choices.stereo and lab.choices.pickup == "velocity" and knobs["listen_right"].isEnabled()
    lab.wait_for_take()
    assert [each.pos() for each in knobs.values()] == places
    both = lab.choices.listen, lab.choices.listen_right
    assert lab.pluck().request.ear == Ear(both, "velocity")
    lab.change(stereo=False, pickup="displacement")
    assert lab.pluck().request.ear == Ear(both[:1])
    assert not stereo.isChecked() and pickup.currentData() == "displacement"


def test_one_key_hears_the_difference_and_again_what_was_heard_before(lab: Window) -> None:
    lab.wait_for_take()
    note, waveform = lab.pluck(), lab.panel("waveform")
    lab.wait(lambda: note.seconds > 0)
    slots = {slot: lab.find(QAbstractButton, f"Hear {slot.upper()}") for slot in ("a", "b")}
    for slot, other, back, heard in (
        ("a", "b", (KEY.Key_B, SHIFT), "model"),
        ("a", "b", (KEY.Key_B,), "truth"),
        ("b", "a", (KEY.Key_B, SHIFT), "truth"),
        ("b", "a", None, "truth"),
    ):
        lab.key(KEY.Key_B, SHIFT)
        assert gains(note) == pytest.approx({"model": 10.0, "truth": -10.0})
        assert slots[slot].isChecked() and "DIFF." in slots[slot].text() and "DIFF." not in slots[other].text()
        assert "difference +20 dB · heard" in waveform.legend.text
        if back is None:
            lab.qtbot.mouseClick(slots[slot], LEFT)
        else:
            lab.key(*back)
        lab.wait(lambda heard=heard: [source for source, gain in gains(note).items() if gain] == [heard])
        assert f"{heard} · heard" in waveform.legend.text and "difference" not in waveform.legend.text
    lab.change(face="play")  # where keys have no voice of the truth, and the model alone would be amplified
    lab.key(KEY.Key_B, SHIFT)
    assert lab.choices.source_heard == "truth" and not lab.choices.difference


def test_slots_are_chosen_heard_drawn_and_named(lab: Window, shown: dict[str, Any]) -> None:
    slots, views = lab.window.transport.slots, (lab.panel("waveform"), lab.panel("spectrum"))
    lab.wait_for_take()
    for panel in views:
        lab.wait(
            lambda plot=panel.plot: all(np.ptp(curve[1]) > 0 for curve in curves(plot).values() if len(curve[0]))
        )
        assert curves(panel.plot).keys() == {"model", "truth"}
    slots.change_asked.emit("b", "preset:second")
    note = lab.pluck()
    lab.wait(lambda: note.seconds > 0)
    heard = lab.find(QAbstractButton, "Hear B")
    assert gains(note) == {"model": 1.0, "preset:second": 0.0}
    lab.qtbot.mouseClick(heard, LEFT)
    assert lab.choices.source_heard == "preset:second" and heard.objectName() == "other"
    assert gains(note) == {"model": 0.0, "preset:second": 1.0}
    lab.key(KEY.Key_B)
    assert gains(note) == {"model": 1.0, "preset:second": 0.0}
    lab.change(a="difference", b="truth", difference_gain_db=30, level_match=False)
    loud = lab.pluck()
    lab.wait(lambda: loud.seconds > 0)
    assert gains(loud)["model"] == pytest.approx(10 ** (30 / 20)) == -gains(loud)["truth"]
    lab.wait(lambda: "+30 dB" in lab.find(QAbstractButton, "Hear A").text())
    menu = lab.find(QToolButton, "Source of B").menu()
    menu.aboutToShow.emit()
    next(action for action in menu.actions() if action.text().startswith("Difference")).trigger()
    assert lab.choices.b == "difference"
    lab.change(a="preset:second", heard="a", difference_gain_db=20)
    for panel in views:
        assert curves(panel.plot).keys() == {"other", "difference"}
    title = lab.controller.library.find("second").title  # type: ignore[union-attr]
    assert [source.title for source in shown["set_sources"]] == [title, "difference"]
    assert views[0].legend.text == f"A  {title} · heard   B  difference +20 dB"
    lab.wait(lambda: len(curves(views[0].plot)["other"][0]) > 0)
    lab.controller.play_or_stop()
    lab.performance.seek(0.2)
    lab.wait(lambda: shown["show_frame"] and set(shown["show_frame"].shapes) == {"preset:second", "difference"})
    lab.wait(lambda: shown["show_frame"].envelopes)
    lab.press("Envelope")
    lab.wait(lambda: shown["show_frame"] and not shown["show_frame"].envelopes)
    lab.press("Motion")
    assert not lab.choices.motion
    lab.wait(lambda: shown["show_frame"] is None)


def test_a_window_without_device_or_with_faults_says_so_and_continues(
    lab: Window, opened: Open, preset_folder: Path, tmp_path: Path
) -> None:
    """And remembers what was chosen, where it can be written."""
    window = lab.window
    lab.wait(lambda: "without sound" in window.notices.text)
    assert len(window.notices.notices) == 1
    lab.wait_for_take()
    parts = (window.presets.card, lab.controller.string, window.left, window.error_label)
    before = [(part.y(), part.height()) for part in parts]
    lab.change(solo=3)
    solo = lab.find(QAbstractButton, "Play all modes")
    assert solo.isVisible() and "Mode 3" in solo.text()
    lab.wait_for_take()
    assert [(part.y(), part.height()) for part in parts] == before, "nothing has moved"
    lab.key(KEY.Key_Escape)
    assert lab.choices.solo == 0 and not solo.isVisible()
    lab.pluck()
    lab.wait(lambda: lab.performance.position_s > 0.1)
    lab.change(left_view="none such")  # of another version: what is in front stays
    assert window.left.currentWidget().isVisible()
    (preset_folder / "damaged").write_bytes(b"damaged")
    (preset_folder / "damaged").replace(preset_folder / "second.safetensors")  # not in place, while it may be read
    lab.change(preset="second")
    lab.wait(lambda: "second.safetensors" in window.notices.text)
    lab.change(preset="first", position=0.61, heard="b", volume_db=-12)
    lab.wait_for_take()
    window.resize(1190, 610)
    lab.close()
    settings, notice = load_settings(tmp_path / "settings.json")
    assert (settings.choices, settings.window_geometry, notice) == (lab.choices, window.geometry_text(), "")
    again = MainWindow()
    lab.qtbot.addWidget(again)
    again.restore_geometry(settings.window_geometry)
    assert again.height() == 610  # the width of the screen without a screen is too small
    (tmp_path / "settings.json").unlink()
    (tmp_path / "settings.json").mkdir()
    other = opened(b="preset:gone")
    assert other.choices.b == "truth" and any("gone" in each for each in other.said)
    other.close()
    assert "cannot be written" in other.said[-1]


@pytest.fixture
def sounding(
    opened: Open,
    small_preset: Path,
    preset_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    speakers: Callable[..., Sound],
) -> Window:
    """With a device, a preset that sounds at once and one that is rendered first."""
    shutil.copy(
        SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors", preset_folder / "bank.safetensors"
    )
    monkeypatch.setattr("app.playing.notes.LOOP_AHEAD_S", TURN_S)
    made = opened(sound=speakers, preset="bank", seconds=TURN_S)
    made.wait_for_take()
    made.wait(lambda: made.controller.sound.status().device == SPEAKERS)
    return made


def begun(w: Window) -> PluckVoices:
    """A pluck that sounds, with the playhead."""
    note = w.pluck()
    w.wait(lambda: note.seconds > 0 and w.performance.moving)
    assert isinstance(note, PluckVoices)
    return note


def turn_after(w: Window, note: object) -> Any:
    """The next turn of the loop, once it sounds."""
    w.wait(lambda: w.notes.latest is not note)
    return w.notes.latest


def test_the_playhead_is_that_of_the_note_that_was_struck_last_and_stays_where_it_is_stopped(
    sounding: Window,
) -> None:
    performance, mixer = sounding.performance, sounding.controller.sound.mixer
    assert not performance.playing and performance.position_s == 0
    performance.seek(0.25)  # nothing rings
    assert performance.position_s == 0.25 and sounding.rings == []
    note = begun(sounding)
    for _ in range(5):
        late_s = mixer.output_latency_s  # the picture is of the sound by now
        before_s, shown_s, after_s = note.seconds, performance.position_s, note.seconds
        assert min(max(before_s - late_s, 0.0), TURN_S) <= shown_s <= max(after_s - late_s, 0.0)
    sounding.wait(lambda: note.seconds == pytest.approx(mixer.seconds - note.began_frame / RATE_HZ, abs=0.05))
    performance.seek(0.5)
    assert note.released and performance.position_s >= 0.5, "at once"
    last: Any = sounding.notes.latest
    sounding.wait(lambda: performance.position_s > 0.5)
    sounding.wait(lambda: performance.position_s == pytest.approx(min(last.seconds, TURN_S), abs=0.05))
    sounding.wait(lambda: not performance.moving)
    assert performance.position_s == TURN_S and performance.playing, "the picture ends there; the string rings on"
    performance.stop()
    performance.seek(0.75)
    sounding.wait(lambda: last.over)
    for changes in ({"volume_db": -6.0}, {"listen": 0.2}, {"heard": "b"}):
        sounding.change(**changes)
        assert performance.position_s == 0.75 and not performance.moving
    first = begun(sounding)
    sounding.wait(lambda: performance.moving and performance.position_s < 0.75)
    sounding.change(position=0.6)
    second = begun(sounding)
    sounding.wait(lambda: performance.ready and performance.moving)
    assert performance.take is not None and performance.take.pluck.position == 0.6
    assert sounding.rings == [first, second]


@pytest.mark.parametrize("preset", ["bank", "first"])
def test_a_loop_begins_each_turn_at_its_frame_with_the_pluck_that_is_chosen(sounding: Window, preset: str) -> None:
    """Also where its note has fallen silent, after a seek and after a pluck; switched off, it rings out."""
    sounding.change(preset=preset, loop=True)
    sounding.wait(lambda: sounding.performance.ready)
    note: Any = begun(sounding)
    for silent in (False, True):
        for voice in note.voices.values() if silent else ():
            voice.release(0.01)
        turn = turn_after(sounding, note)
        assert turn.began_frame - note.began_frame == pytest.approx(round(TURN_S * RATE_HZ), abs=QUANTUM * silent)
        note = turn
    sounding.change(position=0.44)
    before = turn_after(sounding, note)  # it was handed over with the former pluck
    note = turn_after(sounding, before)
    assert note.request.pluck.position == 0.44 and len(sounding.rings) <= 3
    struck = begun(sounding)
    turn = turn_after(sounding, struck)
    assert turn.began_frame - struck.began_frame == pytest.approx(TURN_S * RATE_HZ, abs=QUANTUM)
    sounding.change(loop=False)
    sounding.wait(lambda: turn.seconds > TURN_S + 0.05)
    assert sounding.notes.latest is turn and not turn.over


def test_a_seek_in_a_loop_shortens_its_turn(sounding: Window) -> None:
    sounding.change(seconds=2.0, loop=True)
    sounding.wait(lambda: sounding.performance.ready)
    begun(sounding)
    sounding.performance.seek(1.25)
    note: Any = sounding.notes.latest
    turn = turn_after(sounding, note)
    assert turn.began_frame - note.began_frame == pytest.approx(0.75 * RATE_HZ, abs=QUANTUM)


def test_another_listening_point_and_speed_are_of_the_same_take(sounding: Window, shown: dict[str, Any]) -> None:
    """Nothing that is seen of it is rendered again; signals and slow motion follow."""
    take = sounding.performance.take
    assert take is not None
    sounding.change(face="lab")
    pictures = take.motion_m("truth").copy()
    for choices in ({"listen": 0.8}, {"pickup": "velocity", "stereo": True}, {"solo": 2}):
        sounding.change(**choices)
        sounding.wait(lambda: take.listened.ear == sounding.choices.ear and take.listened.complete)
    sounding.performance.seek(0.3)
    shapes_m = []
    for speed in (0.1, 0.37):
        sounding.change(speed=speed)
        sounding.wait(lambda speed=speed: take.motions["model"].flashes.strobe.speed == speed)
        shapes_m.append(take.motions["model"].shape_m(0.3))

        def drawn(shape_m: Any = shapes_m[-1]) -> bool:
            frame = shown.get("show_frame")
            return frame is not None and abs(frame.shapes["model"] / 1000 - shape_m).max() < 1e-9

        sounding.wait(drawn)
    assert abs(shapes_m[0] - shapes_m[1]).max() > 1e-5
    sounding.change(face="play")  # where the string is at rest unless it moves
    sounding.wait(lambda: shown["show_frame"] is None)
    assert sounding.performance.take is take and (take.motion_m("truth") == pictures).all()


def test_a_note_is_in_the_mixer_before_the_window_knows_and_rings_on_at_another_rate(
    sounding: Window, devices: list[AudioDevice]
) -> None:
    """The window's thread is busy here until it waits."""
    w = sounding
    w.change(seconds=10.0)  # the playhead does not come to its end before the device is there
    w.wait(lambda: w.performance.ready and w.controller.sound.mixer.voices == [])
    before, mixer = w.choices, w.controller.sound.mixer
    for count, position in enumerate((0.4, 0.6), 1):
        player = threading.Thread(target=w.controller.inputs.play, args=(PluckAt(Pluck(position, 5.0)),))
        player.start()
        player.join()
        assert len(w.rings) == count
        assert len({voice.program for voice in mixer.voices}) == 2, "model and truth"
    until_s = time.monotonic() + 60
    while not all(note.seconds > 0 for note in w.rings) and time.monotonic() < until_s:
        time.sleep(0.01)
    assert all(note.seconds > 0 for note in w.rings), "it sounds"
    assert w.choices == before and [note.request.pluck.position for note in w.rings] == [0.4, 0.6]
    w.wait(lambda: (w.choices.position, w.choices.amplitude_mm) == (0.6, 5.0))
    w.wait(lambda: w.performance.moving and bool(w.notes.latencies_s))
    devices.append(AudioDevice("Other", "Test API", 44_100))
    w.controller.sound.open(devices[-1].choice)
    w.wait(lambda: w.controller.sound.mixer is not mixer and w.struck[-1].mixer is w.controller.sound.mixer)
    here_s = w.performance.position_s
    assert here_s > 0
    w.wait(lambda: w.performance.position_s > here_s)
    w.performance.stop()
    assert not w.performance.playing


def test_how_long_a_model_is_waited_for_is_shown_and_space_stops_it(
    sounding: Window, monkeypatch: pytest.MonkeyPatch
) -> None:
    advance = KoopmanVar.advance

    def slow(model: KoopmanVar, state: Any, steps: int, readout: Any = None) -> Any:
        time.sleep(steps / 2_000)
        return advance(model, state, steps, readout)

    monkeypatch.setattr(KoopmanVar, "advance", slow)
    words = sounding.window.error_label
    sounding.change(preset="first", seconds=0.8)
    sounding.wait_for_take()
    sounding.wait(lambda: sounding.performance.settled)
    sounding.change(position=0.21)  # or its motion would be at hand
    note = sounding.pluck()
    sounding.wait(lambda: words.text().startswith("Koopman, variable: buffering, starts in 0."))
    sounding.wait(lambda: not note.pending and "Error of this pluck" in words.text())
    sounding.change(seconds=10.0)
    sounding.wait(lambda: sounding.performance.ready)
    sounding.performance.stop()
    sounding.key(KEY.Key_Space)
    assert sounding.performance.playing
    sounding.key(KEY.Key_Space)
    assert not sounding.performance.playing and sounding.struck[-1].over
    sounding.wait(lambda: "buffering" not in words.text())


@pytest.mark.parametrize(
    ("errors", "own", "words"),
    [
        ([0.001, 0.004], 0.001, ""),  # grown, but too small to be noticed
        ([0.02, 0.05], 0.028, ""),  # as large as ever
        ([0.03, 1.16], 0.028, "116 % past the end of its training"),
        ([0.2, 0.05], 0.01, "20 % on this pluck"),
        ([0.2], None, "20 % on this pluck"),
        ([float("nan")], 0.01, ""),
        ([], None, ""),
    ],
)
def test_an_error_that_grew_is_put_into_words(errors: list[float], own: float | None, words: str) -> None:
    assert words in growth_words(errors, own)
    assert bool(growth_words(errors, own)) == bool(words)


def test_a_preset_is_plucked_as_trained_and_a_pluck_by_hand_stays_while_models_are_compared(opened: Open) -> None:
    known, same, noise = (f"nylon_nonlinear_{name}" for name in KNOWN)
    lab = opened(
        known, same, noise, "studio_any_string", instrument=find_instrument("Classical guitar").instrument, face="lab"
    )
    before, middle = lab.choices.pluck, Pluck(0.5, 5.5, "gaussian", 0.06)
    button = lab.find(QToolButton, "Pluck as trained")
    assert not button.isEnabled() and "trained on many strings" in button.toolTip()
    lab.change(preset=known)
    assert lab.choices.pluck == middle and button.isEnabled()
    lab.key(KEY.Key_Z, CONTROL)
    assert (lab.choices.plays_instrument, lab.choices.pluck) == (True, before), "preset and pluck are one step"
    lab.change(preset=known)
    lab.wait(lambda: lab.performance.ready)
    lab.change(position=0.1, amplitude_mm=9.0, shape="triangular")
    by_hand = lab.choices.pluck
    lab.change(preset=same)
    assert lab.choices.pluck == by_hand
    lab.key(KEY.Key_P, CONTROL | SHIFT)
    assert (lab.choices.pluck, lab.struck[-1].request.pluck) == (middle, middle)
    lab.key(KEY.Key_Z, CONTROL)
    assert lab.choices.pluck == by_hand
    button.click()
    assert lab.choices.pluck == middle
    lab.change(preset=noise)
    assert not button.isEnabled() and "random shapes" in button.toolTip() and lab.choices.pluck == middle
    count = len(lab.struck)
    lab.key(KEY.Key_P, CONTROL | SHIFT)
    assert len(lab.struck) == count
