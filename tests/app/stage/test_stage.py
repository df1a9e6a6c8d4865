"""The stage after each event, and steps of undo: gestures in plain words; what is only looked at is none."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.instruments.instrument import ASSIGNABLE, Instrument
from app.instruments.library import SHIPPED, read_instrument
from app.player.strings import Strings
from app.playing.note import PluckVoices
from app.rendering import NoteSound
from app.session.choices import OBSERVED, Choices
from app.stage.session import GATHER_S, RECORDED, Session
from app.stage.stage import Asked, Begun, Chosen, Parked, Rendered, Turned, first_stage, next_stage
from app.stage.step_words import step_words
from engine.parameters import OF_INSTRUMENTS
from engine.pluck import Pluck
from engine.values.ear import Ear


class Hand:
    """A session with its history, and the time in s at which its changes come."""

    def __init__(self) -> None:
        self.now_s = 10.0
        self.session = Session(now_s=lambda: self.now_s)

    def change(self, after_s: float = 0.0, **choices: object) -> None:
        self.now_s += after_s
        self.session.update(**choices)

    def undone(self, field: str) -> list[object]:
        """The values of a field after each step back, until there is none."""
        values = []
        while self.session.undo_words:
            self.session.undo()
            values.append(self.session.choices.value(field))
        return values


@pytest.fixture
def hand() -> Hand:
    return Hand()


@pytest.fixture(scope="module")
def guitar() -> Instrument:
    return read_instrument(SHIPPED / "classical_guitar.json")


def test_whatever_a_knob_turns_has_words_and_a_macro_its_name(guitar):
    for field in set(ASSIGNABLE) - {"pickup.points.1"}:
        value = guitar.value(field)
        for turned in (0.9 * value + 0.011, 0.9 * value - 0.011):
            try:
                words = step_words({"instrument": guitar}, {"instrument": guitar.with_value(field, turned)})
            except ValueError:
                continue
            assert words == ("listening point" if field.startswith("pickup.") else OF_INSTRUMENTS[field].name)
    macro = {"name": "Damp", "value": 0.5, "targets": ({"field": "knobs.decay", "low": 1.0, "high": 3.0},)}
    instrument = Instrument.model_validate({**dict(guitar), "macros": (macro,)})
    assert step_words({"instrument": instrument}, {"instrument": instrument.turned(0, 0.9)}) == "Damp"


def test_back_and_forth_to_the_very_choices_and_no_further(hand):
    start = hand.session.choices
    hand.change(position=0.5, amplitude_mm=2)
    middle = hand.session.choices
    hand.change(1, shape="triangular")
    end = hand.session.choices
    for act, states in ((hand.session.undo, (middle, start, start)), (hand.session.redo, (middle, end, end))):
        for state in states:
            act()
            assert hand.session.choices == state
    hand.session.undo()
    hand.change(width=0.3)
    assert not hand.session.redo_words, "a new change forgets what was undone"
    assert hand.undone("width") == [0.06, 0.06]


def test_notches_of_one_field_are_one_step_until_half_a_second_passes(hand):
    for position in (0.4, 0.41, 0.42):
        hand.change(0.9 * GATHER_S, position=position)
    hand.change(2 * GATHER_S, position=0.6)
    hand.change(width=0.2)  # another field: another step
    hand.change(position=0.7)
    assert hand.undone("position") == [0.6, 0.6, 0.42, 0.35]


def test_a_drag_is_one_step_however_long_and_one_back_to_its_start_is_none(hand):
    for positions in ((0.4, 0.41, 0.44), (0.6, 0.5), (0.7, 0.5)):
        hand.session.hold()
        for moved, position in enumerate(positions):
            hand.change(3, position=position, amplitude_mm=4 + moved % 2)
        hand.change(amplitude_mm=4)
        hand.session.release()
    assert hand.undone("position") == [0.44, 0.35]


def test_what_is_only_seen_or_heard_is_neither_recorded_nor_taken_back(hand):
    seen = {"heard": "b", "loop": True, "speed": 1, "left_view": "x", "motion": False, "envelope": False}
    hand.change(volume_db=-6, **seen)
    assert not hand.session.undo_words
    hand.change(position=0.6)
    hand.change(volume_db=-9)
    hand.session.undo()
    assert hand.session.choices == Choices(volume_db=-9, **seen)  # type: ignore[arg-type]
    assert set(OBSERVED) > RECORDED


def test_a_played_note_is_no_step_and_stays_when_the_step_before_it_is_undone(hand):
    session = hand.session

    def state() -> tuple[float, float, float]:
        pluck = session.choices.pluck
        return pluck.width, pluck.position, pluck.amplitude_mm

    session.play(position=0.2, amplitude_mm=6)
    assert not session.undo_words
    hand.change(width=0.2)
    session.play(position=0.7, amplitude_mm=2)
    session.undo()
    assert (state(), session.undo_words) == ((0.06, 0.7, 2), "")
    session.play(position=0.3)
    session.redo()  # a note forgets nothing of what was undone
    assert state() == (0.2, 0.3, 2)
    session.hold()
    hand.change(position=0.5, amplitude_mm=3)
    session.play(position=0.9)  # played while the knob is in the other hand
    hand.change(amplitude_mm=5)
    session.release()
    session.undo()
    assert state() == (0.2, 0.3, 2), "back to where the note was"


def pickup_of(session: Session) -> tuple[object, ...]:
    choices = session.choices
    return choices.stereo, choices.pickup, choices.listen, choices.instrument and choices.instrument.pickup


def test_what_is_played_and_where_it_is_heard_are_steps(hand, guitar):
    session = hand.session
    session.update(played=guitar)
    own = pickup_of(session)
    states, words = [own], []
    changes = ({"pickup_kind": "velocity"}, {"stereo": not session.choices.stereo}, {"listen": 0.11})
    for change in changes:
        hand.change(1, **change)
        states.append(pickup_of(session))
        words.append(session.undo_words)
    hand.change(listen=0.12)  # at once: the same step
    states[-1] = pickup_of(session)
    assert words == ["pick-up", "stereo", "listening point"]
    for there, act in ((states[-2::-1], session.undo), (states[1:], session.redo), (states[-2::-1], session.undo)):
        for state in there:
            act()
            assert pickup_of(session) == state
    hand.now_s += 1
    session.play_string()
    session.undo()
    assert session.choices.plays_instrument and pickup_of(session) == own


def test_each_way_the_next_step_is_named_and_two_knobs_are_two_however_quick(hand, guitar):
    hand.change(played=guitar)
    for field, value in (("knobs.decay", 2.0), ("knobs.decay", 3.0), ("knobs.stiffness", 2.0)):
        instrument = hand.session.choices.instrument
        assert instrument is not None
        hand.change(instrument=instrument.with_value(field, value))
    hand.session.play(position=0.2)
    hand.change(position=0.5)
    words = []
    while hand.session.undo_words:
        words.append(hand.session.undo_words)
        hand.session.undo()
        assert hand.session.redo_words == words[-1]
    assert words == ["pluck position", "stiffness", "decay", "instrument Classical guitar"]


HARP, GUITAR = (read_instrument(SHIPPED / f"{name}.json") for name in ("concert_harp", "classical_guitar"))
REQUEST = NoteSound(Path("one"), Pluck(0.3), 1.0, Ear((0.2,)))


def note(request: NoteSound = REQUEST, from_s: float = 0.0) -> Any:
    return PluckVoices(request, ("model",), from_s)


def test_an_instrument_has_its_own_string_until_another_is_chosen_with_it():
    stage = first_stage(Choices(single="one"))
    for instrument in (HARP, GUITAR):
        stage = next_stage(stage, Chosen({"played": instrument}))
        string = Strings(instrument).of_key(sum(instrument.range) // 2)
        assert string is not None and stage.choices.string == string.parameters
    low = Strings(HARP).of_key(43)
    assert low is not None
    stage = next_stage(stage, Chosen({"played": HARP, "string": low.parameters, "position": 0.2}))
    assert (stage.choices.string, stage.choices.pluck.position, stage.key) == (low.parameters, 0.2, (43, None))


def test_the_playhead_follows_the_note_of_the_motion_until_it_is_parked():
    take: Any = SimpleNamespace(seconds=1.0)
    first, second = note(), note(from_s=0.4)
    stage = next_stage(first_stage(Choices(single="one")), Begun(first))
    stage = next_stage(next_stage(stage, Asked(REQUEST)), Rendered(take))
    assert stage.lead is first and stage.moving and stage.choices.pluck.position == 0.3
    parked = next_stage(stage, Parked(0.7))
    assert next_stage(parked, Asked(REQUEST)).position_s(0.1) == 0.7 and not parked.audible
    turned = next_stage(parked, Turned(second))
    assert turned.lead is second and turned.position_s(0.1) == 0.4
    other = NoteSound(Path("one"), Pluck(0.6), 1.0, REQUEST.ear)
    assert next_stage(turned, Asked(other)).ready is False, "another motion is awaited"
    assert next_stage(turned, Begun(note(other))).lead is second, "its motion is another"
