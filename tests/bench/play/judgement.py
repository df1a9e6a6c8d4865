"""Judges the recording of a piece by what was played and when."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from app.instrument.events import Bend, NoteOff, TimedEvent
from app.patches.patch import Patch
from app.patches.tuning import Tuning
from tests.bench.play import analysis, hearing, score
from tests.bench.play.hearing import Sound
from tests.bench.play.score import Sounded
from tests.bench.play.sound_server import RATE_HZ
from tests.bench.printing import target

BEGINS_S = 0.05  # at a note's beginning in which no sound is expected yet: its waves must reach the listening point
ENDS_S = 0.005  # before its damping from which none is expected any more
REPEAT_RISES_DB = 3.0  # the least rise of the level at a repeat; one in phase with the string breaks no waveform
OWN_S = 0.5  # of a note before its release, in which its own decay is measured

Played = Mapping[str, Sequence[TimedEvent]]  # by the name of the part
At = Callable[[float], float]  # from the time of an event to the time in the recording at which it is heard, in s


@dataclass(frozen=True)
class Judgement:
    """The result; None for what needs a wheel or a pedal where there was none.

    Pitch is measured in the longest part of a note without a hole or click, damping only where there is neither.

    Attributes:
        melody_cents: the largest deviation of quiet notes from the tuning; `bend_cents` from the bent pitch where the
            wheel rests; `chord_cents` of the tones of chords, which are not quiet. NaN where one is silent.
        loudness_spread_db: between the loudest and the softest of the quiet notes.
        release_t60_s: the shortest and the longest of the quiet notes' dampers; the patch's is `wanted_t60_s`.
        chord_tones, tones_heard: how many there are, and how many stand out.
        repeats, repeats_heard: of a key that is struck twelve times per second.
        pedal_db: the largest difference in level of a note held by a finger and the same held by the pedal.
        pedal_t60_s: of the damper when the pedal is released.
        restrike_db: of soft strikes of a string that rings loudly. Where a strike stops its string, from the softest
            to the loudest, for each sounds by itself; where it does not, the largest fall of the level.
        holes, fades, clicks: in all that was played, see `analysis`; times in s from the beginning of the recording.
        loudest: the largest sample, ±1 being full scale.
    """

    melody_cents: float = field(metadata=target(0.5))
    chord_cents: float
    bend_cents: float | None = field(metadata=target(0.5))
    loudness_spread_db: float = field(metadata=target("below 3"))
    release_t60_s: tuple[float, float]
    wanted_t60_s: float
    chord_tones: int
    tones_heard: int
    repeats: int
    repeats_heard: int
    pedal_db: float | None = field(metadata=target(0))
    pedal_t60_s: float | None
    restrike_db: float | None = field(metadata=target(0))
    holes: int = field(metadata=target(0))
    holes_ms: float = field(metadata=target(0))
    fades: int = field(metadata=target(0))
    clicks: int = field(metadata=target(0))
    hole_times_s: tuple[float, ...]
    click_times_s: tuple[float, ...]
    loudest: float = field(metadata=target("below 1"))


def judge(played: Played, patch: Patch, sound: Sound, at: At) -> Judgement:
    """Judge the recording of a patch without body and room, whose strings are damped when keys are released."""
    tuning = Tuning(patch.tuning)
    faults = _faults(played, sound, at)
    gaps = [*faults.holes, *(analysis.Span(click, click + 1) for click in faults.clicks)]
    gaps_s = [(gap.start / RATE_HZ, gap.end / RATE_HZ) for gap in gaps]

    def cents_of(begins_s: float, ends_s: float, wanted_hz: float) -> float:
        start_s, end_s = _longest_without((begins_s + hearing.ATTACK_S, ends_s), gaps_s)
        return hearing.cents(sound, start_s, end_s, wanted_hz)

    melody = score.sounded(played["melody"])
    spans = [(at(note.pressed_s), at(note.released_s)) for note in melody]
    releases_s = [
        hearing.release_t60_s(sound, end, hearing.slope_db_s(sound, end - OWN_S, end))
        for _, end in spans
        if not any(end - OWN_S < gap < end + hearing.LONGEST_RELEASE_S for gap, _ in gaps_s)
    ]
    loudness = [hearing.loudness(sound, start) for start, _ in spans]
    cents = [cents_of(*span, tuning.hz(note.key)) for span, note in zip(spans, melody, strict=True)]
    tones = [
        (at(note.pressed_s), at(note.released_s), tuning.hz(note.key)) for note in score.sounded(played["chords"])
    ]
    pedal_db = pedal_t60_s = restrike_db = None
    if "pedal" in played:
        pedal_db, pedal_t60_s, restrike_db = _pedal(played["pedal"], patch, sound, at)
    return Judgement(
        _worst(cents),
        _worst(cents_of(*tone) for tone in tones),
        _bends(played["bends"], patch, at, cents_of) if "bends" in played else None,
        max(loudness) - min(loudness),
        (min(releases_s, default=math.nan), max(releases_s, default=math.nan)),
        patch.damping.release_t60_s,
        len(tones),
        sum(hearing.tone_stands_out(sound, *tone) for tone in tones),
        len(score.sounded(played["repeats"])),
        faults.repeats_heard,
        pedal_db,
        pedal_t60_s,
        restrike_db,
        len(faults.holes),
        sum(hole.frames for hole in faults.holes) * 1000 / RATE_HZ,
        len(faults.fades),
        len(faults.clicks),
        tuple(round(hole.start / RATE_HZ, 4) for hole in faults.holes),
        tuple(round(click / RATE_HZ, 4) for click in faults.clicks),
        float(np.abs(sound).max()),
    )


def notes_of(played: Played) -> list[Sounded]:
    """All notes, in the order in which they were struck."""
    return sorted((note for part in played.values() for note in score.sounded(part)), key=lambda note: note.pressed_s)


def _worst(cents: Iterable[float]) -> float:
    """The largest magnitude; NaN, a silent note, where there is one."""
    found = np.abs(np.array(list(cents)))
    return float("nan") if np.isnan(found).any() else float(found.max())


def _longest_without(span_s: tuple[float, float], gaps_s: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """The longest part of a span without any of the gaps."""
    begin_s, end_s = span_s
    inside = sorted(gap for gap in gaps_s if gap[1] > begin_s and gap[0] < end_s)
    edges = [(begin_s, begin_s), *inside, (end_s, end_s)]
    return max(((a[1], b[0]) for a, b in itertools.pairwise(edges)), key=lambda part: part[1] - part[0])


@dataclass(frozen=True)
class _Faults:
    holes: list[analysis.Span]
    fades: list[analysis.Span]
    clicks: list[int]
    repeats_heard: int


def _faults(played: Played, sound: Sound, at: At) -> _Faults:
    notes = notes_of(played)
    expected = _united([(at(note.pressed_s) + BEGINS_S, at(note.damped_s) - ENDS_S) for note in notes])
    with_releases = _united([(at(note.pressed_s), at(note.damped_s) + hearing.LONGEST_RELEASE_S) for note in notes])
    holes = analysis.holes(sound, expected, RATE_HZ)
    fades = [f for f in analysis.fades(sound[:, 0], expected, RATE_HZ) if not any(map(f.meets, holes))]
    rest = analysis.unpredicted(sound[:, 0], RATE_HZ)
    events = analysis.events(rest, RATE_HZ)
    places = [round(at(note.pressed_s) * RATE_HZ) for note in notes]
    plucked = analysis.matched(places, events, rest.by_past, 0, RATE_HZ)
    repeated = {note.pressed_s for note in score.sounded(played["repeats"])}
    heard = {
        note.pressed_s
        for note, place in zip(notes, plucked, strict=True)
        if note.pressed_s in repeated
        and (place is not None or hearing.change_db(sound, at(note.pressed_s)) > REPEAT_RISES_DB)
    }
    clicks = analysis.clicks(events, plucked, [*holes, *fades], with_releases, RATE_HZ)
    return _Faults(holes, fades, clicks, len(heard))


def _united(spans_s: Sequence[tuple[float, float]]) -> list[analysis.Span]:
    """The spans in frames, with those that overlap or touch joined."""
    found: list[analysis.Span] = []
    for start_s, end_s in sorted(spans_s):
        start, end = round(start_s * RATE_HZ), round(end_s * RATE_HZ)
        if found and start <= found[-1].end:
            start, end = found[-1].start, max(end, found.pop().end)
        if end > start:
            found.append(analysis.Span(start, end))
    return found


def _bends(
    part: Sequence[TimedEvent], patch: Patch, at: At, cents_of: Callable[[float, float, float], float]
) -> float:
    """The largest deviation in cents from the bent pitch while the wheel rests."""
    own_hz = Tuning(patch.tuning).hz(score.BENT)
    turned = [each for each in part if isinstance(each.event, Bend | NoteOff)]
    found = []
    for each, following in itertools.pairwise(turned):
        if isinstance(each.event, Bend) and following.time_s - each.time_s > score.RESTS_S / 2:
            wanted_hz = own_hz * 2 ** (each.event.value * patch.bend_semitones / 12)
            found.append(cents_of(at(each.time_s), at(following.time_s), wanted_hz))
    return _worst(found)


def _pedal(part: Sequence[TimedEvent], patch: Patch, sound: Sound, at: At) -> tuple[float, float, float]:
    """`pedal_db`, `pedal_t60_s` and `restrike_db` of a `Judgement`."""
    notes = score.sounded(part)
    finger, pedalled = (note for note in notes if note.key == score.PEDALLED)
    levels = [hearing.levels_db(sound, at(n.pressed_s) + 0.05, at(n.pressed_s) + 1.4) for n in (finger, pedalled)]
    frames = min(map(len, levels))
    apart_db = float(np.abs(levels[0][:frames] - levels[1][:frames]).max())
    end_s = at(pedalled.damped_s)
    release_s = hearing.release_t60_s(sound, end_s, hearing.slope_db_s(sound, end_s - 0.5, end_s))
    soft = [at(note.pressed_s) for note in notes if note.key == score.RESTRUCK and note.velocity == score.QUIET]
    if patch.pluck.stops:
        struck_db = [hearing.struck_db(sound, strike_s) for strike_s in soft]
        return apart_db, release_s, max(struck_db) - min(struck_db)
    fall_db = -min(hearing.change_db(sound, strike_s) for strike_s in soft)
    return apart_db, release_s, max(fall_db, 0.0)
