"""The instrument in the window: keys and plucks by hand play it, knobs change it, files and names keep it."""

from dataclasses import replace
from functools import partial
from threading import Event
from typing import Any

from PySide6.QtWidgets import QComboBox, QInputDialog, QToolButton, QToolTip

from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import own_instruments, read_instrument
from app.player.events import KEYS, ControlChange, NoteOff, NoteOn, PluckAt, TimedEvent
from app.player.midi_file import midi_bytes
from app.player.strings import Strings, on_string
from app.playing.key_note import KeyNote
from app.playing.keyboard import HIGHEST_PLACE, LOWEST_PLACE
from app.playing.keys import Keys
from app.playing.midi import MidiChoices
from app.playing.note import PluckVoices
from app.rendering.subject import path_of, string_of
from app.window.song import events_from
from engine.pluck import SHAPES, Pluck
from tests.app.player.seen import Seen, sounding
from tests.app.window.conftest import PADS
from tests.app.window.driver import CONTROL, KEY, LEFT, Window, choose

HARP = read_instrument(INSTRUMENTS / "concert_harp.json")


def ringing(w: Window) -> list[Seen]:
    """The notes of keys that have their places."""
    assert w.keys.player is not None
    return sounding(w.keys.player)


def key_note(w: Window) -> Any:
    """The latest note, of a key, once its string is known."""
    note = w.struck[-1]
    assert isinstance(note, KeyNote)
    w.wait(lambda: note.request is not None)
    return note


def turn(w: Window, field: str, value: object) -> None:
    """Turn a knob of the instrument."""
    w.window.instrument.knobs.changed.emit(field, value)


def test_keys_play_pitches_or_places_and_the_window_shows_the_string(guitar):
    strip = guitar.window.instrument
    pitches, places = strip.plays.menu().actions()
    guitar.qtbot.keyPress(guitar.window, KEY.Key_A)
    guitar.sounds(48)
    guitar.wait_for_string()
    wanted_hz = 440 * 2 ** ((48 - 69) / 12)
    guitar.wait(lambda: (take := guitar.performance.take) and abs(take.fundamental_hz / wanted_hz - 1) < 1e-3)
    guitar.wait(lambda: strip.keys.level(48) > 0.1)
    assert not ringing(guitar)[0].damped
    guitar.qtbot.keyRelease(guitar.window, KEY.Key_A)
    guitar.wait(lambda: ringing(guitar)[0].damped)
    guitar.controller.play_or_stop()
    guitar.play(50, hold=True)
    guitar.wait(lambda: strip.knobs.facts.accessibleDescription().startswith("key D3, pitch 146.8 Hz"))
    places.trigger()
    assert strip.plays.text().startswith("Keys set pluck position")
    assert guitar.choices.preset == "studio_any_string" and not guitar.controller.settings().choices.plays_instrument
    guitar.wait(lambda: not guitar.keys.sounding())
    guitar.key(KEY.Key_A)
    assert isinstance(guitar.struck[-1], PluckVoices) and guitar.keys.sounding() == {}
    pitches.trigger()
    assert strip.plays.text().startswith("Keys play notes") and guitar.choices.plays_instrument


def test_a_pluck_by_hand_is_a_note_of_the_instrument_except_beside_another_preset(guitar):
    guitar.play(52)
    guitar.wait_for_string()
    shown, other = guitar.choices.string, next(each for each in SHAPES if each != guitar.choices.pluck.shape)
    guitar.change(position=0.31, amplitude_mm=1.2, shape=other)
    guitar.keys.begin_recording()
    guitar.pluck()
    note = key_note(guitar)
    pluck = note.request.pluck
    assert (pluck.position, pluck.amplitude_mm, pluck.shape) == (0.31, 1.2, other)
    guitar.wait(lambda: guitar.performance.ready)
    assert guitar.choices.string == shown and guitar.choices.pluck == pluck
    assert (ringing(guitar)[-1].key, ringing(guitar)[-1].damped) == (52, False)
    recorded = [each.event for each in guitar.keys.recorder.end()]
    assert NoteOn(52, note.event.velocity, KEYS, pluck=pluck) in recorded
    guitar.change(position=0.41)
    struck = guitar.session.stage.struck
    assert struck is not None and struck.event.pluck == guitar.choices.pluck, "an export has the pluck that is shown"
    words = "Keys sound with the model of their instrument"
    guitar.change(a="preset:second", heard="a")
    guitar.change(instrument=guitar.instrument.with_value("knobs.decay", 2.0))
    assert [words in each.message for each in guitar.window.notices.notices].count(True) == 1
    assert guitar.session.stage.struck is None and isinstance(guitar.pluck(), PluckVoices)


def test_octaves_move_to_where_keys_sound_and_the_strip_says_so(guitar):
    guitar.choose("toy_wires")  # C3 to D♯6
    guitar.change(octave=3)
    guitar.controller.instruments.change("knobs.decay", 3.0)
    assert guitar.choices.octave == 3, "four keys sound"
    guitar.change(octave=2)  # C5 to F6
    for instrument, octave in (("slack_bass", -1), ("concert_harp", -1), ("mandolin", 1)):
        guitar.controller.instruments.choose(instrument)
        assert guitar.choices.octave == octave
        assert instrument != "slack_bass" or QToolTip.text() == "Octave moved: Slack bass has C1 to A♯3"


def test_knobs_and_transport_change_the_instrument_and_undo_takes_them_back(guitar):
    history, start, knobs = guitar.session, guitar.choices, guitar.window.instrument.knobs
    for value in (2.0, 99.0):  # the latter is beyond its bounds
        turn(guitar, "knobs.stiffness", value)
        assert guitar.instrument.knobs.stiffness == 2.0
    history.undo()
    assert guitar.instrument == start.instrument
    history.redo()
    guitar.controller.instruments.revert()
    assert guitar.instrument == start.instrument
    for shape, name in (("triangular", "Triangle"), ("raised_cosine", "Raised cosine")):
        turn(guitar, "pluck.shape", shape)
        assert (guitar.instrument.pluck.shape, knobs.shape.currentText()) == (shape, name)
        assert knobs.knobs["pluck.width_hard"].isEnabled() == (shape != "triangular")
    assert history.undo_words == "pluck shape"
    turn(guitar, "pickup.points.0", 0.11)
    guitar.play(60)
    note = key_note(guitar)
    assert (note.request.pluck.shape, note.request.ear.points[0]) == ("raised_cosine", guitar.choices.listen)
    history.undo()
    assert guitar.choices.listen == start.listen != note.request.ear.points[0] == 0.11
    stereo, pickup = guitar.find(QToolButton, "Stereo"), guitar.find(QComboBox, "Pick-up")
    choose(pickup, "bridge")
    stereo.setChecked(not start.stereo)
    guitar.session.move_listening_point(0.21)
    heard = guitar.instrument.pickup
    assert (heard.kind, heard.points[0], len(heard.points) == 2) == ("bridge", 0.21, not start.stereo)
    assert guitar.window.instrument.bar.save.isEnabled() and guitar.keys.player.instrument == guitar.instrument  # type: ignore[union-attr]
    knobs.knobs["tuning.transpose"].value_asked.emit(2.2)
    assert guitar.instrument.tuning.transpose == 2


def test_an_instrument_is_saved_renamed_compared_and_deleted(guitar, monkeypatch, tmp_path):
    instruments, bar, asked = guitar.controller.instruments, guitar.window.instrument.bar, list[str]()
    names = ["AC/DC", "My Bass.", "Classical guitar", "Mine", "Yours"]

    def ask(parent: object, title: str, label: str, text: str) -> tuple[str, bool]:
        asked.append(f"{text}: {label}")
        return names.pop(0), True

    def heard() -> tuple[bool, Instrument]:
        return bar.compare.isChecked(), guitar.keys.player.instrument  # type: ignore[union-attr]

    monkeypatch.setattr(QInputDialog, "getText", ask)
    instruments.change("knobs.decay", 3.0)
    guitar.key(KEY.Key_S, CONTROL)
    file = own_instruments() / "mine.json"
    assert asked[1].startswith("AC/DC: ") and "must not begin or end with a full stop, or hold one of" in asked[1]
    assert asked[3].startswith("Classical guitar: ") and "a factory instrument has this name" in asked[3]
    instruments.change("knobs.decay", 4.0)
    saved, mine = read_instrument(file), guitar.instrument
    assert saved.knobs.decay == 3.0
    for wanted in ((True, saved), (False, mine)):
        bar.compare.click()
        assert heard() == wanted and guitar.instrument == mine
    for ends in (lambda: instruments.change("level_db", -3.0), guitar.session.undo, instruments.revert):
        bar.compare.click()
        ends()  # it is of the choice, not of the sound
        assert heard() == (False, guitar.instrument)
    assert guitar.instrument == saved and not bar.compare.isEnabled()
    instruments.change("knobs.decay", 5.0)
    bar.compare.click()
    file = own_instruments().rename(own_instruments().with_name("patches")) / file.name  # the last version's folder
    instruments.reload()
    instruments.save()  # the user's own, without a question
    assert read_instrument(file).knobs.decay == 5.0 and heard() == (False, guitar.instrument)
    instruments.browser.favourite_asked.emit("mine")
    instruments.rename()
    assert not file.exists() and read_instrument(own_instruments() / "yours.json").name == "Yours"
    assert (bar.save.isEnabled(), bar.rename.isEnabled()) == (False, True), "it is saved, and one's own"
    assert "yours" in instruments.favourites and "mine" not in instruments.favourites
    (mine := own_instruments() / "yours.json").rename(tmp_path / "yours.json")
    mine.mkdir()
    instruments.delete("yours")
    assert f"{mine}: cannot be deleted (" in guitar.said[-2] and "yours.json: cannot be read (" in guitar.said[-1]
    mine.rmdir()
    (tmp_path / "yours.json").rename(mine)
    instruments.reload()
    instruments.delete("yours")
    assert not list(own_instruments().glob("*.json")) and "yours" not in instruments.favourites
    assert (bar.save.isEnabled(), bar.rename.isEnabled()) == (True, False)
    bar.compare.click()
    assert heard() == (False, guitar.instrument), "there is nothing to compare with"


def test_switches_of_the_strip_reach_the_keys_and_its_choices_the_instrument(guitar):
    strip, start = guitar.window.instrument, guitar.instrument
    strip.touch_chosen.emit("slide")
    strip.technique_switched.emit("harmonics", True)
    guitar.wait(lambda: guitar.keys.player.compiled.channel(KEYS).harmonics)  # type: ignore[union-attr]
    channel = guitar.keys.player.compiled.channel(KEYS)  # type: ignore[union-attr]
    assert (channel.legato, channel.slides, channel.slide_time, channel.tremolo) == (True, True, 90, False)
    guitar.window.action["difference"].trigger()
    assert not guitar.choices.difference, "it is heard in the Lab"
    strip.bar.octave_asked.emit(1)
    guitar.key(KEY.Key_C)
    assert (guitar.choices.octave, guitar.choices.velocity) == (1, 74)
    strip.bar.macro_turned.emit(1, 1.0)
    assert guitar.instrument.knobs.decay < 0.276
    strip.knobs.figure_asked.emit("knobs.length", 700.0)
    key_string = guitar.session.stage.shown_string(guitar.instrument)
    assert key_string is not None and abs(key_string.parameters.length_m - 0.7) < 1e-6
    strip.bar.scale_asked.emit("19 equal steps")
    assert "19" in guitar.instrument.tuning.scale and guitar.said[-1].startswith("19 equal steps tunes")
    strip.bar.scale_asked.emit("")
    assert guitar.instrument.tuning == start.tuning


def test_without_an_instrument_its_controls_change_nothing(lab):
    desk, bar, before = lab.controller.instruments, lab.window.instrument.bar, lab.choices
    for ask in (desk.save, desk.save_as, desk.revert):
        ask()
    for take in (desk.choose_scale, desk.choose, desk.audition, desk.delete):
        take("")
    desk.change("level_db", 1.0)
    desk.turn_to("knobs.length", 1.0)
    bar.macro_turned.emit(0, 1.0)
    bar.body_chosen.emit("guitar")
    assert lab.choices == before and lab.said == []
    desk.rename()
    desk.take_body("hall")
    assert [words.split()[0] for words in lab.said] == ["Only", "The"] and "choose an instrument" in lab.said[1]
    lab.change(preset="none")
    lab.window.action["abx"].trigger()
    assert lab.said[-1].startswith("The listening test needs a preset")


def test_the_browser_plays_what_is_there(guitar, monkeypatch):
    instruments = guitar.controller.instruments
    instruments.choose("mandolin")
    instruments.change("knobs.decay", 3.0)
    changed = guitar.instrument
    guitar.session.play_string()
    instruments.audition("mandolin")  # it is there already, with its changes
    assert guitar.choices.played == changed
    instruments.audition("concert_harp")
    assert guitar.instrument == HARP
    guitar.wait(lambda: guitar.struck[-1].instrument == HARP)
    loading, begin = Event(), Keys._begin
    monkeypatch.setattr(Keys, "_begin", lambda *args: loading.wait(20) and begin(*args))
    count = len(guitar.struck)
    instruments.audition("thin_bars")  # of drums, which another player has to load
    guitar.qtbot.wait(100)
    assert len(guitar.struck) == count
    loading.set()
    guitar.wait(lambda: guitar.struck[-1].instrument == guitar.instrument)
    instruments.audition("concert_harp")
    instruments.toggle()
    browser, loaded = instruments.browser, list[str]()
    for key in (KEY.Key_PageDown, KEY.Key_Up, KEY.Key_PageUp, KEY.Key_Down):
        guitar.key(key, on=browser.search)
        loaded.append(guitar.instrument.name)
    assert len(set(loaded)) == 4 and guitar.instrument == HARP, "a page and a step down, the same up"
    clicked = partial(guitar.qtbot.mouseClick, browser.list.viewport(), LEFT)
    mandolin = browser.list.index_of("mandolin")
    browser.list.scrollTo(mandolin)
    clicked(pos=browser.list.visualRect(mandolin.siblingAtColumn(0)).center())
    assert "mandolin" in instruments.favourites
    middle = browser.list.visualRect(browser.list.index_of("mandolin")).center()
    clicked(pos=middle)
    guitar.wait_for_keys()
    guitar.key(KEY.Key_Space, on=browser.list)
    guitar.wait(lambda: guitar.struck[-1].instrument.name == "Mandolin")
    guitar.qtbot.mouseDClick(browser.list.viewport(), LEFT, pos=middle)
    assert not browser.isVisible()


def test_dropped_songs_are_played_without_drums_and_have_a_transport(guitar, tmp_path):
    song, strip = tmp_path / "song.mid", guitar.window.song
    pedal, late = TimedEvent(0.5, ControlChange(64, 127)), TimedEvent(30.0, NoteOff(52))
    begin = [TimedEvent(0.0, NoteOn(40, 90, 9)), TimedEvent(0.0, NoteOn(52, 90))]
    assert events_from([*begin, pedal, late], 2.0) == [replace(pedal, time_s=0.0), replace(late, time_s=28.0)]
    song.write_bytes(midi_bytes([*begin, pedal, late]))  # it must not end before it is seen
    guitar.drop(song)
    guitar.sounds(52)
    assert guitar.said == ["song.mid is played without its drums (channel 10)."]
    assert strip.isVisible() and strip.name.text() == "song.mid"
    guitar.key(KEY.Key_Right, on=strip.slider)
    assert guitar.controller.instruments.playing and strip.play.text() == "■" and strip.slider.value() >= 10
    guitar.qtbot.mouseClick(strip.play, LEFT)
    assert not guitar.controller.instruments.playing and strip.play.text() == "▶" and strip.slider.value() >= 10
    for key, seconds in ((KEY.Key_End, "0:30"), (KEY.Key_Left, "0:29")):
        guitar.key(key, on=strip.slider)
        assert strip.time.text() == f"{seconds} / 0:30"
    guitar.qtbot.mouseClick(strip.play, LEFT)
    guitar.wait(lambda: strip.time.text() == "0:00 / 0:30" and strip.play.text() == "▶")  # at the end it goes back
    guitar.qtbot.mouseClick(strip.closer, LEFT)
    assert strip.isHidden()
    song.write_bytes(b"no")
    guitar.drop(song)
    assert "song.mid" in guitar.said[-1]


def test_a_dropped_instrument_is_added_once(guitar, tmp_path, monkeypatch):
    file, names = tmp_path / "from a friend.json", []
    tuned = HARP.model_copy(update={"level_db": HARP.level_db - 2})
    for instrument in (tuned, tuned, HARP, tuned.model_copy(update={"description": "Another"})):
        file.write_text(instrument.model_dump_json())
        guitar.drop(file)
        names.append(guitar.instrument.name)
        assert guitar.instrument.model_copy(update={"name": instrument.name}) == instrument
    assert names == ["Concert harp 2", "Concert harp 2", "Concert harp", "Concert harp 3"]
    assert sorted(path.stem for path in own_instruments().glob("*.json")) == ["concert_harp_2", "concert_harp_3"]
    file.write_text(tuned.model_copy(update={"name": "Concert-harp 2!"}).model_dump_json())  # the same file's name
    guitar.drop(file)
    assert len(list(own_instruments().glob("*.json"))) == 3
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(file))  # a file: nothing can be added there
    mine = tuned.model_copy(update={"name": "Mine"})
    file.write_text(mine.model_dump_json())
    guitar.drop(file)
    assert guitar.instrument == mine and "not added to your library" in guitar.window.notices.text
    guitar.controller.instruments.browser.folder_asked.emit()
    assert f"{own_instruments()}: cannot be created (" in guitar.said[-1]


def test_an_instrument_shows_its_own_string_and_pluck_until_something_is_restored(guitar):
    key, string, low = sum(HARP.range) // 2, Strings(HARP).of_key(sum(HARP.range) // 2), Strings(HARP).of_key(43)
    assert string is not None and low is not None
    guitar.choose("concert_harp")
    guitar.wait(lambda: guitar.choices.string == string.parameters)
    assert guitar.choices.pluck == on_string(string, HARP.pluck.pluck(guitar.choices.velocity))
    guitar.wait(lambda: guitar.performance.playable)
    note = guitar.pluck()
    assert note.event.key == key and abs(note.event.velocity - guitar.choices.velocity) <= 1
    guitar.choose("classical_guitar")
    guitar.play(52)
    guitar.wait_for_string()
    guitar.change(played=HARP, string=low.parameters, position=0.2, shape=HARP.pluck.shape)
    assert (guitar.choices.string, guitar.choices.pluck.position) == (low.parameters, 0.2)
    guitar.wait(lambda: guitar.performance.playable)
    assert guitar.pluck().event.key == 43, "the string that was restored"


def test_notes_of_midi_choose_places_and_presets(backend, guitar, tmp_path):
    """Also on the string of the key that was struck last, and while the window is busy."""
    instruments, second = guitar.controller.inputs, guitar.controller.library.names.index("second")
    guitar.play(52)
    guitar.wait_for_string()
    before, reach, undo = guitar.choices, instruments.reach, guitar.session.undo_words
    backend.play(guitar, "position", NoteOn(HIGHEST_PLACE, 127))
    note = guitar.struck[-1]
    assert (note.event.pluck.position, note.event.pluck.amplitude_mm) == (reach.position[1], reach.amplitude_mm[1])
    assert guitar.choices.pluck.position == before.pluck.position, "the window has had no time yet"
    guitar.wait(lambda: guitar.choices.pluck.position == reach.position[1])
    assert (guitar.choices.string, guitar.choices.plays_instrument) == (before.string, True)
    assert guitar.session.undo_words == undo
    backend.play(guitar, "preset", NoteOn(LOWEST_PLACE + second, 100))
    note = guitar.struck[-1]
    assert path_of(note.request.preset).stem == "second"
    assert string_of(note.request.preset) is None, "not the string of the instrument's key"
    guitar.change(volume_db=-3.0)  # another choice takes nothing back
    instruments.play(PluckAt(Pluck(0.6, 2.5)))
    assert path_of(guitar.struck[-1].request.preset).stem == "second"
    guitar.wait(lambda: (guitar.choices.preset, guitar.choices.pluck.position) == ("second", 0.6))
    assert guitar.choices.single == "second" and guitar.choices.pluck.amplitude_mm == 2.5
    guitar.wait(lambda: all(each.seconds > 0 or each.cut for each in guitar.struck[-2:]))
    assert not guitar.struck[-1].cut and "cannot" not in guitar.window.notices.text
    assert guitar.controller.settings().midi == MidiChoices(port=PADS, notes="preset")
