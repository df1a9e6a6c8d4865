"""MPE and note expressions in a plug-in: member channels, each with its own bend and slide, sound as in the app."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np
import pytest
from numpy.typing import NDArray

from app.player.events import Bend, ControlChange, NoteOff, NoteOn, TimedEvent
from app.player.offline import render_events
from tests.app.export.plugin.host import Event, Library, brighten, midi, note_on, tune
from tests.app.export.plugin.pieces import EQUAL_DB, MEMBERS, difference_db, instrument_of, preset_of, to_host

pytestmark = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")

SECONDS = 0.8
SLIDE, SUSTAIN = 74, 64

Timed = tuple[float, NoteOn | NoteOff | Bend | ControlChange]
MEMBERS_PLAY: tuple[Timed, ...] = (
    (0.0, ControlChange(SLIDE, 20, 1)),
    (0.0, ControlChange(SLIDE, 110, 2)),
    (0.01, NoteOn(52, 100, 1)),
    (0.02, NoteOn(59, 90, 2)),
    (0.05, NoteOn(59, 110, 3)),  # the same key in another channel, without a slide
    (0.1, Bend(512 / 8191, 1)),  # three semitones of a member's 48
    (0.2, Bend(-0.03125, 2)),
    (0.25, ControlChange(SLIDE, 64, 2)),  # for its next note
    (0.3, NoteOff(59, 2)),
    (0.35, Bend(2048 / 8191, 0)),  # the master's wheel, for all
    (0.4, NoteOn(64, 100, 2)),
    (0.45, ControlChange(SUSTAIN, 127, 0)),
    (0.5, NoteOff(52, 1)),
    (0.6, Bend(0.0, 0)),
    (0.65, ControlChange(SUSTAIN, 0, 0)),
)


def in_app(timed: Sequence[Timed], rate_hz: int) -> NDArray[np.float32]:
    events = [TimedEvent(time_s, event) for time_s, event in timed]
    sound = render_events(instrument_of(MEMBERS), preset_of(MEMBERS), events, rate_hz, "model", SECONDS)
    return np.broadcast_to(np.concatenate(list(sound)), (round(SECONDS * rate_hz), 2))


def in_host(bank: Library, events: Sequence[Event], rate_hz: int) -> NDArray[np.float32]:
    instance = bank.create_named(instrument_of(MEMBERS).name)
    instance.activate(rate_hz)
    latency = instance.latency
    return instance.render(round(SECONDS * rate_hz) + latency, events)[latency:]


@pytest.mark.parametrize("rate_hz", (44_100, 96_000))
def test_member_channels_bend_and_slide_as_in_the_app(bank: Library, rate_hz: int) -> None:
    events = [to_host(event, round(time_s * rate_hz)) for time_s, event in MEMBERS_PLAY]
    wanted = in_app(MEMBERS_PLAY, rate_hz)
    pressed = [*events, midi(9_000, 0xD1, 100, 0), midi(9_100, 0xA1, 52, 100)]  # changes nothing
    assert difference_db(in_host(bank, pressed, rate_hz), wanted) < EQUAL_DB
    still = [each for each in MEMBERS_PLAY if not isinstance(each[1], Bend)]
    unslid = [each for each in MEMBERS_PLAY if not (isinstance(each[1], ControlChange) and each[1].number == SLIDE)]
    for other in (still, unslid):  # both are heard
        assert difference_db(in_app(other, rate_hz), wanted) > -40


def test_expressions_of_notes_are_what_bend_and_slide_of_a_member_are(bank: Library) -> None:
    rate_hz = 48_000
    timed = (
        (0.0, ControlChange(SLIDE, 57, 1)),
        (0.01, NoteOn(52, 100, 1)),
        (0.1, Bend(0.0625, 1)),
        (0.3, Bend(0.0, 1)),
    )
    expressed = [
        brighten(0, 57 / 127, 1),
        note_on(480, 52, 100, 1, note_id=5),
        tune(4_800, 3.0, note_id=5),  # a sixteenth of a member's 48 semitones
        tune(14_400, 0.0, note_id=5),
    ]
    assert difference_db(in_host(bank, expressed, rate_hz), in_app(timed, rate_hz)) < EQUAL_DB
