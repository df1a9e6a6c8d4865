"""Events to sound: what keys, hands, techniques, strokes and courses of an instrument must sound like, row by row.

The rows are in `events_to_sound.txt`, which says what they mean.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED, read_instrument
from app.player.events import (
    Bend,
    ControlChange,
    Event,
    InstrumentTurned,
    NoteOff,
    NoteOn,
    parameter_set,
    release_all,
)
from engine.kernels import constants as of
from engine.kernels import midi
from tests.app.player.stage import (
    SOURCES,
    Stage,
    Timed,
    cents,
    changed,
    hz_of,
    level_db,
    of_six_strings,
    pitch_hz,
    play,
    relative,
)

CONTROLS = {
    **{name.lower().replace("_", "-"): number for name, number in vars(midi).items() if isinstance(number, int)},
    **{"pedal": midi.SUSTAIN, "wheel": midi.MOD_WHEEL, "mute": midi.SOFT, "fine": midi.FINE_VALUE},
    **{"coarse-rpn": midi.REGISTERED, "rpn": midi.FINE_REGISTERED, "more": midi.INCREMENT, "less": midi.DECREMENT},
    **{"coarse-nrpn": midi.OTHER, "nrpn": midi.FINE_OTHER},
    **{f"mode{number}": number for number in range(midi.NOTES_OFF, 128)},
}


def parts_of(text: str) -> dict[str, Any]:
    parts: dict[str, Any] = {}
    for field in " ".join(BUNDLES.get(each, each) for each in text.split()).split():
        name, said = field.split("=")
        value: Any = {"yes": True, "no": False}.get(said, said)
        if said[0].isdigit():
            value = float(said) if "." in said else int(said)
        section, _, inner = name.partition(".")
        if inner:
            parts.setdefault(section, {})[inner] = (value,) if inner == "points" else value
        else:
            parts[section] = value
    return parts


def events_of(text: str, instrument: Instrument) -> list[Timed]:
    """The events of an entry of a score, with their time."""
    time, word, *rest = text.split() if text[0] in ".0123456789" else ["0", *text.split()]
    marks = {each[0]: int(each[1:]) for each in rest if each[0] in "@sv"}
    channel, string, velocity = marks.get("@", 0), marks.get("s"), marks.get("v", 60)
    numbers = [float(each) for each in rest if each[0] in "-.0123456789"]
    first, second = (int(each) for each in (*numbers, 0, 0)[:2])
    found: list[Event]
    match word:
        case "on":
            found = [NoteOn(first, velocity, channel, string=string)]
        case "off":
            found = [NoteOff(first, channel, string)]
        case "bend":
            found = [Bend(numbers[0], channel)]
        case "rest":
            found = release_all([channel])
        case "range":
            found = parameter_set(0, first, second, channel)
        case "fine-tuning" | "coarse-tuning":
            found = parameter_set(midi.FINE_TUNING if word[0] == "f" else midi.COARSE_TUNING, first, 0, channel)
        case "turn":
            found = [InstrumentTurned(changed(instrument, **parts_of(rest[0])))]
        case "another":
            found = [InstrumentTurned(changed(instrument, name="another", damping={"release_t60_s": 0.2}))]
        case _:
            found = [ControlChange(CONTROLS[word], first, channel)]
    return [(float(time), event) for event in found]


Read = Callable[[str], tuple[Instrument, list[Timed]]]


@pytest.fixture
def read(instrument: Instrument, guitar: Instrument) -> Read:
    """read("name field=value: score"): the instrument and its events."""
    strung = of_six_strings(guitar)
    own = {"test": instrument, "guitar": guitar, "six": strung}

    def reading(text: str) -> tuple[Instrument, list[Timed]]:
        words, _, score = text.partition(":")
        name, *fields = words.split()
        chosen = changed(own.get(name) or read_instrument(SHIPPED / f"{name}.json"), **parts_of(" ".join(fields)))
        entries = [entry.strip() for entry in score.split(",") if entry.strip()]
        return chosen, [each for entry in entries for each in events_of(entry, chosen)]

    return reading


BENDS = ", ".join(f"{0.3 + 0.01 * step:.2f} bend {step / 20}" for step in range(20))
STEPS = ".001 on 45, .002 on 52, .2 bend .5, .31 on 45 v50, .45 bend 0, .5 off 45, .52 off 52, .6 on 47 v40"
NAMES = {
    "busy": f"on 45 v110, .2 on 52 v90, {BENDS}, .6 off 45, .7 on 52 v127, .9 bend 0, 1 pedal 127, 1.1 off 52",
    "steps": STEPS,
    "edged": STEPS.replace(".45", ".4 turn javari.gap_um=60, .45").replace(".6", ".55 turn javari.gap_um=0, .6"),
}
TEXT = Path(__file__).with_name("events_to_sound.txt").read_text(encoding="utf-8").format_map(NAMES)
TABLES = dict(part.split("]\n# ", 1) for part in TEXT.split("\n[")[1:])


def rows(name: str) -> list[list[str]]:
    lines = TABLES[name].splitlines()[1:]
    return [[each.strip() for each in line.split("|")] for line in lines if line]


BUNDLES = dict(rows("bundles"))


def numbers_of(text: str) -> list[list[float]]:
    return [[float(each) for each in part.split()] for part in text.split(";")]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("one", "other", "bounds"), rows("alike"))
def test_two_ways_to_one_sound(read, one, other, bounds, source):
    ((seconds, apart),) = numbers_of(bounds)
    sounds = [play(instrument, seconds, *events, source=source) for instrument, events in map(read, (one, other))]
    assert np.abs(sounds[1]).max() > 1e-3
    np.testing.assert_allclose(*sounds, rtol=0, atol=apart * np.abs(sounds[1]).max())


@pytest.mark.parametrize(("played", "apart"), rows("agree"))
def test_model_and_truth_agree(read, played, apart):
    instrument, events = read(played)
    model, truth = (play(instrument, events[-1][0] + 0.5, *events, source=source) for source in SOURCES)
    assert np.isfinite(model).all() and np.abs(truth).max() > 1e-3
    assert relative(model, truth) < float(apart)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("played", "heard"), rows("pitches"))
def test_pitches(read, played, heard, source):
    instrument, events = read(played)
    windows = numbers_of(heard)
    sound = play(instrument, windows[-1][1] + 0.05, *events, source=source)
    for begin_s, end_s, key, apart in windows:
        found = pitch_hz(sound, hz_of(key), begin_s, end_s, max(0.03, apart / 1200))
        assert abs(cents(found, hz_of(key))) < apart, (begin_s, key)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("played", "heard"), rows("levels"))
def test_levels(read, played, heard, source):
    windows = numbers_of(heard)
    instrument, events = read(played)
    sound, alone = (
        play(instrument, windows[-1][1], *each, source=source) for each in (events, [(0.0, NoteOn(45, 60))])
    )
    for begin_s, end_s, low_db, high_db in windows:
        found = level_db(sound, begin_s, end_s) - level_db(alone, begin_s, end_s)
        assert low_db - 0.02 <= found <= high_db + 0.02, begin_s


def check(text: str, stage: Stage) -> None:
    if text.startswith("rings"):
        assert stage.sounding == [int(each) for each in text.split()[1:]]
        return
    number, said, *value = text.split()
    note = stage.struck[int(number)]
    if said == "bent":
        assert note.semitones == pytest.approx(float(value[0]), abs=1e-6)
    elif said == "at":
        assert stage.begun[int(number)].position == pytest.approx(float(value[0]))
    elif said == "on":
        assert note.now.now.area_m2 == pytest.approx(5e-7 * 1.1 ** (5 - int(value[0])))
        assert note.now.now.pitch_hz == pytest.approx(hz_of(note.now.key + note.semitones), rel=1e-6)
    else:
        assert note.state == said


@pytest.mark.parametrize(
    "score", TABLES["hands"].strip().split("\n\n")[1:], ids=lambda score: score.strip().split("\n")[0]
)
def test_hands(read, score):
    title, *lines = score.strip().split("\n")
    stage = Stage(read(title.split(":")[0])[0])
    for line in lines:
        played, _, expected = line.partition(" => ")
        for text in played.split(", "):
            stage.play(*(event for _, event in events_of(text, stage.player.instrument)))
        for text in expected.split(", "):
            check(text, stage)


@pytest.mark.parametrize("block", [64, 4_096])
@pytest.mark.parametrize(("played", "frames", "begun"), rows("strokes"))
def test_strokes_begin_at_their_frames(read, played, frames, begun, block):
    instrument, events = read(played)
    stage = Stage(instrument)
    stage.run([(round(frame), event) for frame, event in events], int(frames), block)
    assert " ".join(f"{each.key}@{each.frame}" for each in stage.begun) == begun
    refused = [each.key for each in stage.reports if each.kind == of.REFUSED]
    struck = sum(isinstance(event, NoteOn) for _, event in events)
    assert len({each.id for each in stage.begun}) + len(refused) == struck
