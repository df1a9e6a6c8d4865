"""The keys of an instrument, played by events, in a mixer whose frames the test takes."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from threading import Event, Thread
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.instruments.instrument import BodyChoice, Instrument
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.compiled import InstrumentPlayer
from app.player.effects import body_curves
from app.player.events import Bend, ControlChange, InstrumentTurned, NoteOff, NoteOn, parameter_set
from app.playing import recorder
from app.playing.key_note import KeyNote
from app.playing.notes import Notes
from app.playing.playback import Due
from app.playing.recorder import EventRecorder
from app.playing.sources import Sources
from engine.effects import Effects
from engine.kernels import constants as of
from engine.kernels import midi
from engine.pluck import Pluck
from engine.values.ear import Ear
from engine.voices import Mixer
from engine.voices.voice import FADE_S
from tests.app.monitors import find_shipped, hears
from tests.app.player.seen import Seen, seen, taken_up

Wait = Callable[[Callable[[], bool]], None]
EAR = Ear((0.3,))
FRAME_DRUM, HARP = (read_instrument(INSTRUMENTS / f"{name}.json") for name in ("frame_drum", "concert_harp"))
SHIPPED = read_instrument(INSTRUMENTS / "steel_string_acoustic.json")
INSTRUMENT = SHIPPED.model_copy(  # its other strings stay silent, so that silence can be heard
    update={"body": BodyChoice(), "sympathy_s_kg": 0.0, "pluck": SHIPPED.pluck.model_copy(update={"variation": 0.0})}
)


class Played:
    """Notes whose keys play an instrument, with what they report and which effects they ask for."""

    def __init__(self, sound: Any, wait: Wait) -> None:
        self.sound, self.wait = sound, wait
        self.reported: list[str] = []
        self.effects: list[Effects | None] = []
        report = lambda message, details: self.reported.append(message)  # noqa: E731
        self.notes = Notes(sound, Sources(), find_shipped, report, self.effects.append)
        self.notes.set_monitor(hears("model"))
        self.keys, self.handle = self.notes.keys, self.notes.handle
        self.choose(INSTRUMENT)

    def choose(self, instrument: Instrument, single: str | None = None) -> None:
        """Another instrument, and wait until its keys sound and its effects are set."""
        self.notes.set_instrument(instrument, EAR, single)
        if single is None:
            self.wait(lambda: self.keys.player is not None and self.keys.player.instrument == instrument)
        self.settle()

    def settle(self) -> None:
        """Until what was asked for is done."""
        done = Event()
        self.notes.in_background(done.set)
        self.wait(done.is_set)

    @property
    def player(self) -> InstrumentPlayer:
        assert self.keys.player is not None
        return self.keys.player

    def strike(self, event: NoteOn, due: Due | None = None) -> KeyNote:
        """The note of a key, which the player has taken up."""
        note = self.handle(event, due)
        assert isinstance(note, KeyNote)
        note.player.compiled.catch_up(self.sound.mixer.address)
        self.notes.look()
        return note

    def now(self, note: KeyNote) -> Seen:
        """It, as it rings."""
        return next(each for each in taken_up(note.player, self.sound.mixer) if each.id == note.id)

    def hear(self, frames: int) -> np.ndarray:
        heard: np.ndarray = self.sound.mixer.render(frames)[:, 0]
        self.notes.poll()
        return heard

    def soon(self, frames: int = 2_000) -> Due:
        return Due(self.sound.mixer, self.sound.mixer.frames + frames, 0.0)

    def recorded(self) -> list[Any]:
        return [each.event for each in self.keys.recorder.end()]


@pytest.fixture
def played(sound: Any, wait: Wait) -> Iterator[Played]:
    made = Played(sound, wait)
    yield made
    made.notes.close()


def test_a_note_that_slides_is_reported_on_its_string_with_where_it_is_stopped(played):
    for number, value in ((midi.LEGATO, 127), (midi.PORTAMENTO, 127), (midi.SLIDE_TIME, 64)):
        played.handle(ControlChange(number, value))
    places = []
    for key, string, looks in ((43, -1, 10), (52, 5, 40)):  # of the lowest string, where others have it too
        played.handle(NoteOn(key, 100))
        for _ in range(looks):
            played.hear(480)
            (note,) = played.keys.sounding_notes()
            assert (note.key, note.string) == (key, string)
            places.append(note.key + note.slid)
    assert places[:10] == pytest.approx([43.0] * 10, abs=0.05) and places[10] < 47
    assert places[10:] == sorted(places[10:]) and places[-1] == pytest.approx(52, abs=0.1)
    assert sum(43.5 < place < 51.5 for place in places) > 3


def test_a_stop_ends_strings_that_ring_in_sympathy_too(played):
    played.choose(HARP.model_copy(update={"sympathy_s_kg": 1e-3}))
    for _ in range(2):  # they ring again with the next note
        played.strike(NoteOn(sum(HARP.range) // 2, 120))
        assert np.abs(played.hear(24_000)).max() > 1e-3
        assert played.player.compiled.record["sympathy"]["rings"]
        played.notes.stop()
        played.hear(4_800)
        assert np.abs(played.hear(4_800)).max() < 1e-6


def test_a_key_waits_for_no_knob(played, monkeypatch):
    begun, held, struck = Event(), Event(), list[object]()

    def slow(*args: Any) -> Any:
        begun.set()
        held.wait(30)
        return body_curves(*args)

    monkeypatch.setattr("app.player.strings.body_curves", slow)
    knob = Thread(target=played.notes.set_instrument, args=(INSTRUMENT.with_value("body.size", 1.3), EAR))
    key = Thread(target=lambda: struck.append(played.handle(NoteOn(52, 60))))
    knob.start()
    played.wait(begun.is_set)
    key.start()
    key.join(20)
    came = list(struck)
    held.set()
    knob.join()
    key.join()
    assert isinstance(came[0], KeyNote)


def test_the_last_of_many_turns_counts(played):
    struck = played.strike(NoteOn(45, 60))
    before = played.now(struck).now
    played.keys.begin_recording()
    for stiffness in np.linspace(1.1, 3.0, 20):
        played.notes.set_instrument(INSTRUMENT.with_value("knobs.stiffness", float(stiffness)), EAR)
    played.notes.listen(Ear((0.1, 0.2), "velocity"))
    made = played.strike(NoteOn(50, 60))
    assert made.ear.points == (0.1, 0.2) and made.instrument.knobs.stiffness == 3.0
    assert made.pluck is not None and made.pluck.position == INSTRUMENT.pluck.position
    played.settle()
    assert played.now(struck).now.second_moment_m4 == pytest.approx(3 * before.second_moment_m4)
    exact = played.player
    fresh = InstrumentPlayer(exact.instrument, exact.preset, 48_000, {"model": 1.0}, exact.ear)
    fresh.handle(NoteOn(45, 60))
    fresh.compiled.catch_up(Mixer(48_000).address)
    assert played.strike(NoteOn(45, 60)).gain == fresh.compiled.reports()[0].gain
    last = [event for event in played.recorded() if isinstance(event, InstrumentTurned)][-1].instrument
    assert (last.knobs.stiffness, last.pickup.points, last.pickup.kind) == (3.0, (0.1, 0.2), "velocity")


@pytest.mark.parametrize(
    ("part", "value", "reported"),
    [
        ("tuning", INSTRUMENT.tuning.model_copy(update={"scale": "no scale"}), "no scale"),
        ("preset", "gone", "gone"),
        ("body", BodyChoice(name="a cello", mix=0.3), "is played without its body: the body a cello is not here"),
    ],
)
def test_an_instrument_that_cannot_be_played_is_reported_once(played, part, value, reported):
    made = played.strike(NoteOn(45, 60))
    played.notes.set_instrument(INSTRUMENT.model_copy(update={part: value}), EAR)
    played.settle()
    played.notes.listen(Ear((0.1,)))
    played.settle()
    (words,) = played.reported
    assert reported in words and all(each is None or each.body is None for each in played.effects)
    if part == "preset":
        assert played.handle(NoteOn(45, 60)) is None
    else:
        again = played.strike(NoteOn(45, 60))
        assert (again.parameters, again.ear) == (made.parameters, Ear((0.1,)))


def test_an_instrument_that_is_left_before_it_is_loaded_does_not_come_back(played):
    held = Event()
    played.notes.set_instrument(None, EAR, "")
    played.notes.in_background(lambda: held.wait(30) and None)
    played.notes.set_instrument(INSTRUMENT, EAR)
    played.notes.set_instrument(None, EAR, "")
    held.set()
    played.settle()
    assert played.keys.player is None
    played.choose(INSTRUMENT, "gone")
    assert played.handle(NoteOn(45, 60)) is None and played.handle(NoteOff(45)) is None
    played.choose(INSTRUMENT)
    played.strike(NoteOn(45, 60))


@pytest.mark.parametrize("loaded", [True, False])
@pytest.mark.parametrize("pedal", [True, False])
def test_what_is_let_go_after_another_instrument_was_chosen_is_damped(played, pedal, loaded):
    held = played.strike(NoteOn(45, 60))
    for event in (ControlChange(midi.SUSTAIN, 127), NoteOff(45)) if pedal else ():
        played.handle(event)
    assert not played.now(held).damped
    played.notes.set_instrument(FRAME_DRUM, EAR)
    if loaded:
        played.choose(FRAME_DRUM)
    played.handle(ControlChange(midi.SUSTAIN, 0) if pedal else NoteOff(45))
    assert played.now(held).damped


def test_effects_are_set_once_turned_by_the_wheel_and_off_where_models_are_compared(played):
    del played.effects[:]
    wooden = INSTRUMENT.model_copy(update={"body": BodyChoice(name="guitar", mix=0.4), "mod_wheel": "room.mix"})
    for _ in range(2):
        played.choose(wooden)
    (effects,) = played.effects
    assert effects is not None and effects.body is not None
    assert (effects.body.name, effects.body.mix) == ("guitar", 0.4)
    for value, mix in ((127, 1.0), (0, INSTRUMENT.room.mix)):
        played.handle(ControlChange(midi.MOD_WHEEL, value))
        played.settle()
        effects = played.effects[-1]
        assert effects is not None and (effects.room.mix if effects.room else 0.0) == pytest.approx(mix)
    for dry in (True, False):
        played.notes.set_blind_test(dry)
        played.settle()
        assert (played.effects[-1] is None) == dry
    for single in ("", None):
        played.choose(wooden, single)
        assert (played.effects[-1] is None) == (single == "")


@pytest.mark.parametrize(("rate_hz", "channels"), [(48_000, 1), (44_100, 2)])
def test_keys_go_out_while_the_output_stands_and_with_another_device(played, monkeypatch, rate_hz, channels):
    made = played.strike(NoteOn(45, 127))
    played.handle(ControlChange(midi.SUSTAIN, 127))
    played.hear(4_800)
    assert played.keys.sounding()
    with monkeypatch.context() as standing:
        standing.setattr("app.playing.keys.STANDS_S", 0.0)
        assert played.keys.sounding() == {}  # no frame since
    played.hear(4_800)
    assert played.keys.sounding()
    played.sound.mixer = Mixer(rate_hz, channels)
    played.notes.poll()
    assert played.keys.sounding() == {} and made.over
    played.handle(NoteOn(45, 1))
    soft = np.abs(played.hear(rate_hz // 10)).max()
    played.handle(NoteOn(57, 1))
    assert 1e-6 < soft < 3 * np.abs(played.hear(rate_hz // 10)).max()
    assert played.player.compiled.channel(0).pedal, "the foot is still on it"


def test_notes_end_though_their_reports_were_missed(played):
    """A window that hangs while a dense file is played asks too late."""
    notes = []
    for number in range(of.REPORTS):
        notes.append(played.handle(NoteOn(45 + number % 20, 90)))
        played.sound.mixer.render(64)
    played.hear(4_800)
    ringing = {each.id for each in seen(played.player)}
    assert all(isinstance(note, KeyNote) and note.over == (note.id not in ringing) for note in notes)
    assert 0 < played.notes.ringing <= 20


def test_releases_and_bends_of_a_file_count_at_their_frames(played):
    off, begin = ControlChange(midi.SOUND_OFF, 0), 1_024
    events = (NoteOn(45, 90), Bend(0.5), Bend(1.0), NoteOff(45), NoteOn(45, 60), off)
    frames = (0, 4_800, 9_600, 14_400, 17_280, 24_000)
    for frame, event in zip(frames, events, strict=True):
        played.handle(event, Due(played.sound.mixer, begin + frame, 0.0))
    heard = played.hear(begin - 64 + 28_800)[begin - 64 :]
    mixer, expected = Mixer(48_000), []
    player = InstrumentPlayer(INSTRUMENT, played.player.preset, 48_000, {"model": 1.0, "truth": 0.0}, EAR)
    mixer.set_player(player.compiled)
    mixer.render(begin)
    for frame, event, end in zip(frames, events, (*frames[1:], 28_800), strict=True):
        if event is off:  # it fades in 20 ms, where one at once fades in 30
            player.stop(FADE_S)
        else:
            player.handle(event)
        expected.append(mixer.render(end - frame)[:, 0])
    np.testing.assert_allclose(heard, np.concatenate(expected), atol=1e-6)


def test_a_note_that_waits_and_is_released_never_begins_and_others_do(played):
    soon = played.soon()
    one, other = (played.strike(NoteOn(key, 90), soon) for key in (45, 50))
    at_once = played.strike(NoteOn(50, 90))
    one.release(0.01)
    played.hear(1_000)
    assert at_once.began_frame == 64 and not other.began_frame
    played.hear(3_800)
    assert one.over and not one.began_frame and other.began_frame == soon.frame and at_once.over
    for release, is_over in ((0, False), (played.sound.mixer.frames + 10_600, True)):
        other.release_at(played.sound.mixer.frames + 1_000)
        if not release:
            other.release_at(0)
        played.hear(9_600)
        assert other.over == is_over


# Recordings


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The recorder's time, which stands until the test moves it."""
    made = SimpleNamespace(now_s=1_000.0)
    monkeypatch.setattr(recorder, "time", SimpleNamespace(monotonic=lambda: made.now_s))
    return made


def test_a_recording_begins_with_its_first_note_and_ends_as_the_hands_are(played):
    played.keys.begin_recording()
    assert played.recorded() == []
    for event in (ControlChange(midi.SUSTAIN, 127), Bend(0.5), *parameter_set(0, 12, 0, 0)):
        played.handle(event)
    played.strike(NoteOn(50, 60))
    played.keys.begin_recording()
    for event in (NoteOn(45, 60), NoteOff(45), NoteOn(52, 60)):
        played.handle(event)
    timed, heard, mixer = played.keys.recorder.end(), played.player, Mixer(48_000)
    events = [each.event for each in timed]
    assert (
        isinstance(events[0], InstrumentTurned) and next(e.time_s for e in timed if isinstance(e.event, NoteOn)) == 0
    )
    assert (events[0].instrument.pickup.points, events[0].instrument.pickup.kind) == (EAR.points, EAR.pickup)
    assert events[-2:] == [ControlChange(midi.SUSTAIN, 0), NoteOff(52)]
    again = InstrumentPlayer(heard.instrument, heard.preset, 48_000, {"model": 1.0, "truth": 0.0}, heard.ear)
    for event in events[:-2]:
        again.handle(event)
    as_heard = {each.key: each.now for each in taken_up(heard, played.sound.mixer)}
    struck = taken_up(again, mixer)
    assert {each.key: each.now for each in struck} == {key: as_heard[key] for key in (45, 52)}
    assert not any(each.damped for each in struck) and struck[0].now.tension_n > struck[0].own.tension_n


def test_what_comes_after_the_end_of_a_recording_is_not_fetched(monkeypatch):
    now_s = 100.0
    monkeypatch.setattr("app.playing.recorder.time.monotonic", lambda: now_s)
    recorder = EventRecorder(lambda *_: None)
    recorder.begin([NoteOn(60, 90)])
    for time_s, key in ((100.5, 62), (103.0, 64)):
        recorder.take(NoteOn(key, 90), time_s)
    now_s = 101.0
    recorder.end()
    now_s = 110.0
    assert [(entry.time_s, entry.event.key) for entry in recorder.fetch()] == [(0.0, 60), (0.5, 62)]
    assert recorder.fetch() == [] and recorder.ended_s == 1.0


def test_a_full_recording_is_reported_once(played, monkeypatch):
    monkeypatch.setattr("app.playing.recorder.LONGEST_RECORDING", 3)
    played.keys.begin_recording()
    for _ in range(3):
        played.handle(NoteOn(45, 60))
        played.handle(NoteOff(45))
    assert len(played.recorded()) == 3
    assert len(played.reported) == 1 and "recording is full" in played.reported[0]


def test_a_recording_has_the_events_of_a_file_when_they_are_heard(played, clock):
    played.keys.begin_recording()
    loop = NoteOn(64, 90, pluck=Pluck(0.3, 2.0))
    for event, after_s in ((NoteOn(45, 90), 0.2), (loop, 0.2), (NoteOn(50, 90), 0.25), (NoteOn(62, 90), 60.0)):
        played.handle(event, Due(played.sound.mixer, round(48_000 * after_s), clock.now_s + after_s))
    played.handle(NoteOn(57, 90))
    played.keys.recorder.cancel(loop)
    clock.now_s += 0.3
    found = played.keys.recorder.end()
    notes = {each.event.key: each.time_s for each in found if isinstance(each.event, NoteOn)}
    assert list(notes) == [57, 45, 50] and notes[50] - notes[45] == pytest.approx(0.05)
    assert {each.event.key for each in found if isinstance(each.event, NoteOff)} == {45, 50, 57}


def test_a_file_that_is_stopped_ends_what_was_handed_over(played, clock):
    ringing = played.strike(NoteOn(45, 90))
    played.hear(4_800)
    played.keys.begin_recording()
    soon = replace(played.soon(), time_s=clock.now_s + 0.04)
    later = [played.strike(NoteOn(key, 127), soon) for key in (45, 50)]
    played.notes.cancel()
    played.handle(ControlChange(midi.NOTES_OFF, 0))
    played.hear(2_000)
    assert all(each.over and each.began_frame == 0 for each in later)
    assert played.now(ringing).damped and not ringing.over
    clock.now_s += 1.0
    assert NoteOn(50, 127) not in played.recorded()
    played.hear(24_000)
    assert np.abs(played.hear(4_800)).max() < 1e-4
