"""A recording's journal: what was played comes back as it was, also from a torn or damaged file."""

import json
import random
from datetime import UTC, datetime
from pathlib import Path

import pytest

from app.export.journal import Journal, left_journals
from app.instruments.library import list_instruments
from app.player.events import (
    KEYS,
    Bend,
    ControlChange,
    Event,
    InstrumentTurned,
    Meter,
    NoteOff,
    NoteOn,
    TimedEvent,
    played_from,
)
from engine.pluck import Pluck

NOW = datetime(2024, 5, 6, 7, 8, 9, 1234, tzinfo=UTC)
INSTRUMENTS = [entry.instrument for entry in list_instruments()[0]]


def drawn(draw: random.Random) -> Event:
    channel, key, value = draw.randrange(KEYS + 1), draw.randrange(128), draw.randrange(128)
    place = draw.choice([None, (draw.uniform(-1, 1), draw.uniform(-1, 1))])
    rounded = Pluck(draw.uniform(0.02, 0.98), draw.uniform(0, 20), "rounded", draw.uniform(0.02, 1))
    string, instrument = draw.choice([None, draw.randrange(6)]), draw.choice(INSTRUMENTS)
    turned = instrument.model_copy(update={"level_db": instrument.level_db - draw.random()})
    transposed = instrument.tuning.model_copy(update={"transpose": draw.randrange(-12, 13)})
    return draw.choice(
        [
            NoteOn(key, value, channel, place, string, draw.choice([None, rounded])),
            NoteOff(key, channel, string),
            Bend(draw.uniform(-1, 1), channel),
            ControlChange(key, value, channel),
            InstrumentTurned(draw.choice([instrument, turned, turned.model_copy(update={"tuning": transposed})])),
        ]
    )


def recorded(draw: random.Random, events: int) -> list[TimedEvent]:
    times_s = sorted(draw.uniform(0, 100) for _ in range(events))
    first = [TimedEvent(0.0, InstrumentTurned(draw.choice(INSTRUMENTS))), TimedEvent(0.0, NoteOn(60, 90))]
    return first + [TimedEvent(time_s, drawn(draw)) for time_s in times_s]


def written(
    folder: Path, events: list[TimedEvent], end_s: float | None = None, meter: Meter | None = None
) -> Journal:
    """A journal that its process has left."""
    journal = Journal.begun(folder, NOW, meter)
    middle = len(events) // 2
    journal.write(events[:middle])
    if meter is not None:
        journal.hear("truth", 0.0)
        journal.hear("difference", 40.0)
    journal.write(events[middle:])
    if end_s is not None:
        journal.end(end_s)
    journal.close()
    (left,) = left_journals(folder)
    assert left.path == journal.path
    return left


@pytest.mark.parametrize("seed", range(8))
def test_what_is_written_is_read(tmp_path, seed):
    events = recorded(random.Random(seed), 120)
    meter = Meter(tempo_bpm=90 + seed, metronome=True) if seed % 2 else None
    if meter is not None:  # begun in the count-in, of which notes are left out
        events = [TimedEvent(-1.0, events[0].event), TimedEvent(-0.5, NoteOn(61, 90)), *events[1:]]
    played = written(tmp_path, events, 101.5, meter).read()
    assert played is not None
    assert list(played.events) == played_from(events, 101.5, meter is not None)
    assert played.meter == meter and NoteOn(61, 90) not in [entry.event for entry in played.events]
    assert played.instrument == events[0].event.instrument  # type: ignore[union-attr]
    assert played.recorded == NOW
    heard = ("model", 0.0) if meter is None else ("difference", 40.0)
    assert (played.source, played.difference_gain_db) == heard


def test_cut_at_any_byte_it_gives_the_whole_lines_before(tmp_path):
    events = recorded(random.Random(3), 12)
    journal = written(tmp_path, events)
    raw, draw = journal.path.read_bytes(), random.Random(4)
    for cut in sorted(draw.randrange(len(raw)) for _ in range(120)):
        journal.path.write_bytes(raw[:cut])
        whole = raw[:cut].count(b"\n") - 1  # less the first line
        if whole < 0:
            with pytest.raises(ValueError, match="no recording of this program"):
                journal.read()
            continue
        played, kept = journal.read(), events[:whole]
        wanted = played_from(kept, kept[-1].time_s) if kept else []
        assert (None if played is None else list(played.events)) == (wanted or None)


HEAD = json.dumps({"version": 1, "recorded": NOW.isoformat()})
FIRST = json.dumps({"t": 0.0, "instrument": INSTRUMENTS[0].model_dump(mode="json")})
ON = '{"t": 1.0, "on": {"key": 60, "velocity": 90}}'
DAMAGED = Path(__file__).with_name("damaged_lines.txt").read_text("utf-8").splitlines()


def test_of_a_damaged_journal_what_stands_before_is_kept(tmp_path):
    journal = written(tmp_path, [])
    for line in [*DAMAGED, "\x00\xff", "[" * 100_000]:
        journal.path.write_bytes("\n".join([HEAD, FIRST, ON, line, ON.replace("60", "61"), ""]).encode("latin-1"))
        played = journal.read()
        assert played is not None and played.instrument == INSTRUMENTS[0], line[:80]
        assert [each.event for each in played.events if isinstance(each.event, NoteOn)] == [NoteOn(60, 90)], line[:80]


def test_what_is_no_journal_is_named(tmp_path):
    journal = written(tmp_path, [])
    for first in ("", "{}", '{"version": 2}', '{"version": 1, "recorded": "x"}', "RIFF", FIRST):
        journal.path.write_text(f"{first}\n{FIRST}\n{ON}\n")
        with pytest.raises(ValueError, match=r"\.recording: no recording of this program"):
            journal.read()


def test_one_process_has_a_journal_at_a_time(tmp_path):
    journal = Journal.begun(tmp_path, NOW)
    assert left_journals(tmp_path) == []
    journal.close()
    (first,) = left_journals(tmp_path)
    assert left_journals(tmp_path) == []
    first.delete()
    assert list(tmp_path.iterdir()) == []
