"""The Lab: gestures and keys change the session, the session picture and sound; notes sound in their own time."""

import shutil
import time
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint
from PySide6.QtWidgets import QAbstractButton, QToolButton

from app.playing.note import PluckVoices
from app.views.stage import MARGIN_X
from app.views.string.view import StringView
from app.window.settings import load_settings
from engine.kernels.constants import QUANTUM
from engine.models.koopman_var import KoopmanVar
from engine.pluck import Pluck
from engine.presets import SHIPPED
from tests.app.window.conftest import SPEAKERS
from tests.app.window.driver import CONTROL, KEY, LEFT, PLAIN, SHIFT, Window
from tests.app.window.panels.conftest import curves

KNOWN = ("gaussian_4k_koopman", "gaussian_4k_koopman_var", "noise_4k_koopman")
RATE_HZ = 48_000
TURN_S = 1.0  # of a loop; it is handed over by so much early, so that a busy computer does not come too late


def place(view: StringView, x: float, y: float) -> QPoint:
    """The pixel of a place along the string, and of a share of the height from above."""
    return QPoint(round(MARGIN_X + x * (view.width() - 2 * MARGIN_X)), round(y * view.height()))


def gains(note: PluckVoices) -> dict[str, float]:
    """With which the voices of a note sound, or fade to; without those of matched levels."""
    match = note.match or {}
    wanted = {name: float(voice.record["wanted_gain"]) for name, voice in note.voices.items()}
    return {name: gain / (match.get(name, 1.0) or 1.0) for name, gain in wanted.items()}


def test_gestures_on_the_string_and_knobs_pluck_listen_and_are_undone_one_by_one(lab):
    view, knobs = lab.controller.string.view, lab.window.transport.knobs
    lab.change(seconds=3.0)
    lab.wait_for_take()
    start = lab.choices
    lab.drag(view, place(view, 0.6, 0.5), place(view, 0.6, 0.3), place(view, 0.6, 0.25))
    plucked = lab.choices
    assert plucked.pluck.position == pytest.approx(0.6, abs=0.01) and 1 < plucked.pluck.amplitude_mm < 5
    lab.wait(lambda: lab.performance.position_s > 0.05)
    knob, at, foot = knobs["width"], QPoint(30, 40), 1 - 30 / view.height()
    lab.drag(knob, at, at - QPoint(0, 5), at - QPoint(0, 10), at - QPoint(0, 15))
    assert lab.choices.pluck.width > plucked.pluck.width
    lab.drag(view, place(view, lab.choices.listen, foot), place(view, 0.7, foot), place(view, 0.8, foot))
    assert lab.choices.listen == pytest.approx(0.8, abs=0.01) == knobs["listen"].value
    undone = [lab.key(KEY.Key_Z, CONTROL) or lab.choices for _ in range(3)]
    assert undone[1:] == [plucked, start] and undone[0].listen == start.listen
    assert knob.value == start.pluck.width
    lab.key(KEY.Key_Z, CONTROL | SHIFT)
    assert lab.choices == plucked
    lab.drag(view, place(view, 0.4, 0.5), place(view, 0.4, 0.25))
    assert len(lab.rings) == 2 and lab.rings[0] is lab.struck[0], "it is struck beside what rings"
    count = len(lab.struck)
    lab.change(preset="second", position=0.6)  # knobs strike none
    lab.wait(lambda: lab.performance.ready)
    assert len(lab.struck) == count and not lab.performance.moving and lab.performance.position_s == 0
    assert lab.rings[1].request.preset.stem == "first" and lab.pluck().request.preset.stem == "second"
    lab.controller.play_or_stop()
    lab.wait(lambda: all(each.over for each in lab.struck))


def test_how_long_a_model_is_waited_for_is_shown_and_space_stops_it(lab, monkeypatch):
    advance = KoopmanVar.advance

    def slow(model: KoopmanVar, state: Any, steps: int, readout: Any = None) -> Any:
        time.sleep(steps / 2_000)
        return advance(model, state, steps, readout)

    monkeypatch.setattr(KoopmanVar, "advance", slow)
    words = lab.window.error_label
    lab.change(preset="first", seconds=6.0, position=0.21)
    lab.wait(lambda: lab.performance.ready)
    note = lab.pluck()
    lab.wait(lambda: words.text().startswith("Koopman, variable: buffering, starts in "))
    lab.key(KEY.Key_Space)
    assert note.over and not lab.performance.playing
    lab.wait(lambda: "buffering" not in words.text())


def test_keys_pluck_stop_switch_loop_and_step_and_the_computer_is_an_instrument(lab):
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
    for key, preset in ((KEY.Key_PageDown, "second"), (KEY.Key_PageUp, "first")):
        lab.key(key)
        assert lab.choices.preset == lab.performance.entry.name == preset  # type: ignore[union-attr]
    lab.wait_for_take()
    plucks, words = list[float](), lab.session.undo_words
    lab.session.changed.connect(lambda names: names & {"note"} and plucks.append(lab.choices.pluck.position))
    for count, key in enumerate((KEY.Key_A, KEY.Key_Semicolon, KEY.Key_A, KEY.Key_L), 1):
        before = len(lab.struck)
        lab.key(key)
        assert len(lab.struck) == before + 1, "it is struck before the window knows of it"
        lab.wait(lambda count=count: len(plucks) == count)
    assert plucks == pytest.approx([0.3, 0.7, 0.3, 0.6556])
    assert lab.session.undo_words == words
    lab.change(solo=3)
    lab.key(KEY.Key_Escape)
    assert lab.choices.solo == 0


def test_slots_are_chosen_heard_drawn_and_named(lab):
    slots, views = lab.window.transport.slots, (lab.panel("waveform"), lab.panel("spectrum"))
    lab.wait_for_take()
    for panel in views:
        lab.wait(lambda plot=panel.plot: all(np.ptp(each[1]) > 0 for each in curves(plot).values() if len(each[0])))
        assert curves(panel.plot).keys() == {"model", "truth"}
    slots.change_asked.emit("b", "preset:second")
    note, heard = lab.pluck(), lab.find(QAbstractButton, "Hear B")
    lab.wait(lambda: note.seconds > 0)
    assert gains(note) == {"model": 1.0, "preset:second": 0.0}
    lab.qtbot.mouseClick(heard, LEFT)
    assert lab.choices.source_heard == "preset:second" and heard.objectName() == "other"
    assert gains(note) == {"model": 0.0, "preset:second": 1.0}
    lab.change(heard="a", b="truth", level_match=False)
    loud, button = lab.pluck(), lab.find(QAbstractButton, "Hear A")
    lab.wait(lambda: loud.seconds > 0)
    for held, heard_then in ((SHIFT, "model"), (PLAIN, "truth")):  # one key hears the difference, and again what was
        lab.key(KEY.Key_B, SHIFT)
        assert gains(loud)["model"] == pytest.approx(10.0) == -gains(loud)["truth"]
        assert button.isChecked() and "DIFF." in button.text() and "DIFF." not in heard.text()
        lab.wait(lambda: "+20 dB" in button.text() and "difference +20 dB · heard" in views[0].legend.text)
        lab.key(KEY.Key_B, held)
        assert [source for source, gain in gains(loud).items() if gain] == [heard_then]
        assert f"{heard_then} · heard" in views[0].legend.text and "difference" not in views[0].legend.text
    menu = lab.find(QToolButton, "Source of B").menu()
    menu.aboutToShow.emit()
    next(action for action in menu.actions() if action.text().startswith("Difference")).trigger()
    lab.change(a="preset:second", heard="a", difference_gain_db=30)
    for panel in views:
        assert curves(panel.plot).keys() == {"other", "difference"}
    title = lab.controller.library.find("second").title  # type: ignore[union-attr]
    assert views[0].legend.text == f"A  {title} · heard   B  difference +30 dB"
    lab.wait(lambda: len(curves(views[0].plot)["other"][0]) > 0)
    lab.controller.play_or_stop()


def test_a_window_with_faults_says_so(lab, opened, preset_folder, tmp_path):
    """And remembers what was chosen, where it can be written."""
    window = lab.window
    lab.wait(lambda: "without sound" in window.notices.text)
    assert len(window.notices.notices) == 1
    lab.wait_for_take()
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
    (tmp_path / "settings.json").unlink()
    (tmp_path / "settings.json").mkdir()
    other = opened(b="preset:gone")
    other.window.restore_geometry(settings.window_geometry)
    assert other.window.height() == 610  # the width of the screen without a screen is too small
    assert other.choices.b == "truth" and any("gone" in each for each in other.said)
    other.close()
    assert "cannot be written" in other.said[-1]


@pytest.fixture
def sounding(opened, small_preset, preset_folder, monkeypatch, speakers) -> Window:
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


def test_the_playhead_is_that_of_the_note_that_was_struck_last(sounding):
    performance, mixer = sounding.performance, sounding.controller.sound.mixer
    performance.seek(0.25)  # nothing rings
    assert performance.position_s == 0.25 and sounding.rings == []
    note = begun(sounding)
    for _ in range(5):
        late_s = mixer.output_latency_s  # the picture is of the sound by now
        before_s, shown_s, after_s = note.seconds, performance.position_s, note.seconds
        assert min(max(before_s - late_s, 0.0), TURN_S) <= shown_s <= max(after_s - late_s, 0.0)
    performance.seek(0.5)
    assert note.released and performance.position_s >= 0.5, "at once"
    last: Any = sounding.notes.latest
    sounding.wait(lambda: performance.position_s > 0.5 and not performance.moving)
    assert performance.position_s == TURN_S and performance.playing, "the picture ends there; the string rings on"
    performance.stop()
    performance.seek(0.75)
    sounding.wait(lambda: last.over)
    for changes in ({"volume_db": -6.0}, {"listen": 0.2}, {"heard": "b"}):
        sounding.change(**changes)
        assert performance.position_s == 0.75 and not performance.moving


@pytest.mark.parametrize("preset", ["bank", "first"])
def test_a_loop_begins_each_turn_at_its_frame_with_the_pluck_that_is_chosen(sounding, preset):
    """Also where its note has fallen silent, after a seek and after a pluck; switched off, it rings out."""
    sounding.change(preset=preset, loop=True)
    sounding.wait(lambda: sounding.performance.ready)
    note: Any = begun(sounding)
    for voice in note.voices.values():
        voice.release(0.01)
    turn = turn_after(sounding, note)
    assert turn.began_frame - note.began_frame == pytest.approx(round(TURN_S * RATE_HZ), abs=QUANTUM)
    sounding.change(position=0.44)
    before = turn_after(sounding, turn)  # it was handed over with the former pluck
    assert before.began_frame - turn.began_frame == round(TURN_S * RATE_HZ)
    note = turn_after(sounding, before)
    assert note.request.pluck.position == 0.44 and len(sounding.rings) <= 3
    struck = begun(sounding)
    turn = turn_after(sounding, struck)
    assert turn.began_frame - struck.began_frame == pytest.approx(TURN_S * RATE_HZ, abs=QUANTUM)
    sounding.performance.seek(0.75)
    note = sounding.notes.latest
    turn = turn_after(sounding, note)
    assert turn.began_frame - note.began_frame == pytest.approx(0.25 * TURN_S * RATE_HZ, abs=QUANTUM)
    sounding.wait(lambda: turn.seconds > 0.3 * TURN_S)  # the next turn is handed over by now
    sounding.change(loop=False)
    sounding.wait(lambda: turn.seconds > TURN_S + 0.05)
    assert sounding.notes.latest is turn and not turn.over


def test_a_preset_is_plucked_as_trained_and_a_pluck_by_hand_stays_while_models_are_compared(opened):
    known, same, noise = (f"nylon_nonlinear_{name}" for name in KNOWN)
    lab = opened(known, same, noise, face="lab", preset=noise, position=0.1)
    before, middle = lab.choices.pluck, Pluck(0.5, 5.5, "gaussian", 0.06)
    button = lab.find(QToolButton, "Pluck as trained")
    lab.change(preset=known)
    assert lab.choices.pluck == middle and button.isEnabled()
    lab.key(KEY.Key_Z, CONTROL)
    assert (lab.choices.preset, lab.choices.pluck) == (noise, before), "preset and pluck are one step"
    lab.change(preset=known)
    lab.change(position=0.1, amplitude_mm=9.0, shape="triangular")
    by_hand = lab.choices.pluck
    lab.change(preset=same)
    assert lab.choices.pluck == by_hand
    button.click()
    assert (lab.choices.pluck, lab.struck[-1].request.pluck) == (middle, middle)
    count = len(lab.struck)
    lab.change(preset=noise)
    lab.key(KEY.Key_P, CONTROL | SHIFT)
    assert len(lab.struck) == count and not button.isEnabled() and "random shapes" in button.toolTip()
