"""A fault costs one note: it is reported in plain words, and all others play on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import NoteOff, NoteOn
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.playing import notes as module
from app.playing.dropping import DROPPED
from app.playing.key_note import KeyNote
from app.playing.note import Note
from app.playing.notes import Notes
from app.playing.sources import Sources
from app.rendering import RenderRequest
from engine.values.ear import Ear
from tests.app.monitors import find_shipped, hears

Wait = Callable[[Callable[[], bool]], None]
EAR = Ear((0.3,))
PluckOf = Callable[..., RenderRequest]


@pytest.fixture
def played(sound: Any, wait: Wait, reports: list[tuple[str, str]]) -> Iterator[Notes]:
    """Notes whose instrument is a guitar, its tone at 0: both widths are at the end of their range."""
    guitar = read_patch(PATCHES / "classical_guitar.json")
    tone = next(number for number, macro in enumerate(guitar.macros) if macro.name == "Tone")
    made = Notes(sound, Sources(), find_shipped, lambda message, details: reports.append((message, details)))
    made.set_monitor(hears("model"))
    made.set_instrument(guitar.turned(tone, 0.0), EAR)
    wait(lambda: made.keys.player is not None)
    yield made
    made.close()


def play(notes: Notes, sound: Any, *keys: int) -> list[KeyNote]:
    """The notes of keys, followed as the supervision and the window do."""
    begun = []
    for key in keys:
        note = notes.handle(NoteOn(key, 100))
        sound.mixer.render(128)
        sound.take_care()
        notes.poll()
        if isinstance(note, KeyNote):
            begun.append(note)
    return begun


def once(work: Callable[..., Any], at: int) -> Callable[..., Any]:
    """`work`, which fails when it is done for the time `at`, from 1."""
    times = [0]

    def failing(*values: Any, **named: Any) -> Any:
        times[0] += 1
        if times[0] == at:
            raise ZeroDivisionError("a mistake")
        return work(*values, **named)

    return failing


def is_loud(sound: Any) -> bool:
    return bool(np.abs(sound.mixer.render(2048)).max() > 1e-3)


def test_keys_play_on_with_the_tone_at_zero(played: Notes, sound: Any, reports: list[tuple[str, str]]) -> None:
    keys = [40 + number * 7 % 36 for number in range(40)]
    begun = play(played, sound, *keys)
    assert reports == []
    assert [note.event.key for note in begun if note.pluck is not None] == keys
    assert is_loud(sound)


@pytest.mark.parametrize("kind, name", [(InstrumentPlayer, "handle"), (KeyNote, "take")])
def test_a_key_that_fails_costs_its_own_note(
    played: Notes, sound: Any, reports: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch, kind: type, name: str
) -> None:
    monkeypatch.setattr(kind, name, once(getattr(kind, name), at=2))
    begun = play(played, sound, 45, 50, 55)
    assert [message for message, _ in reports] == [DROPPED]
    assert "a mistake" in reports[0][1]
    assert [note.event.key for note in begun if not note.over] == [45, 55]
    assert is_loud(sound)
    for key in (45, 50, 55):
        played.handle(NoteOff(key))
    played.stop()
    sound.mixer.render(48_000)
    assert played.ringing == 0
    assert np.abs(sound.mixer.render(4800)).max() < 1e-4, "what was dropped does not ring on"


@pytest.mark.parametrize("kind, name", [(Note, "release"), (Notes, "_apply_monitor"), (Notes, "_follow")])
def test_a_pluck_that_cannot_be_changed_or_ended_costs_itself(
    notes: Notes,
    sound: Any,
    bank: Path,
    pluck_of: PluckOf,
    reports: list[tuple[str, str]],
    monkeypatch: pytest.MonkeyPatch,
    strike: Callable[..., Note],
    kind: type,
    name: str,
) -> None:
    struck = [strike(pluck_of(bank)) for _ in range(3)]
    sound.mixer.render(4800)
    monkeypatch.setattr(kind, name, once(getattr(kind, name), at=2))
    if name == "_follow":
        notes.poll()
    elif name == "_apply_monitor":
        notes.set_monitor(hears("truth"))
    else:
        monkeypatch.setattr(module, "MOST_NOTES", 1)
        strike(pluck_of(bank))
    assert [message for message, _ in reports] == [DROPPED]
    assert [note.cut for note in struck] == [False, True, False]
    notes.poll()
    again = strike(pluck_of(bank))
    sound.mixer.render(4800)
    assert again.began and not again.over
    assert is_loud(sound)


def test_a_report_that_fails_stops_nothing(
    sound: Any, sources: Sources, bank: Path, pluck_of: PluckOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: str) -> None:
        raise ZeroDivisionError("a mistake")

    notes = Notes(sound, sources, lambda name: None, broken)
    notes.set_monitor(hears("model"))
    notes.choose(pluck_of(bank))
    monkeypatch.setattr(Notes, "_begin", once(Notes._begin, at=1))
    try:
        first, second = notes.ring(), notes.ring()
        assert first is not None and first.cut
        assert second is not None and not second.over
        assert is_loud(sound)
    finally:
        notes.close()
