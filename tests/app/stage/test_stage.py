"""The stage after each event, without a window."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from app.instruments.library import SHIPPED, read_instrument
from app.player.strings import Strings
from app.playing.note import PluckVoices
from app.rendering import NoteSound
from app.session.choices import Choices
from app.stage.stage import Asked, Begun, Chosen, Parked, Rendered, Turned, first_stage, next_stage
from engine.pluck import Pluck
from engine.values.ear import Ear

HARP, GUITAR = (read_instrument(SHIPPED / f"{name}.json") for name in ("concert_harp", "classical_guitar"))
REQUEST = NoteSound(Path("one"), Pluck(0.3), 1.0, Ear((0.2,)))


def note(request: NoteSound = REQUEST, from_s: float = 0.0) -> Any:
    return PluckVoices(request, ("model",), from_s)


def test_an_instrument_has_its_own_string_until_another_is_chosen_with_it() -> None:
    stage = first_stage(Choices(single="one"))
    for instrument in (HARP, GUITAR):
        stage = next_stage(stage, Chosen({"played": instrument}))
        string = Strings(instrument).of_key(sum(instrument.range) // 2)
        assert string is not None and stage.choices.string == string.parameters
    low = Strings(HARP).of_key(43)
    assert low is not None
    stage = next_stage(stage, Chosen({"played": HARP, "string": low.parameters, "position": 0.2}))
    assert (stage.choices.string, stage.choices.position, stage.key) == (low.parameters, 0.2, (43, None))


def test_the_playhead_follows_the_note_of_the_motion_until_it_is_parked() -> None:
    take: Any = SimpleNamespace(seconds=1.0)
    first, second = note(), note(from_s=0.4)
    stage = next_stage(first_stage(Choices(single="one")), Begun(first))
    stage = next_stage(next_stage(stage, Asked(REQUEST)), Rendered(take))
    assert stage.lead is first and stage.moving and stage.choices.position == 0.3
    parked = next_stage(stage, Parked(0.7))
    assert next_stage(parked, Asked(REQUEST)).position_s(0.1) == 0.7 and not parked.audible
    turned = next_stage(parked, Turned(second))
    assert turned.lead is second and turned.position_s(0.1) == 0.4
    other = NoteSound(Path("one"), Pluck(0.6), 1.0, REQUEST.ear)
    assert next_stage(turned, Asked(other)).ready is False, "another motion is awaited"
    assert next_stage(turned, Begun(note(other))).lead is second, "its motion is another"
