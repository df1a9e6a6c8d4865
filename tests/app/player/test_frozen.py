"""Frozen sounds: random events on many instruments sound as they did.

`frozen/sounds.json` has the norm of each sound, then its projections on eight random directions, in norms. An
independent player in Python, since removed, made most of them; the compiled one agreed with it to 1e-9. Those of
WITH_TECHNIQUES are of the compiled player. The instruments are there as they were, so that the factory's may be
voiced otherwise.
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.instruments.drums import Drums
from app.instruments.instrument import Instrument, Pickup
from app.instruments.library import read_instrument
from app.player import events
from app.player.events import KEYS, Bend, ControlChange, Event, InstrumentTurned, NoteOff, NoteOn
from engine.kernels import midi
from engine.kernels.constants import QUANTUM
from tests.app.player.stage import PRESET, RATE_HZ, Sound, Stage, changed
from tests.engine.resonators.test_recorded import recorded

GAINS = {"model": 1.0, "truth": -0.5}
CLOSE = 1e-7
Played = Sequence[tuple[int, Event]]
FROZEN_INSTRUMENTS = Path(__file__).parent / "frozen"
FROZEN = json.loads((FROZEN_INSTRUMENTS / "sounds.json").read_text())


def off(name: str, sound: Sound) -> float:
    """By how much a sound is another than the frozen one of this name: the largest of all its numbers."""
    flat = sound.ravel()
    norm = float(np.linalg.norm(flat))
    directions = np.random.default_rng(0).standard_normal((8, len(flat)))
    known = np.array(FROZEN[name])
    return float(np.abs(np.array([norm / known[0] - 1, *(directions @ flat / norm - known[1:])])).max())


def compared(name: str, instrument: Instrument, played: Played, quanta: int = 400, **stage: Any) -> float:
    return off(name, Stage(instrument, **{"gains": GAINS, **stage}).run(played, quanta * QUANTUM))


@pytest.fixture(scope="module")
def shipped() -> dict[str, Instrument]:
    """Without variation from stroke to stroke and strings at rest, which the frozen sounds have not."""
    paths = [path for path in FROZEN_INSTRUMENTS.glob("*.json") if path.stem != "sounds"]
    return {path.stem: changed(read_instrument(path), pluck={"variation": 0.0}, sympathy_s_kg=0.0) for path in paths}


CONTROLLERS = (
    *(midi.SUSTAIN, midi.MOD_WHEEL, midi.SLIDE, midi.RESET, midi.NOTES_OFF),
    *(midi.REGISTERED, midi.FINE_REGISTERED, midi.VALUE, midi.FINE_VALUE, midi.OTHER),
)
HANDS = (  # which instruments with techniques have beside them
    *(midi.LEGATO, midi.PORTAMENTO, midi.SLIDE_TIME, midi.SOFT, midi.VOLUME, midi.EXPRESSION),
    *(midi.HARMONICS, midi.TREMOLO, midi.STRUM, midi.INCREMENT),
)
KNOBS = ("knobs.tension", "knobs.gauge", "knobs.decay", "knobs.stiffness", "damping.release_t60_s", "pluck.position")


def drawn(
    instrument: Instrument, other: Instrument, seed: int, controllers: Sequence[int] = CONTROLLERS
) -> list[tuple[int, Event]]:
    """Random events, in their order; keys are often struck again, and two events often share a frame."""
    knobs = ("noise.onset_db",) if isinstance(instrument.strings, Drums) else KNOBS
    draw = np.random.default_rng(seed)
    low, high = instrument.range
    keys = draw.integers(low, high + 1, 5).tolist()
    channels = {"poly": (0, 0, 1, KEYS), "guitar": (0, 1, 2, 3, 4, 9, KEYS), "mpe": (0, 1, 2, 3, KEYS)}[
        instrument.mode
    ]
    frames = np.sort(draw.integers(1, round(0.4 * RATE_HZ), 60))
    frames[::7] = frames[::7] // QUANTUM * QUANTUM
    frames = np.sort(frames)
    present, found = instrument, list[tuple[int, Event]]()
    for number, frame in enumerate(frames.tolist()):
        channel, kind = int(draw.choice(channels)), draw.random()
        key, value = int(draw.choice(keys)), int(draw.integers(0, 128))
        if number < 3 or kind < 0.4:
            found.append((frame, NoteOn(key, max(1, value), channel)))
        elif kind < 0.6:
            found.append((frame, NoteOff(key, channel)))
        elif kind < 0.75:
            found.append((frame, Bend(float(draw.uniform(-1.2, 1.2)), channel)))
        elif kind < 0.97:
            number = int(draw.choice(controllers))
            chooses = number in (midi.REGISTERED, midi.FINE_REGISTERED)
            found.append((frame, ControlChange(number, 0 if chooses else value, channel)))
        elif kind < 0.98:
            found.append((frame, ControlChange(midi.SOUND_OFF, 0, channel)))
        else:
            name = str(draw.choice(knobs))
            turned = present.with_value(name, present.value(name) * float(draw.uniform(0.8, 1.2)))
            present = turned if draw.random() < 0.8 else other
            found.append((frame, InstrumentTurned(present)))
    return released_once(found)


def released_once(played: list[tuple[int, Event]]) -> list[tuple[int, Event]]:
    """With a release for each stroke, and resets of all that a channel has, as the frozen sounds know them."""
    strokes, found = Counter[tuple[int, int]](), list[tuple[int, Event]]()
    for frame, event in played:
        if isinstance(event, NoteOn):
            strokes[event.key, event.channel] += 1
        elif isinstance(event, NoteOff):
            found += [(frame, event)] * (strokes.pop((event.key, event.channel), 1) - 1)
        elif isinstance(event, ControlChange) and event.number == midi.RESET:
            event = replace(event, value=events.AT_REST)
        found.append((frame, event))
    return found


PLAYED = json.loads(FROZEN_INSTRUMENTS.with_suffix(".json").read_text())  # instruments with other parts
INSTRUMENTS, WITH_TECHNIQUES = PLAYED["random"], PLAYED["techniques"]


@pytest.mark.parametrize("number", range(len(INSTRUMENTS)), ids=[name for name, _ in INSTRUMENTS])
@pytest.mark.parametrize("seed", [1, 2])
def test_random_events_sound_as_they_did(shipped, number, seed):
    name, parts = INSTRUMENTS[number]
    instrument = changed(shipped[name], **parts)
    assert compared(f"{number} {name} {seed}", instrument, drawn(instrument, shipped["kora"], seed)) < CLOSE


@pytest.mark.parametrize(("name", "parts"), WITH_TECHNIQUES, ids=[name for name, _ in WITH_TECHNIQUES])
@pytest.mark.parametrize(("seed", "gains"), [(1, GAINS), (2, {"model": 1.0}), (3, {"truth": 1.0})])
def test_techniques_sound_as_they_did(shipped, name, parts, seed, gains):
    instrument = changed(shipped[name], **parts)
    other = instrument if isinstance(instrument.strings, Drums) else shipped["kora"]
    played = drawn(instrument, other, seed, (*CONTROLLERS, *HANDS))
    assert compared(f"techniques of {name} {seed}", instrument, played, gains=gains) < CLOSE


@pytest.mark.parametrize(("name", "kind"), [("classical_guitar", "displacement"), ("fretless_bass", "velocity")])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_string_learned_from_a_recording_has_its_own_modes(shipped, name, kind, seed):
    own = replace(recorded(), smooth_hz=(200.0, 1e3, 5e3), smooth_ratio=(1.5, 2.5, 0.8), pitch_hz=196.0)
    learned = replace(PRESET, info=replace(PRESET.info, recorded=own))
    pickup = Pickup(points=shipped[name].pickup.points, kind=kind)
    instrument, other = (changed(shipped[each], pickup=pickup) for each in (name, "kora"))
    played = drawn(instrument, other, seed)
    assert compared(f"recorded {name} {seed}", instrument, played, preset=learned) < CLOSE


def test_cancel_leaves_what_has_begun(shipped):
    stage = Stage(shipped["cimbalom"], gains=GAINS)
    for frame, key, velocity in ((0, 50, 90), (200, 57, 90), (5000, 50, 120), (5003, 57, 120), (6000, 62, 120)):
        stage.player.handle(NoteOn(key, velocity), frame)
    first = stage.run((), 20 * QUANTUM)
    stage.player.cancel()
    assert off("cancel", np.concatenate([first, stage.run((), 150 * QUANTUM)])) < CLOSE


def test_a_burst_of_500_events_in_a_block_is_played_in_its_order(shipped):
    instrument = changed(shipped["damped_harp"], mod_wheel="knobs.tension")
    draw, burst = np.random.default_rng(3), list[tuple[int, Event]]()
    for number in range(500):
        frame = 640 + number // 8
        if number % 10 == 0:
            burst.append((frame, NoteOn(40 + int(draw.integers(0, 25)), 80)))
        elif number % 10 == 5:
            burst.append((frame, NoteOff(40 + int(draw.integers(0, 25)))))
        elif number % 3 == 0:
            burst.append((frame, Bend(float(draw.uniform(-1, 1)))))
        else:
            burst.append((frame, ControlChange(int(draw.choice([midi.MOD_WHEEL, midi.SUSTAIN])), number % 128)))
    assert compared("burst", instrument, released_once(burst), 100) < CLOSE


def test_the_oldest_make_room(shipped):
    played = [(1 + 480 * number, NoteOn(30 + 3 * number, 90)) for number in range(12)]
    assert compared("oldest", shipped["concert_harp"], played, 200, most=5) < CLOSE
