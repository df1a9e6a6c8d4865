"""A patch played by events, with a mixer that the test turns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from threading import Event, Thread
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.instrument.compiled import InstrumentPlayer
from app.instrument.drum_keys import DrumKeys
from app.instrument.effects import body_curves
from app.instrument.events import (
    KEYS,
    LEGATO,
    NOTES_OFF,
    PORTAMENTO,
    RESET,
    SLIDE_TIME,
    SOUND_OFF,
    STRUM,
    SUSTAIN,
    TREMOLO,
    Bend,
    Controller,
    NoteOff,
    NoteOn,
    PatchTurned,
    TimedEvent,
)
from app.patches.instrument import SingleString
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Body, Patch
from app.playing import recorder
from app.playing.due import Due
from app.playing.key_note import KeyNote
from app.playing.notes import Notes
from app.playing.playback import Playback
from app.playing.sources import Sources
from engine.effects import Effects
from engine.kernels import constants as of
from engine.pluck import Pluck
from engine.values.ear import Ear
from engine.voices import Mixer
from engine.voices.voice import FADE_S
from tests.app.instrument.seen import Seen, seen, taken_up
from tests.app.monitors import find_shipped, hears

Wait = Callable[[Callable[[], bool]], None]
EAR = Ear((0.3,))


@pytest.fixture
def patch() -> Patch:
    """Its other strings stay silent, so that silence can be heard."""
    shipped = read_patch(PATCHES / "steel_string_acoustic.json")
    pluck = shipped.pluck.model_copy(update={"variation": 0.0})
    return shipped.model_copy(update={"body": Body(), "sympathy_s_kg": 0.0, "pluck": pluck})


@pytest.fixture
def wishes() -> list[Effects | None]:
    return []


@pytest.fixture
def reported() -> list[str]:
    return []


@pytest.fixture
def played(
    sound: Any, patch: Patch, wait: Wait, wishes: list[Effects | None], reported: list[str]
) -> Iterator[Notes]:
    """Notes whose instrument is the patch."""
    made = Notes(sound, Sources(), find_shipped, lambda message, details: reported.append(message), wishes.append)
    made.set_monitor(hears("model"))
    made.set_instrument(patch, EAR)
    wait(lambda: made.keys.player is not None)
    yield made
    made.close()


def player_of(notes: Notes) -> InstrumentPlayer:
    assert notes.keys.player is not None
    return notes.keys.player


def strike(notes: Notes, event: NoteOn, due: Due | None = None) -> KeyNote:
    """The note of a key, which the player has taken up."""
    note = notes.handle(event, due)
    assert isinstance(note, KeyNote)
    note.player.compiled.catch_up(notes.mixer.address)
    notes.look()
    return note


def now(notes: Notes, note: KeyNote) -> Seen:
    """It, as it rings."""
    return next(each for each in taken_up(note.player, notes.mixer) if each.id == note.id)


def settle(notes: Notes, wait: Wait) -> None:
    """Until what was asked for is done."""
    done = Event()
    notes.in_background(done.set)
    wait(done.is_set)


def test_a_key_waits_for_no_knob(played: Notes, patch: Patch, wait: Wait, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the loudness of the turned patch takes: here it takes until the key has sounded."""
    struck = strike(played, NoteOn(45, 60))
    before = now(played, struck).now
    begun, held = Event(), Event()

    def slow(*args: Any) -> float:
        begun.set()
        held.wait(30)
        return body_curves(*args)

    monkeypatch.setattr("app.instrument.string_keys.body_curves", slow)
    turned, begun_notes = patch.with_value("knobs.stiffness", 3.0), list[object]()
    knob = Thread(target=played.set_instrument, args=(turned, EAR))
    key = Thread(target=lambda: begun_notes.append(played.handle(NoteOn(52, 60))))
    knob.start()
    wait(begun.is_set)
    key.start()
    key.join(5)
    try:
        assert not key.is_alive()
        assert begun_notes != [None]
    finally:
        held.set()
        knob.join()
        key.join()
    wait(lambda: now(played, struck).now.second_moment_m4 == pytest.approx(3 * before.second_moment_m4))


def test_the_last_of_many_turns_counts(played: Notes, patch: Patch, wait: Wait) -> None:
    struck = strike(played, NoteOn(45, 60))
    before = now(played, struck).now
    played.keys.begin_recording()
    for stiffness in np.linspace(1.1, 3.0, 20):
        played.set_instrument(patch.with_value("knobs.stiffness", float(stiffness)), EAR)
    played.listen(Ear((0.1,)))
    made = strike(played, NoteOn(50, 60))
    assert made.ear.points == (0.1,)
    assert made.patch.knobs.stiffness == 3.0
    settle(played, wait)
    assert now(played, struck).now.second_moment_m4 == pytest.approx(3 * before.second_moment_m4)
    exact = player_of(played)
    fresh = InstrumentPlayer(exact.patch, exact.preset, 48_000, {"model": 1.0}, exact.ear)
    assert struck.parameters is not None
    mixer = Mixer(48_000)
    fresh.handle(NoteOn(45, 60))
    fresh.compiled.catch_up(mixer.address)
    (report,) = fresh.reports()
    assert strike(played, NoteOn(45, 60)).gain == report.gain
    turned = [each.event.patch for each in played.keys.recorder.end() if isinstance(each.event, PatchTurned)]
    assert (turned[-1].knobs.stiffness, turned[-1].pickup.points) == (3.0, (0.1,)), "it is recorded as it was played"


def test_another_patch_is_played_at_once(played: Notes, patch: Patch) -> None:
    """As by a note that is played to hear it."""
    other = read_patch(PATCHES / "classical_guitar.json")
    assert other.preset == patch.preset
    played.set_instrument(other, EAR)
    made = strike(played, NoteOn(45, 60))
    played.set_instrument(patch, EAR)
    again = strike(played, NoteOn(45, 60))
    assert None is not made.parameters != again.parameters


def test_an_impossible_tuning_is_reported_and_what_was_played_stays(
    played: Notes, patch: Patch, wait: Wait, reported: list[str]
) -> None:
    made = strike(played, NoteOn(45, 60))
    tuning = patch.tuning.model_copy(update={"scale": "no scale"})  # as no patch of a file could have it
    played.set_instrument(patch.model_copy(update={"tuning": tuning}), EAR)
    wait(lambda: bool(reported))
    played.listen(Ear((0.1,)))
    settle(played, wait)
    again = strike(played, NoteOn(45, 60))
    assert again.parameters == made.parameters
    assert again.ear == Ear((0.1,))
    assert len(reported) == 1


def test_a_patch_that_is_left_before_it_is_loaded_does_not_come_back(played: Notes, patch: Patch, wait: Wait) -> None:
    held, done = Event(), Event()

    def hold() -> None:
        held.wait(30)

    played.set_instrument(SingleString(), EAR)
    played.in_background(hold)
    played.set_instrument(patch, EAR)
    played.set_instrument(SingleString(), EAR)
    played.in_background(done.set)
    held.set()
    wait(done.is_set)
    assert not (played.keys.player is not None)
    played.set_instrument(patch, EAR)
    wait(lambda: played.keys.player is not None)


def test_a_key_sounds_with_the_next_frame_and_is_damped_when_let_go(played: Notes, sound: Any) -> None:
    note = played.handle(NoteOn(45, 100))
    heard = sound.mixer.render(24_000)[:, 0]
    assert np.abs(heard[:200]).max() > 1e-4
    played.poll()
    assert isinstance(note, KeyNote) and note.began and note.began_frame == 64
    assert played.keys.sounding()[45] > 0.2
    played.handle(NoteOff(45))
    sound.mixer.render(48_000)
    assert np.abs(sound.mixer.render(4_800)).max() < 1e-3 * np.abs(heard).max()


@pytest.mark.parametrize("heard", ["model", "truth"])
def test_a_note_that_slides_is_reported_on_its_string_with_where_it_is_stopped(
    played: Notes, sound: Any, heard: Any
) -> None:
    played.set_monitor(hears(heard))
    for number, value in ((LEGATO, 127), (PORTAMENTO, 127), (SLIDE_TIME, 64)):
        played.handle(Controller(number, value))
    played.handle(NoteOn(43, 100))  # the third fret of the lowest string
    sound.mixer.render(4_800)
    (struck,) = played.keys.sounding_notes()
    assert (struck.key, struck.string) == (43, -1) and abs(struck.slid) < 0.05
    played.handle(NoteOn(52, 100))  # where the next two strings have it too
    places = []
    for _ in range(40):
        sound.mixer.render(480)
        (note,) = played.keys.sounding_notes()
        assert (note.key, note.string) == (52, 5)
        places.append(note.key + note.slid)
    assert places[0] < 47 and places == sorted(places)
    assert places[-1] == pytest.approx(52, abs=0.1)
    assert sum(43.5 < place < 51.5 for place in places) > 3


def test_model_truth_and_difference_are_of_one_moment(played: Notes, sound: Any) -> None:
    played.handle(NoteOn(45, 100))
    loud = np.abs(sound.mixer.render(9_600)).max()
    played.set_monitor(hears("truth"))
    assert np.abs(sound.mixer.render(9_600)).max() > 0.1 * loud
    played.set_monitor(hears("difference"))
    sound.mixer.render(9_600)
    assert np.abs(sound.mixer.render(4_800)).max() < 1e-4 * loud


def test_a_stop_ends_strings_that_ring_in_sympathy_too(played: Notes, sound: Any, wait: Wait) -> None:
    sitar = read_patch(PATCHES / "concert_harp.json").model_copy(update={"sympathy_s_kg": 1e-3})
    played.set_instrument(sitar, EAR)
    settle(played, wait)
    low, high = sitar.range
    strike(played, NoteOn((low + high) // 2, 120))
    sound.mixer.render(48_000)
    player = player_of(played)
    assert player.compiled.record["sympathy"]["partials"] > 100
    assert player.compiled.record["sympathy"]["rings"]
    played.stop()
    sound.mixer.render(4_800)
    assert np.abs(sound.mixer.render(4_800)).max() < 1e-6
    strike(played, NoteOn((low + high) // 2, 120))
    assert np.abs(sound.mixer.render(9_600)).max() > 1e-3, "they ring again with the next note"


def test_pedal_bend_and_another_patch_reach_strings_that_ring(
    played: Notes, sound: Any, patch: Patch, wishes: list[Effects | None], wait: Wait
) -> None:
    played.handle(Controller(SUSTAIN, 127))
    struck = strike(played, NoteOn(45, 60))
    played.handle(NoteOff(45))
    assert not now(played, struck).damped
    before = now(played, struck).now
    played.handle(Bend(1.0))
    assert now(played, struck).now.tension_n > before.tension_n
    played.handle(Controller(SUSTAIN, 0))
    assert now(played, struck).damped
    stiff = patch.with_value("knobs.stiffness", 3.0).model_copy(update={"body": Body(name="guitar", mix=0.5)})
    played.set_instrument(stiff, EAR)
    wait(lambda: now(played, struck).now.second_moment_m4 == pytest.approx(3 * before.second_moment_m4))

    def hears_guitar() -> bool:
        """The room that the patch begins with, which has no body, may come late."""
        last = wishes[-1] if wishes else None
        return last is not None and last.body is not None

    wait(hears_guitar)
    played.hear_dry(True)
    wait(lambda: wishes[-1] is None)


def test_what_is_played_is_recorded_from_its_first_note_on(played: Notes, patch: Patch) -> None:
    played.keys.begin_recording()
    assert played.keys.recorder.recording
    played.handle(NoteOn(45, 60))
    played.handle(NoteOff(45))
    events = played.keys.recorder.end()
    assert [type(each.event) for each in events] == [PatchTurned, NoteOn, NoteOff]
    assert events[1].time_s == 0
    played.keys.begin_recording()
    assert played.keys.recorder.end() == []


def test_a_recording_begins_and_ends_as_the_hands_are(played: Notes) -> None:
    """With the pedal down and a wheel turned; and no key of it is down for ever."""
    for event in (Controller(SUSTAIN, 127), Bend(0.5), Controller(101, 0), Controller(100, 0), Controller(6, 12)):
        played.handle(event)
    strike(played, NoteOn(50, 60))
    played.keys.begin_recording()
    played.handle(NoteOn(45, 60))
    played.handle(NoteOff(45))
    played.handle(NoteOn(52, 60))
    events = played.keys.recorder.end()
    assert [each.event for each in events[-2:]] == [Controller(SUSTAIN, 0), NoteOff(52)]
    heard = player_of(played)
    again = InstrumentPlayer(heard.patch, heard.preset, 48_000, {"model": 1.0, "truth": 0.0}, heard.ear)
    for each in events[:-2]:
        again.handle(each.event)
    as_heard, as_recorded = (
        {each.key: each for each in taken_up(one, mixer)}
        for one, mixer in ((heard, played.mixer), (again, Mixer(48_000)))
    )
    assert as_recorded.keys() == {45, 52}
    for key, struck in as_recorded.items():
        assert (struck.now, struck.damped) == (as_heard[key].now, False)
    assert as_recorded[45].now.tension_n > as_recorded[45].own.tension_n


def test_a_soloed_mode_is_as_loud_as_in_the_note(played: Notes, sound: Any, wait: Wait) -> None:
    """So that the other modes do not thunder when the solo ends."""
    made = strike(played, NoteOn(45, 100))
    whole = made.gain
    played.listen(replace(EAR, solo=5))
    assert strike(played, NoteOn(45, 100)).gain == pytest.approx(whole)
    played.listen(Ear((0.0,)))
    assert strike(played, NoteOn(45, 100)).gain <= 1, "nothing is heard of it: no gain would help"
    played.listen(EAR)
    settle(played, wait)
    assert strike(played, NoteOn(45, 100)).gain == pytest.approx(whole)


def test_keys_go_out_while_the_output_stands(played: Notes, sound: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    played.handle(NoteOn(45, 127))
    sound.mixer.render(4_800)
    assert played.keys.sounding()
    monkeypatch.setattr("app.playing.keys.STANDS_S", 0.0)
    assert played.keys.sounding() == {}  # no frame since
    sound.mixer.render(4_800)
    assert played.keys.sounding()


@pytest.mark.parametrize(("rate_hz", "channels"), [(48_000, 1), (44_100, 2)])
def test_keys_of_a_device_that_is_gone_go_out_and_leave_no_motion(
    played: Notes, sound: Any, rate_hz: int, channels: int
) -> None:
    played.handle(NoteOn(45, 127))
    sound.mixer.render(4_800)
    assert played.keys.sounding()
    sound.mixer = type(sound.mixer)(rate_hz, channels)
    played.poll()
    assert played.keys.sounding() == {}
    played.handle(NoteOn(45, 1))
    soft = np.abs(sound.mixer.render(rate_hz // 10)).max()
    played.handle(NoteOff(45))
    played.handle(NoteOn(57, 1))
    assert soft < 3 * np.abs(sound.mixer.render(rate_hz // 10)).max()


def test_the_strings_end_with_the_devices_rate_and_new_ones_sound(played: Notes, sound: Any) -> None:
    made = strike(played, NoteOn(45, 60))
    played.handle(Controller(SUSTAIN, 127))
    sound.mixer.render(64)
    sound.mixer = type(sound.mixer)(44_100)
    strike(played, NoteOn(45, 60))
    assert np.abs(sound.mixer.render(4_410)).max() > 1e-4
    played.poll()
    assert made.cut
    assert player_of(played).compiled.channel(0).pedal, "the foot is still on it"


def test_a_preset_that_is_not_there_is_reported(played: Notes, patch: Patch, wait: Wait, reported: list[str]) -> None:
    played.set_instrument(patch.model_copy(update={"preset": "gone"}), EAR)
    wait(lambda: bool(reported))
    assert "gone" in reported[0]
    assert played.handle(NoteOn(45, 60)) is None


def test_a_full_recording_is_reported_once(
    played: Notes, reported: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.playing.recorder.LONGEST_RECORDING", 3)
    played.keys.begin_recording()
    for _ in range(3):
        played.handle(NoteOn(45, 60))
        played.handle(NoteOff(45))
    assert len(played.keys.recorder.end()) == 3
    assert [line for line in reported if "recording is full" in line] == reported
    assert len(reported) == 1


def test_the_pick_up_through_which_it_is_heard_is_recorded(played: Notes, patch: Patch) -> None:
    played.keys.begin_recording()
    played.handle(NoteOn(45, 60))
    played.listen(Ear((0.1, 0.2), "velocity"))
    turned = [each.event.patch.pickup for each in played.keys.recorder.end() if isinstance(each.event, PatchTurned)]
    assert [(each.points, each.kind) for each in turned] == [
        (EAR.points, EAR.pickup),
        ((0.1, 0.2), "velocity"),
    ]


class TurnedClock:
    """Frames are taken by each reader: by the playback, in its thread."""

    def __init__(self, sound: Any) -> None:
        self._sound, self.buffer_s, self.heard = sound, 0.0, list[np.ndarray]()

    @property
    def mixer(self) -> Mixer:
        self.heard.append(self._sound.mixer.render(100))
        mixer: Mixer = self._sound.mixer
        return mixer


@pytest.mark.parametrize("late_s", [0.0, 0.04])
def test_the_notes_of_a_file_begin_with_their_frames(
    played: Notes, sound: Any, monkeypatch: pytest.MonkeyPatch, late_s: float
) -> None:
    """Exactly, model and truth, also where Python is late and keys are struck again."""
    times_s = [0.0, 0.0101, 0.05, 0.1, 0.1, 0.15003, 0.2]
    keys = [45, 52, 57, 45, 60, 45, 52]
    made: list[KeyNote] = []
    ended = Event()

    def handle(event: Any, due: Due | None) -> None:
        if len(made) in (2, 5):
            sound.mixer.render(round(late_s * 48_000))
        played.look()  # as the window's timer does
        if isinstance(found := played.handle(event, due), KeyNote):
            made.append(found)

    playback = Playback(handle, TurnedClock(sound), played.cancel, ended.set)
    playback.play([TimedEvent(t, NoteOn(key, 90)) for t, key in zip(times_s, keys, strict=True)])
    assert ended.wait(30)
    sound.mixer.render(4_800)
    played.look()
    begins = [note.began_frame for note in made]
    assert all(begins)
    assert [each - begins[0] for each in begins] == [round(t * 48_000) for t in times_s]


def test_releases_and_bends_of_a_file_count_at_their_frames(played: Notes, sound: Any, patch: Patch) -> None:
    """As if each had come at its time; the first of them when all have been handed over."""
    begin, events = (
        1_024,
        (NoteOn(45, 90), Bend(0.5), Bend(1.0), NoteOff(45), NoteOn(45, 60), Controller(SOUND_OFF, 0)),
    )
    frames = (0, 4_800, 9_600, 14_400, 17_280, 24_000)
    for frame, event in zip(frames, events, strict=True):
        played.handle(event, Due(sound.mixer, begin + frame, 0.0))
    assert sound.mixer.frames == 64
    heard = sound.mixer.render(begin - 64 + 28_800)[begin - 64 :, 0]
    mixer = Mixer(48_000)
    player = InstrumentPlayer(patch, player_of(played).preset, 48_000, {"model": 1.0, "truth": 0.0}, EAR)
    mixer.set_player(player.compiled)
    mixer.render(begin)
    expected = []
    for frame, event, end in zip(frames, events, (*frames[1:], 28_800), strict=True):
        if isinstance(event, Controller):  # it fades in 20 ms, where one at once fades in 30
            player.stop(FADE_S)
        else:
            player.handle(event)
        expected.append(mixer.render(end - frame)[:, 0])
    np.testing.assert_allclose(heard, np.concatenate(expected), atol=1e-6)


def test_a_file_that_is_stopped_ends_what_was_handed_over(
    played: Notes, sound: Any, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 1_000.0
    monkeypatch.setattr(recorder, "time", SimpleNamespace(monotonic=lambda: now_s))
    ringing = strike(played, NoteOn(45, 90))
    sound.mixer.render(4_800)
    played.keys.begin_recording()
    soon = Due(sound.mixer, sound.mixer.frames + 2_000, now_s + 0.04)
    later = [strike(played, NoteOn(key, 127), soon) for key in (45, 50)]
    played.cancel()
    played.handle(Controller(NOTES_OFF, 0))
    sound.mixer.render(2_000)
    played.look()
    assert all(each.over and each.began_frame == 0 for each in later)
    assert now(played, ringing).damped, "it has its place again"
    assert not ringing.over
    now_s += 1.0
    assert NoteOn(50, 127) not in [each.event for each in played.keys.recorder.end()]
    sound.mixer.render(24_000)
    assert np.abs(sound.mixer.render(4_800)).max() < 1e-4


def test_a_note_that_waits_and_is_released_never_begins_and_others_do(played: Notes, sound: Any) -> None:
    soon = Due(sound.mixer, sound.mixer.frames + 2_000, 0.0)
    one, other = (strike(played, NoteOn(key, 90), soon) for key in (45, 50))
    one.release(0.01)
    sound.mixer.render(4_800)
    played.look()
    assert one.over and not one.began_frame
    assert other.began_frame == soon.frame
    other.release_at(sound.mixer.frames + 1_000)
    other.release_at(0)
    sound.mixer.render(9_600)
    played.look()
    assert not other.over
    other.release_at(sound.mixer.frames + 1_000)
    sound.mixer.render(4_800)
    played.look()
    assert other.over


def test_notes_end_though_their_reports_were_missed(played: Notes, sound: Any) -> None:
    """A window that hangs while a dense file is played asks too late."""
    notes = []
    for number in range(of.REPORTS):
        notes.append(played.handle(NoteOn(45 + number % 20, 90)))
        sound.mixer.render(64)
    sound.mixer.render(4_800)
    played.poll()
    ringing = {each.id for each in seen(player_of(played))}
    assert all(isinstance(note, KeyNote) and note.over == (note.id not in ringing) for note in notes)
    assert 0 < played.ringing <= 20
    played.stop()
    sound.mixer.render(4_800)
    played.poll()
    assert played.ringing == 0


def test_a_key_that_is_struck_while_its_next_note_waits_sounds_at_once(played: Notes, sound: Any) -> None:
    """And again when that is due."""
    soon = Due(sound.mixer, sound.mixer.frames + 2_000, 0.0)
    waits, struck = strike(played, NoteOn(45, 90), soon), strike(played, NoteOn(45, 90))
    sound.mixer.render(1_000)
    played.look()
    assert struck.began_frame == 64
    assert not waits.began_frame
    sound.mixer.render(4_800)
    played.look()
    assert waits.began_frame == soon.frame and struck.over


def test_of_another_device_an_event_counts_at_once(played: Notes, sound: Any) -> None:
    gone = Due(Mixer(48_000), 10_000_000, 0.0)
    made = strike(played, NoteOn(45, 90), gone)
    played.handle(NoteOff(45), gone)
    assert made.begin_frame == 0
    sound.mixer.render(64)
    played.look()
    assert made.began_frame == 64


def test_a_recording_forgets_the_turn_of_a_loop_that_never_came(
    played: Notes, sound: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 1_000.0
    monkeypatch.setattr(recorder, "time", SimpleNamespace(monotonic=lambda: now_s))
    played.keys.begin_recording()
    turn, other = NoteOn(45, 90, pluck=Pluck(0.3, 2.0)), NoteOn(50, 90)
    for event in (turn, other):
        played.handle(event, Due(sound.mixer, 48_000, now_s + 0.2))
    played.keys.recorder.cancel(turn)
    now_s += 0.3
    found = [each.event for each in played.keys.recorder.end() if isinstance(each.event, NoteOn)]
    assert found == [other]


def test_a_recording_has_the_events_of_a_file_when_they_are_heard(
    played: Notes, sound: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 1_000.0
    monkeypatch.setattr(recorder, "time", SimpleNamespace(monotonic=lambda: now_s))
    played.keys.begin_recording()
    for key, after_s in ((45, 0.2), (50, 0.25), (62, 60.0)):
        played.handle(NoteOn(key, 90), Due(sound.mixer, round(48_000 * after_s), now_s + after_s))
    played.handle(NoteOn(57, 90))
    now_s += 0.3
    found = played.keys.recorder.end()
    notes = {each.event.key: each.time_s for each in found if isinstance(each.event, NoteOn)}
    assert list(notes) == [57, 45, 50], "in their order; the last is not due yet"
    assert notes[50] - notes[45] == pytest.approx(0.05)
    assert {each.event.key for each in found if isinstance(each.event, NoteOff)} == {45, 50, 57}


def test_after_a_file_that_was_stopped_within_a_bend_keys_are_in_tune(played: Notes, wait: Wait) -> None:
    playback = Playback(played.handle, played, played.cancel)
    bent = [TimedEvent(0.0, NoteOn(45, 60)), TimedEvent(0.0, Bend(1.0)), TimedEvent(600.0, NoteOff(45))]
    playback.play(bent)

    def bend() -> float:
        played.mixer.render(64)
        return player_of(played).compiled.channel(0).bend

    wait(lambda: bend() == 1.0)
    playback.stop()
    for channel in (0, KEYS):
        struck = now(played, strike(played, NoteOn(57, 60, channel)))
        assert struck.now == struck.own


def test_a_patch_that_is_kept_beside_a_single_string_sounds_when_it_is_played_again_and_not_before(
    played: Notes, patch: Patch
) -> None:
    played.set_instrument(SingleString(preset="gone"), EAR, patch)
    assert played.handle(NoteOn(45, 60)) is None
    assert played.handle(NoteOff(45)) is None
    played.set_instrument(patch, EAR)
    strike(played, NoteOn(45, 60))


def test_drums_that_are_left_before_they_are_computed_keep_nobody_waiting(
    played: Notes, patch: Patch, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, held, computed = Event(), Event(), list[int]()

    def slow(self: DrumKeys, key: int) -> None:
        computed.append(key)
        begun.set()
        held.wait(30)

    monkeypatch.setattr(DrumKeys, "_of_key", slow)
    played.set_instrument(read_patch(PATCHES / "tuned_toms.json"), EAR)
    wait(begun.is_set)
    played.set_instrument(patch, EAR)
    held.set()
    wait(lambda: played.keys.player is not None and played.keys.player.patch == patch)
    assert len(computed) == 1
    strike(played, NoteOn(45, 60))


@pytest.mark.parametrize("loaded", [True, False])
@pytest.mark.parametrize(
    ("down", "up"), [((), NoteOff(45)), ((Controller(SUSTAIN, 127), NoteOff(45)), Controller(SUSTAIN, 0))]
)
def test_what_is_let_go_after_another_instrument_was_chosen_is_damped(
    played: Notes, wait: Wait, down: tuple[NoteOff | Controller, ...], up: NoteOff | Controller, loaded: bool
) -> None:
    held = strike(played, NoteOn(45, 60))
    for event in down:
        played.handle(event)
    assert not now(played, held).damped
    played.set_instrument(read_patch(PATCHES / "frame_drum.json"), EAR)
    if loaded:
        wait(lambda: played.keys.player is not None)
    played.handle(up)
    assert now(played, held).damped


def test_switches_hold_for_another_instruments_player_too(played: Notes, patch: Patch, wait: Wait) -> None:
    switches = [Controller(number, 127, KEYS) for number in (LEGATO, TREMOLO)]
    for event in (*switches, Controller(STRUM, 127), Controller(RESET, 0)):
        played.handle(event)
    for other in (read_patch(PATCHES / "frame_drum.json"), patch):
        played.set_instrument(other, EAR)
        wait(lambda other=other: played.keys.player is not None and played.keys.player.patch == other)
    player = played.keys.player
    assert player is not None
    player.compiled.catch_up(played.mixer.address)
    assert player.at_hand == switches
