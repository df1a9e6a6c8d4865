"""Steps of undo are gestures; what is only looked at is none."""

from __future__ import annotations

import pytest

from app.patches.library import SHIPPED, read_patch
from app.session.choices import Choices, Session
from app.session.history import GATHER_S, LARGEST_STEPS, RECORDED, History


class Clock:
    def __init__(self) -> None:
        self.now_s = 10.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


def positions_back(history: History, session: Session) -> list[float]:
    seen = []
    while history.undo_words:
        history.undo()
        seen.append(session.choices.position)
    return seen


def test_back_and_forth_to_the_very_choices(clock: Clock) -> None:
    session = Session()
    history, start = History(session, clock), session.choices
    assert not history.undo_words
    session.update(position=0.5, amplitude_mm=2)
    clock.now_s += 1
    session.update(shape="triangular")
    end = session.choices
    history.undo()
    assert (session.choices.shape, session.choices.position) == ("gaussian", 0.5)
    history.undo()
    assert session.choices == start
    history.undo()  # nothing more
    assert session.choices == start
    history.redo()
    history.redo()
    assert session.choices == end
    history.redo()
    assert session.choices == end


def test_notches_of_one_field_are_one_step_until_half_a_second_passes(clock: Clock) -> None:
    session = Session()
    history = History(session, clock)
    for position in (0.4, 0.41, 0.42):
        session.update(position=position)
        clock.now_s += 0.9 * GATHER_S
    clock.now_s += GATHER_S
    session.update(position=0.6)
    session.update(width=0.2)  # another field: another step
    session.update(position=0.7)
    assert positions_back(history, session) == [0.6, 0.6, 0.42, 0.35]


def test_a_drag_is_one_step_however_long_and_whatever_it_changes(clock: Clock) -> None:
    session = Session()
    history = History(session, clock)
    for start in (0.4, 0.6):
        history.hold()
        for moved in range(5):
            session.update(position=start + moved / 100, amplitude_mm=4 + moved % 2)
            clock.now_s += 3
        history.release()
    assert positions_back(history, session) == [pytest.approx(0.44), 0.35]


def test_a_drag_back_to_its_start_is_no_step(clock: Clock) -> None:
    session = Session()
    history = History(session, clock)
    session.update(seconds=2)
    history.hold()
    session.update(position=0.6)
    session.update(position=0.35)
    history.release()
    history.undo()
    assert session.choices.seconds == 4


def test_what_is_only_seen_or_heard_is_neither_recorded_nor_taken_back(clock: Clock) -> None:
    session = Session()
    history = History(session, clock)
    session.update(volume_db=-6, heard="b", loop=True, speed=1, left_view="x", motion=False, envelope=False)
    assert not history.undo_words
    session.update(position=0.6)
    session.update(volume_db=-9)
    history.undo()
    assert session.choices == Choices(
        volume_db=-9, heard="b", loop=True, speed=1, left_view="x", motion=False, envelope=False
    )
    assert set(Choices.model_fields) > RECORDED


def test_a_new_change_forgets_what_was_undone(clock: Clock) -> None:
    session = Session()
    history = History(session, clock)
    session.update(position=0.6)
    history.undo()
    session.update(width=0.3)
    assert not history.redo_words
    history.undo()
    assert (session.choices.width, session.choices.position) == (0.06, 0.35)


def test_it_is_bounded(clock: Clock) -> None:
    session = Session()
    history = History(session, clock)
    for step in range(LARGEST_STEPS + 50):
        clock.now_s += 1
        session.update(position=0.3 + step / 1000)
    assert len(positions_back(history, session)) == LARGEST_STEPS


def test_a_played_note_is_no_step_and_stays_when_the_step_before_it_is_undone(clock: Clock) -> None:
    session = Session()
    history = History(session, clock)
    session.play(position=0.2, amplitude_mm=6)
    assert not history.undo_words
    session.update(width=0.2)
    session.play(position=0.7, amplitude_mm=2)
    history.undo()
    choices = session.choices
    assert (choices.width, choices.position, choices.amplitude_mm) == (0.06, 0.7, 2)
    assert not history.undo_words
    session.play(position=0.3)
    history.redo()  # a note forgets nothing of what was undone
    assert (session.choices.width, session.choices.position) == (0.2, 0.3)


def test_a_drag_after_a_note_goes_back_to_where_the_note_was(clock: Clock) -> None:
    session = Session()
    history = History(session, clock)
    session.play(position=0.7)
    history.hold()
    session.update(position=0.6)
    session.update(position=0.5, amplitude_mm=2)
    session.play(position=0.3)  # played while the knob is in the other hand
    session.update(amplitude_mm=3)
    history.release()
    history.undo()
    assert (session.choices.position, session.choices.amplitude_mm) == (0.7, 4)


def heard(session: Session) -> tuple[bool, str, float, object]:
    choices = session.choices
    assert choices.patch is not None
    return choices.stereo, choices.pickup, choices.listen, choices.patch.pickup


def test_where_a_patch_is_heard_is_one_step_of_undo(clock: Clock) -> None:
    session = Session()
    session.update(instrument=read_patch(SHIPPED / "classical_guitar.json"))
    history, states, words = History(session, clock), [heard(session)], []
    for change in ({"pickup": "velocity"}, {"stereo": not session.choices.stereo}, {"listen": 0.11}):
        clock.now_s += 1
        session.update(**change)
        states.append(heard(session))
        words.append(history.undo_words)
    assert words == ["pick-up", "stereo", "listening point"]
    for there, back in ((states[:-1][::-1], history.undo), (states[1:], history.redo)):
        for state in there:
            back()
            assert heard(session) == state
    assert not history.redo_words


def test_what_is_played_is_a_step_with_the_pick_up_that_comes_with_it(clock: Clock) -> None:
    session = Session()
    session.update(instrument=read_patch(SHIPPED / "classical_guitar.json"))
    history = History(session, clock)
    own = heard(session)
    session.play_string()
    clock.now_s += 1
    session.update(listen=0.9)
    clock.now_s += 1
    session.play_patch()
    assert heard(session) == own
    words = []
    for plays_patch, listen in ((False, 0.9), (False, own[2]), (True, own[2])):
        words.append(history.undo_words)
        history.undo()
        assert (session.choices.plays_patch, session.choices.listen) == (plays_patch, listen)
    assert words == ["instrument Classical guitar", "listening point", "preset studio_any_string"]
    assert heard(session) == own
    for _ in words:
        history.redo()
    assert (session.choices.plays_patch, heard(session)) == (True, own)
