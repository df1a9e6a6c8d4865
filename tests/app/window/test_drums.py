"""Drums in the window: chosen, struck by keys, pads and at places, seen moving, heard, recorded and exported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mido
import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QPoint
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QToolButton

from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from app.player.offline import render_events
from app.playing.key_note import KeyNote
from app.rendering import BlowTake, blow
from app.views.dialogs.abx_dialog import AbxDialog
from app.window.controller import DRUMS_PLAYED
from engine.presets import SHIPPED, load_preset
from engine.values.effects import Room
from tests.app.places import files_in
from tests.app.player.seen import seen
from tests.app.window.conftest import Open
from tests.app.window.driver import KEY, LEFT, Window, press
from tests.app.window.midi import FakeBackend
from tests.app.window.panels.conftest import curves

PADS = range(36, 52)
DRUMS = sorted(path.stem for path in INSTRUMENTS.glob("*.json") if read_instrument(path).strings.kind == "drums")
KIT, TOMS = read_instrument(INSTRUMENTS / "concert_toms.json"), read_instrument(INSTRUMENTS / "tuned_toms.json")
Levels = list[float]


def levels_of(w: Window, monkeypatch: pytest.MonkeyPatch) -> Levels:
    """The levels in dB that the meter is given from now on."""
    levels: Levels = []
    monkeypatch.setattr(w.window.transport.meter, "show_level", lambda peak_db, limiting: levels.append(peak_db))
    return levels


@pytest.fixture
def kit(backend: FakeBackend, opened: Open, tmp_path: Path) -> Window:
    made = opened("studio_any_string", settings={"files": files_in(tmp_path)}, instrument=KIT)
    made.wait_for_keys()
    return made


@pytest.fixture
def toms(opened: Open) -> Window:
    """The Lab with tuned toms, in mono and in slow motion."""
    mono = TOMS.model_copy(update={"pickup": TOMS.pickup.model_copy(update={"points": (0.5,)})})
    made = opened("studio_any_string", face="lab", instrument=mono, a="model", b="truth", heard="a", speed=0.02)
    made.wait_for_keys()
    return made


def strike(w: Window, x: float, y: float) -> Any:
    """Click on the picture of the drum; the note."""
    view = w.controller.drum.view
    place = view.axes.at(0, (x, y))
    QTest.mouseClick(view, LEFT, pos=QPoint(round(place.x()), round(place.y())))
    return w.struck[-1]


def shown(w: Window) -> BlowTake | None:
    return w.performance.moment(0.0).blow


def whole(w: Window) -> BlowTake:
    """The motion that is shown, once it is rendered."""
    w.wait(lambda: (take := shown(w)) is not None and take.complete)
    take = shown(w)
    assert take is not None
    return take


def test_pads_keys_and_channel_ten_strike_drums_that_ring_light_and_stop(
    backend: FakeBackend, kit: Window, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert len(DRUMS) == 7 and set(DRUMS) <= set(kit.controller.instruments.browser.listed)
    levels = levels_of(kit, monkeypatch)
    for key in (38, 45):
        kit.play(key, 110)
    kit.wait(lambda: {38, 45} <= kit.keys.sounding().keys() and max(levels, default=-99) > -40)
    kit.wait(lambda: kit.window.instrument.keys.level(45) > 0.1)
    assert kit.session.stage.drum_key == 45 and kit.notes.ringing == 2
    kit.play(60, 110)  # no pad
    assert kit.notes.ringing == 2
    for sounding in (False, True, False):
        kit.key(KEY.Key_Space)  # strikes the drum that was struck last
        kit.wait(lambda sounding=sounding: bool(kit.keys.sounding()) == sounding)
    assert kit.struck[-1].event.key == 45
    kit.controller.inputs.strike(0.1, -0.2, 100.0)
    event = kit.struck[-1].event
    assert (event.key, event.velocity, event.place) == (45, 100, (0.1, -0.2))
    count = len(kit.struck)
    backend.play(kit, "pitch", *(NoteOn(key, 90, 9) for key in PADS))
    struck = kit.struck[count:]
    assert [isinstance(note, KeyNote) and note.event.key for note in struck] == list(PADS)
    kit.wait(lambda: all(note.known and not note.cut for note in struck))  # they may have rung out by then
    assert struck[-1].of_drum and struck[-1].request is None
    song = tmp_path / "song.mid"
    song.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(40, 90, 9)), TimedEvent(30.0, NoteOff(40, 9))]))
    kit.drop(song)
    kit.wait(lambda: kit.struck[-1].event.key == 40 and kit.struck[-1].known)
    player = kit.keys.player
    assert player is not None
    kit.change(a="model", b="truth", heard="a")
    kit.play(36, 127)
    kit.wait(lambda: seen(player))
    kit.change(heard="b")
    assert [player.compiled.source_gain(source) for source in (0, 1)] == [0.0, 1.0]
    kit.change(b="difference")
    assert player.compiled.source_gain(0) == -player.compiled.source_gain(1) > 0
    assert kit.said == []


def test_strings_and_drums_follow_one_another_without_a_leftover(kit: Window, tmp_path: Path) -> None:
    """Each has a player and controls of its own; views of a string say that drums are played."""
    window, panel = kit.window, kit.window.instrument
    kit.change(face="lab")
    assert {each.covered for each in kit.panels if each.of_strings} == {DRUMS_PLAYED}
    for each in kit.panels:
        if each.location != "stage":
            kit.panel(each.key)
            kit.qtbot.wait(1)
    assert not kit.performance.ready, "no string is plucked"
    of_string = [window.transport.knobs["position"], kit.find(QComboBox, "Pick-up"), kit.find(QToolButton, "Loop")]
    assert not any(each.isEnabled() for each in of_string) and window.transport.knobs["listen"].isEnabled()
    kit.change(face="play", loop=True, solo=3, pickup="bridge", listen=0.7)
    play, fold = kit.find(QPushButton, "Strike or stop"), kit.find(QToolButton, "Drum knobs")
    assert play.text() == "▶  Strike"
    assert "Bass drum 22 inch" in panel.knobs.facts.accessibleDescription()
    assert not panel.knobs.knobs["knobs.gauge"].isEnabled() and panel.knobs.knobs["knobs.decay"].isEnabled()
    panel.show_surface("neck")
    assert panel.keys.isVisible() and not panel.neck.isVisible(), "drums have no strings"
    kit.play(36, 127, hold=True)
    kit.sounds(36)
    for _ in range(3):
        kit.controller.instruments.choose("steel_string_acoustic")
        kit.controller.instruments.choose("concert_toms")
    kit.choose("steel_string_acoustic")
    assert (play.accessibleName(), fold.text(), panel.neck.isVisible()) == ("Pluck or stop", "String knobs", True)
    assert all(each.isEnabled() for each in of_string[:2]) and not any(each.covered for each in kit.panels)
    kit.wait(lambda: kit.performance.ready and kit.performance.settled)
    kit.change(loop=False)
    kit.play(52, hold=True)
    kit.wait(lambda: 52 in kit.keys.sounding())
    kit.performance.stop()
    kit.wait(lambda: kit.controller.sound.mixer.active == 0)
    mine = tmp_path / "mine.json"
    mine.write_bytes((INSTRUMENTS / "thin_bars.json").read_bytes())
    kit.drop(mine)
    assert kit.performance.take is None
    kit.wait_for_keys()
    kit.pluck()
    kit.wait(lambda: kit.session.stage.drum_key in kit.keys.sounding())
    kit.qtbot.keyPress(window, KEY.Key_K)
    kit.wait(lambda: 72 in kit.keys.sounding())  # from C4 all keys sound
    kit.qtbot.keyRelease(window, KEY.Key_K)
    kit.controller.instruments.choose("steel_string_acoustic")
    kit.wait(lambda: kit.performance.ready)
    assert kit.said == []


def test_the_listening_test_compares_model_and_truth_of_a_blow(opened: Open, speakers: Any) -> None:
    kit = opened("studio_any_string", sound=speakers, instrument=KIT)
    kit.wait_for_keys()
    kit.play(38, 127)
    kit.wait(lambda: kit.struck[-1].known)
    kit.controller.inputs.strike(0.2, -0.1, 100)
    kit.controller.listening_test()
    dialog = kit.find(AbxDialog)
    assert any(each.text().startswith("Concert toms, D2 at velocity 100") for each in dialog.findChildren(QLabel))
    kit.wait(dialog.findChild(QPushButton, "play").isEnabled)
    count = len(kit.struck)
    kit.play(40)  # nothing else plays meanwhile
    assert len(kit.struck) == count
    for name in "AB":
        press(dialog, f"▶  Hear {name}")
        kit.wait(lambda: any(voice.sounding for voice in kit.controller.sound.mixer.voices))
    dialog.abandon()


def test_drumming_is_recorded_and_exported_and_a_blow_is_a_note_that_comes_back(kit: Window, tmp_path: Path) -> None:
    for _ in range(2):
        kit.press("Record")
        for key in (36, 38, 41) if not kit.struck else ():
            kit.play(key, 110)
    dialog = kit.controller.exports.dialog
    assert dialog is not None and dialog.kind == "performance"
    dialog.save.click()
    kit.wait(lambda: "Saved" in dialog.state.text())
    (wav,), (mid,) = tmp_path.rglob("*.wav"), tmp_path.rglob("*.mid")
    sound, rate_hz = soundfile.read(wav)
    assert np.abs(sound[: rate_hz // 2]).max() > 0.01
    assert {each.note for each in mido.MidiFile(mid) if each.type == "note_on" and each.velocity} == {36, 38, 41}
    kit.play(38, 120)
    kit.window.transport.export.click()
    assert "Concert toms, D2 at velocity 120" in dialog.note.what.text()
    assert not dialog.note.through.isVisible(), "there is no string"
    assert dialog.note.through_words.text() == "Concert toms with room and level, as it is heard"
    dialog.save.click()
    kit.wait(lambda: "Saved" in dialog.state.text())
    file = tmp_path / "Concert toms D2 hard.wav"
    assert np.abs(soundfile.read(file)[0]).max() > 0.05
    kit.controller.exports.open("plugin")
    assert dialog.plugin.job().instrument.strings.kind == "drums"
    dialog.reject()
    kit.choose("steel_string_acoustic")
    kit.drop(file)
    assert kit.choices.drums is not None


def test_a_click_on_the_drum_sounds_and_its_picture_is_of_the_blow_that_sounds(
    toms: Window, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its signal is what the compiled player makes of the same event, times the gain of the key."""
    view, levels = toms.controller.drum.view, levels_of(toms, monkeypatch)
    assert view.isVisible() and not toms.controller.string.isVisible()
    note = strike(toms, 0.4, -0.3)
    assert note.event.place == pytest.approx((0.4, -0.3), abs=0.02)
    assert note.event.velocity == toms.choices.velocity and toms.notes.ringing == 1
    toms.wait(lambda: max(levels, default=-99) > -60)
    toms.wait(lambda: view.frame is not None)
    first: Any = view.frame

    def moved() -> bool:
        frame = view.frame
        return frame is not None and bool((frame.pictures_m["model"] != first.pictures_m["model"]).any())

    toms.wait(moved)
    second: Any = view.frame
    model, truth = second.pictures_m["model"], second.pictures_m["truth"]
    assert np.abs(truth).max() > 0 and np.abs(model - truth).max() < 1e-4 * np.abs(truth).max()
    toms.wait(lambda: "Error of this blow" in toms.window.error_label.text())
    take = whole(toms)
    assert take.request.struck.event.place == note.event.place
    dry = toms.instrument.model_copy(update={"room": Room(mix=0.0)})
    preset = load_preset(SHIPPED / "studio_any_string.safetensors")
    played = render_events(dry, preset, [TimedEvent(0.0, note.event)], blow.RATE_HZ, "truth", seconds=0.3)
    heard = np.concatenate(list(played))[:, 0]
    signal = take.listened.signals["truth"].read()[: len(heard), 0]
    assert max(np.corrcoef(heard[lag:12_000], signal[: 12_000 - lag])[0, 1] for lag in range(3)) > 0.999


def test_a_dragged_mark_changes_the_sound_and_a_seek_keeps_the_picture(toms: Window) -> None:
    view = toms.controller.drum.view
    strike(toms, 0.5, 0.0)
    take = whole(toms)
    above, motion = take.listened.signals["model"].read().copy(), take.motions["model"].size_m.copy()
    axes = view.axes
    foot = QPoint(round(axes.x(0.5)), round(axes.bottom) + 8)
    toms.drag(view, foot, QPoint(round(axes.x(0.97)), foot.y()))
    assert toms.choices.listen == pytest.approx(0.97, abs=0.02) == toms.instrument.pickup.points[0]
    ear = toms.choices.ear
    toms.wait(lambda: take.listened.ear == ear and take.listened.complete)
    assert np.abs(take.listened.signals["model"].read() - above).max() > 0.1 * np.abs(above).max()
    assert (take.motions["model"].size_m == motion).all()
    toms.wait(lambda: toms.keys.player.ear.points == ear.points)  # type: ignore[union-attr]
    toms.performance.seek(0.2)
    assert toms.performance.position_s == 0.2 and not toms.performance.moving
    toms.wait(lambda: view.frame is not None and "0.200 s" in view.frame.caption)
    toms.performance.stop()
    toms.wait(lambda: toms.notes.ringing == 0)
    assert toms.performance.position_s == 0.2
    toms.controller.play_or_stop()
    assert toms.notes.ringing == 1


def test_keys_choose_the_place_and_each_instrument_has_its_own(toms: Window) -> None:
    drum, (x, y) = toms.controller.drum, TOMS.strings.drums[0].place  # type: ignore[union-attr]
    drum.view.setFocus()
    for key in (KEY.Key_Right, KEY.Key_Up, KEY.Key_Return):
        toms.key(key, on=drum.view)
    assert drum.place == pytest.approx((x + 0.05, y + 0.05)) == toms.struck[-1].event.place
    toms.choose("concert_toms")
    for key in (47, 36):
        toms.play(key)
        name = KIT.strings.of_key(key).name  # type: ignore[union-attr]
        toms.wait(lambda name=name: name in drum.view.accessibleDescription())
    toms.key(KEY.Key_Return, on=drum.view)
    assert toms.struck[-1].event.key == 36
    toms.wait(lambda: shown(toms) is not None)
    timpani = read_instrument(INSTRUMENTS / "timpani.json")
    toms.change(played=timpani)
    assert shown(toms) is None and drum.place == timpani.strings.drums[0].place  # type: ignore[union-attr]
    toms.wait(lambda: drum.view.frame is None)


def test_views_of_a_line_are_covered_and_those_of_sound_and_error_show_drums(toms: Window) -> None:
    by_key = {panel.key: panel for panel in toms.panels}
    for key in ("partials", "space_time", "eigenvalues", "error_plane", "compare"):
        assert toms.panel(key).covered
    cover = toms.panel("space_time").grab().toImage()
    assert len({cover.pixelColor(3, y).name() for y in range(3, cover.height() - 3)}) == 1, "nothing shines through"
    strike(toms, 0.3, 0.3)
    for key in ("error_time", "spectrum", "waveform"):
        panel = toms.panel(key)
        assert panel.covered == ""
        toms.wait(lambda panel=panel: len(curves(panel.plot)["model"][0]) > 3)
        assert key != "error_time" or (curves(panel.plot)["model"][1] < -4).all(), "the model agrees with the truth"
    gram = toms.panel("spectrogram")
    toms.wait(lambda: any(each.image is not None and each.image.any() for each in images(gram)))
    toms.change(preset="first")
    assert by_key["partials"].covered == "" and by_key["string"].isVisible() and not by_key["drum"].isVisible()
    toms.wait_for_take()


def images(panel: Any) -> list[Any]:
    return [each for each in panel.plot.getPlotItem().items if hasattr(each, "image")]
