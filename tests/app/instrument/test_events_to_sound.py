"""Events to sound: what keys, hands, techniques, strokes and courses of an instrument must sound like, row by row."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from math import log, log10
from typing import Any

import numpy as np
import pytest

from app.instrument.events import (
    COARSE_TUNING,
    DECREMENT,
    EXPRESSION,
    FINE_OTHER,
    FINE_REGISTERED,
    FINE_TUNING,
    FINE_VALUE,
    HARMONICS,
    INCREMENT,
    KEYS,
    LEGATO,
    MOD_WHEEL,
    NOTES_OFF,
    OTHER,
    PORTAMENTO,
    REGISTERED,
    RESET,
    SLIDE_TIME,
    SOFT,
    SOUND_OFF,
    STRUM,
    SUSTAIN,
    TREMOLO,
    VALUE,
    VOLUME,
    Bend,
    Controller,
    Event,
    NoteOff,
    NoteOn,
    PatchTurned,
    parameter_set,
    release_all,
)
from app.patches.library import SHIPPED, read_patch
from app.patches.patch import Course, Javari, Patch, Pickup
from engine.kernels import constants as of
from engine.kernels.playing.channels import SLIDE_S, WIDEST_SEMITONES
from engine.kernels.playing.chords import CHORD_S, USUAL_STRUM_MS
from engine.kernels.playing.hands import USUAL_TREMOLO_HZ
from engine.kernels.playing.keys import USUAL_HARMONIC
from engine.presets import Preset
from engine.values.string import Polarisations
from tests.app.instrument.seen import seen
from tests.app.instrument.stage import (
    KEY,
    RATE_HZ,
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

MOVING = Polarisations(angle_deg=30, second_cents=2, conductance_s_kg=0.02, second_conductance_s_kg=0.004)
BUZZING = {"javari": Javari(distance_mm=10, gap_um=3, stiffness_n_m=2e4, loss_s_m=0.5)}
HAMMER = {"shape": "raised_cosine", "width": 0.1, "width_hard": 0.1, "strikes": True, "stops": False}
ADDS = {"pluck": {"stops": False}}
ON, OFF = (0.0, NoteOn(KEY, 60)), (0.3, NoteOff(KEY))
Parts = dict[str, Any]


@pytest.fixture
def instrument(patch: Patch, guitar: Patch) -> Callable[..., Patch]:
    """instrument(name, **parts): the one of tests, its guitar, or a shipped one, with other parts."""
    own = {"test": changed(patch, mod_wheel="knobs.decay"), "guitar": guitar, "six strings": of_six_strings(guitar)}
    return lambda name, **parts: changed(own.get(name) or read_patch(SHIPPED / f"{name}.json"), **parts)


def down(number: int, value: int = 127, channel: int = 0) -> Timed:
    return 0.0, Controller(number, value, channel)


# Two ways to one sound: name, seconds, the one and the other (parts, events), and how far apart at most


AGAIN = (ON, (0.3, NoteOn(KEY, 60)), (0.5, NoteOff(KEY)))
FLEXIBLE = {"pluck": {"shape": "triangular", "width": 0.3, "width_hard": 0.1, "softest_mm": 0.1, "hardest_mm": 0.1}}
PULLED_ON = (down(LEGATO), ON, (0.2, NoteOn(KEY + 3, 90)), (0.4, NoteOff(KEY + 3)), (0.6, NoteOff(KEY)))
CHORD = ((0.0, NoteOn(40, 60)), (0.0, NoteOn(45, 60)))
QUIET = (down(VOLUME, 50, 1), down(EXPRESSION, 64, 1))
ON_1 = (0.0, NoteOn(KEY, 60, 1))
ALIKE: list[tuple[str, float, tuple[Parts, tuple[Timed, ...]], tuple[Parts, tuple[Timed, ...]], float]] = [
    (
        "harmonic: footswitch",
        0.3,
        ({}, (down(HARMONICS), ON)),
        ({"technique": {"harmonic": USUAL_HARMONIC}}, (ON,)),
        0,
    ),
    (
        "harmonic: wheel",
        0.3,
        ({"mod_wheel": "technique.harmonic"}, (down(MOD_WHEEL), ON)),
        ({"technique": {"harmonic": USUAL_HARMONIC}}, (ON,)),
        0,
    ),
    ("harmonic: switched off", 0.3, ({}, (down(HARMONICS), down(HARMONICS, 0), ON)), ({}, (ON,)), 0),
    ("palm mute: pedal", 0.3, ({}, (down(SOFT), ON)), ({"damping": {"mute": 1.0}}, (ON,)), 0),
    (
        "palm mute: wheel",
        0.3,
        ({"mod_wheel": "damping.mute"}, (down(MOD_WHEEL), ON)),
        ({"damping": {"mute": 1.0}}, (ON,)),
        0,
    ),
    *(
        (
            f"vibrato by {by}: wheel",
            0.5,
            ({"mod_wheel": "technique.vibrato_cents", "bend_by": by}, (down(MOD_WHEEL), ON)),
            ({"technique": {"vibrato_cents": 35}, "bend_by": by}, (ON,)),
            0,
        )
        for by in ("tension", "length")
    ),
    ("vibrato: none", 0.3, ({"mod_wheel": "technique.vibrato_cents"}, (ON,)), ({}, (ON,)), 0),
    *(
        (
            f"{field}: wheel",
            0.3,
            ({"mod_wheel": f"technique.{field}"}, (down(MOD_WHEEL), *CHORD)),
            ({"technique": {field: most}}, CHORD),
            0,
        )
        for field, most in (("strum_ms", 40.0), ("tremolo_hz", 12.0))
    ),
    ("let ring", 0.6, ({"damping": {"let_ring": True}}, (ON, OFF)), ({}, (ON,)), 0),
    ("two tracks are one string", 0.6, ({}, (ON, ON, OFF, OFF)), ({}, (ON, OFF)), 0),
    ("a triangle has no width", 0.2, (FLEXIBLE, ((0.0, NoteOn(KEY, 1)),)), (FLEXIBLE, ((0.0, NoteOn(KEY, 127)),)), 0),
    *(
        (
            f"{shape} is no hammer",
            0.1,
            ({"pluck": {**HAMMER, "shape": shape}}, (ON,)),
            ({"pluck": {**HAMMER, "shape": shape, "strikes": False}}, (ON,)),
            0,
        )
        for shape in ("triangular", "rounded")
    ),
    ("volume and expression at their usual", 0.1, ({}, (down(VOLUME, 100), down(EXPRESSION), ON)), ({}, (ON,)), 0),
    ("all is released", 0.1, ({}, (*QUIET, *((0.0, each) for each in release_all([1])), ON_1)), ({}, (ON_1,)), 0),
    ("another channel's volume", 0.1, ({}, (*QUIET, ON)), ({}, (ON,)), 0),
    ("a course of equal strings", 0.9, ({"course": Course(strings=2)}, PULLED_ON), ({}, PULLED_ON), 1e-6),
    (
        "a bridge of one string",
        0.8,
        ({"polarisations": MOVING, "course": Course(bridge=1.0)}, AGAIN),
        ({"polarisations": MOVING}, AGAIN),
        0,
    ),
    (
        "a bridge that does not move",
        0.8,
        ({"course": Course(strings=2, cents=2, bridge=1.0)}, AGAIN),
        ({"course": Course(strings=2, cents=2)}, AGAIN),
        0,
    ),
    ("an edge at no distance", 0.8, ({"javari": Javari(gap_um=3, stiffness_n_m=2e4)}, AGAIN), ({}, AGAIN), 0),
]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(
    ("seconds", "one", "other", "apart"), [row[1:] for row in ALIKE], ids=[row[0] for row in ALIKE]
)
def test_two_ways_to_one_sound(
    patch: Patch, preset: Preset, seconds: float, one: Any, other: Any, apart: float, source: str
) -> None:
    sounds = [
        play(changed(patch, **parts), preset, seconds, *events, source=source) for parts, events in (one, other)
    ]
    assert np.abs(sounds[1]).max() > 1e-3
    np.testing.assert_allclose(*sounds, rtol=0, atol=apart * np.abs(sounds[1]).max())


# Model and truth agree: instrument, parts, events, and the energy of their difference at most


BUSY = (
    *((0.0, NoteOn(45, 110)), (0.2, NoteOn(52, 90))),
    *((0.3 + 0.01 * step, Bend(step / 20)) for step in range(20)),
    *((0.6, NoteOff(45)), (0.7, NoteOn(52, 127)), (0.9, Bend(0.0)), (1.0, Controller(SUSTAIN, 127))),
    *((1.1, NoteOff(52)), (1.2, NoteOn(64, 70)), (1.3, Controller(SUSTAIN, 0))),
)
STEPS = (
    *((0.001, NoteOn(KEY, 60)), (0.002, NoteOn(KEY + 7, 60)), (0.2, Bend(0.5)), (0.31, NoteOn(KEY, 50))),
    *((0.45, Bend(0.0)), (0.5, NoteOff(KEY)), (0.52, NoteOff(KEY + 7)), (0.6, NoteOn(KEY + 2, 40))),
)
TURNED_EDGE = ((0.4, {"javari": {"gap_um": 60}}), (0.55, {"javari": {"gap_um": 0}}))
STRIKES = ((0.0, NoteOn(45, 127)), (0.15, NoteOn(45, 100)), (0.3, NoteOn(64, 127)))
STRUMMED = {
    "course": Course(strings=3, cents=2, apart_ms=3, bridge=1.0),
    "technique": {"strum_ms": 7, "tremolo_hz": 9},
}
AGREE: list[tuple[str, Parts, tuple[Any, ...], float]] = [
    ("test", {}, BUSY, 1e-5),
    ("test", ADDS, BUSY, 1e-5),
    ("test", {"technique": {"harmonic": 3}, "polarisations": Polarisations()}, ((0.0, NoteOn(KEY, 100)),), 1e-6),
    ("test", {"technique": {"tremolo_hz": 10}}, (ON,), 1e-5),
    *(
        (
            "test",
            {
                "pluck": {**HAMMER, "release_ms": 2.0, "release_hard_ms": 0.7},
                "pickup": Pickup(points=(0.3,), kind=kind),
            },
            STRIKES,
            1e-6,
        )
        for kind in ("displacement", "bridge")
    ),
    *(
        (
            "test",
            {"polarisations": MOVING, **parts, "pickup": Pickup(points=(0.2,), kind=kind), **strokes},
            events,
            1e-5,
        )
        for parts, events in ((STRUMMED, STEPS), (BUZZING, (*STEPS, *TURNED_EDGE)))
        for kind, strokes in itertools.product(("bridge", "velocity"), ({}, ADDS))
    ),
    *((name, {}, ((0.0, NoteOn(62, 100)),), 1e-6) for name in ("mandolin", "santur_in_shur")),
    *(
        (name, {}, ((0.0, NoteOn(key, 100)),), 1e-6)
        for name, keys in (("tanpura_drone", (36, 48, 60)), ("sitar", (43, 60, 72)))
        for key in keys
    ),
]


@pytest.mark.parametrize(("name", "parts", "events", "apart"), AGREE)
def test_model_and_truth_agree(
    instrument: Callable[..., Patch], preset: Preset, name: str, parts: Parts, events: tuple[Any, ...], apart: float
) -> None:
    """Under the same hands, with strokes that stop the string or add to it, courses, edges and knobs that turn."""
    patch = instrument(name, **parts)
    timed = sorted(
        ((at_s, PatchTurned(changed(patch, **each)) if isinstance(each, dict) else each) for at_s, each in events),
        key=lambda each: each[0],
    )
    seconds = timed[-1][0] + 0.5
    model, truth = (play(patch, preset, seconds, *timed, source=source) for source in SOURCES)
    assert np.isfinite(model).all() and np.abs(truth).max() > 1e-3
    assert relative(model, truth) < apart


# Pitches: instrument, parts, events, and at which times which frequency is heard, and how near, in cents


MEMBERS = ((0.0, NoteOn(45, 8, 1)), (0.0, NoteOn(57, 8, 2)), (0.02, Bend(4 / 48, 2)))
HAMMERED_ON = (
    *(down(LEGATO), (0.0, NoteOn(KEY, 40)), (0.4, NoteOn(KEY + 3, 127))),
    *((0.8, NoteOff(KEY + 3)), (1.2, NoteOff(KEY))),
)
HALF_S = round(127 * log(0.5 / SLIDE_S[0]) / log(SLIDE_S[1] / SLIDE_S[0]))
SLID = (down(PORTAMENTO), down(SLIDE_TIME, HALF_S), down(LEGATO), (0.0, NoteOn(KEY, 40)), (0.4, NoteOn(KEY + 5, 40)))
PITCHES: list[tuple[str, Parts, tuple[Timed, ...], list[tuple[float, float, float, float]]]] = [
    *(("test", {}, ((0.0, NoteOn(key, 8)),), [(0.1, 1.0, key, 0.5)]) for key in (28, 40, 57, 69, 88)),
    *(
        (
            "test",
            {"bend_by": by},
            ((0.0, NoteOn(57, 8)), (0.05, Bend(bend)), (1.0, Bend(0.0))),
            [(0.1, 0.95, 57 + 2 * bend, 0.5), (1.1, 1.9, 57, 0.5)],
        )
        for by, bend in (("tension", 1.0), ("length", 1.0), ("tension", -1.0))
    ),
    ("test", {"mode": "mpe"}, MEMBERS, [(0.1, 1.0, 45, 0.5), (0.1, 1.0, 61, 0.5)]),
    *(
        (
            "guitar",
            {"mode": mode},
            HAMMERED_ON,
            [(at_s, at_s + 0.17, key, 6) for at_s, key in ((0.1, 45), (0.5, 48), (0.9, 45))],
        )
        for mode in ("poly", "guitar")
    ),
    (
        "guitar",
        {"mode": "poly"},
        (down(LEGATO), (0.0, NoteOn(KEY, 40)), (0.4, NoteOn(KEY - 3, 40))),
        [(0.5, 0.75, KEY, 7), (0.5, 0.75, KEY - 3, 7)],
    ),
    ("guitar", {"mode": "poly"}, SLID, [(0.6, 0.7, KEY + 2.65, 115), (1.1, 1.35, KEY + 5, 7)]),
]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("name", "parts", "events", "heard"), PITCHES)
def test_pitches(
    instrument: Callable[..., Patch], preset: Preset, name: str, parts: Parts, events: Any, heard: Any, source: str
) -> None:
    sound = play(
        instrument(name, **parts), preset, max(end_s for _, end_s, *_ in heard) + 0.05, *events, source=source
    )
    for begin_s, end_s, key, apart in heard:
        found = pitch_hz(sound, hz_of(key), begin_s, end_s, max(0.03, apart / 1200))
        assert abs(cents(found, hz_of(key))) < apart, (begin_s, key)


# Levels: parts, events, and by how many dB a stretch is louder than that of the key alone, which is held


def volume_db(value: int, most: int = 100) -> float:
    return 40 * log10(value / most)


LOUDER: list[tuple[str, Parts, tuple[Timed, ...], list[tuple[float, float, float, float]]]] = [
    ("released", {}, (ON, OFF), [(0.0, 0.29, 0, 0), (0.5, 0.6, -300, -50)]),
    (
        "the pedal holds",
        {},
        (down(SUSTAIN), ON, OFF, (0.8, Controller(SUSTAIN, 0))),
        [(0.0, 0.79, 0, 0), (1.0, 1.1, -300, -50)],
    ),
    ("all sound off", {}, (ON, (0.1, NoteOn(57, 90)), (0.4, Controller(SOUND_OFF, 0))), [(0.5, 1.0, -300, -180)]),
    ("two hammers add", ADDS, (ON, ON, OFF, OFF), [(0.1, 0.29, 5, 7), (0.6, 0.7, -300, -50)]),
    ("a soft hammer leaves what rings", ADDS, (ON, (0.4, NoteOn(KEY, 2))), [(0.45, 0.6, -1.5, 1.5)]),
    ("volume", {}, (down(VOLUME, 50), ON), [(0.0, 0.2, volume_db(50), volume_db(50))]),
    ("no volume", {}, (down(VOLUME, 0), ON), [(0.0, 0.2, -300, -180)]),
    ("expression", {}, (down(EXPRESSION, 64), ON), [(0.0, 0.2, volume_db(64, 127), volume_db(64, 127))]),
    (
        "a reset leaves the volume",
        {},
        (*QUIET, (0.0, Controller(RESET, 0, 1)), ON_1),
        [(0, 0.2, volume_db(50), volume_db(50))],
    ),
    (
        "a crescendo",
        {},
        (ON, (0.5, Controller(EXPRESSION, 40))),
        [(0.0, 0.49, 0, 0), (0.6, 0.7, volume_db(40, 127), volume_db(40, 127))],
    ),
    ("muted", {}, (down(SOFT), ON), [(0.8, 0.9, -300, -20)]),
    ("a mute that is lifted", {}, (down(SOFT), ON, (0.05, Controller(SOFT, 0))), [(0.8, 0.9, -20, -0.5)]),
    ("each key plucks", {}, (ON, (0.4, NoteOn(KEY + 3, 127))), [(0.4, 0.6, 6, 40)]),
    ("a hammer-on plucks nothing", {}, (down(LEGATO), ON, (0.4, NoteOn(KEY + 3, 127))), [(0.45, 0.6, -6, 1)]),
    ("a legato release", {}, (*PULLED_ON[:2], *((at_s, e) for at_s, e in PULLED_ON[2:])), [(0.9, 1.0, -300, -20)]),
]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("parts", "events", "heard"), [row[1:] for row in LOUDER], ids=[row[0] for row in LOUDER])
def test_levels(patch: Patch, preset: Preset, parts: Parts, events: Any, heard: Any, source: str) -> None:
    seconds = max(end_s for _, end_s, *_ in heard)
    sound, alone = (play(changed(patch, **parts), preset, seconds, *each, source=source) for each in (events, (ON,)))
    for begin_s, end_s, low_db, high_db in heard:
        found = level_db(sound, begin_s, end_s) - level_db(alone, begin_s, end_s)
        assert low_db - 0.02 <= found <= high_db + 0.02, begin_s


# Hands: what is played, and then how the notes that were struck are, by their numbers, and which keys ring


CONTROLS = {
    **{"pedal": SUSTAIN, "wheel": MOD_WHEEL, "reset": RESET, "legato": LEGATO, "value": VALUE, "fine": FINE_VALUE},
    **{"more": INCREMENT, "less": DECREMENT, "coarse-rpn": REGISTERED, "rpn": FINE_REGISTERED},
    **{"coarse-nrpn": OTHER, "nrpn": FINE_OTHER, **{f"mode{number}": number for number in range(NOTES_OFF, 128)}},
}
SCORES = f"""
test: a reset leaves the next key and the ringing one in tune and lifts the pedal
bend 1, pedal 127, wheel 127, on 57 => 0 bent 2, 0 held
off 57 => 0 kept
reset 0 => 0 damped
on 52 => 1 bent 0

test: what a file leaves behind bends no key of the computer
on 45, bend 1, rest, on 57 @16 => 0 damped, 1 bent 0

test: a channel's reset leaves the others
on 45, bend 1, on 57 @1, bend 1 @1, rest => 0 damped, 1 held, 1 bent 2

test: the first channel's wheel and pedal hold for the computer's keys
on 57 @16, bend .5, pedal 127, off 57 @16 => 0 bent 1, 0 kept
mode123 0 => 0 kept
pedal 0 => 0 damped

test: another instrument begins with wheels at rest and the foot on the pedal
on 40, range 12 0, bend 1, wheel 127, pedal 127, turn knobs.decay 1.1, on 45 => 1 bent 12
another, on 57, off 57 => 2 kept, 2 bent 0
bend .5, on 52 => 3 bent 1

six strings: a release belongs to the stroke before it
on 64 @1, on 64 @1, off 64 @1 => 1 held
off 64 @1 => 1 damped
on 64 @1, off 64 @1, off 64 @1, on 64 @1 => 3 held
off 64 @1 => 3 damped
on 64 @1, on 64 @1, rest @1, on 64 @1 => 6 held
off 64 @1 => 6 damped

six strings: so it does on the computer's keys
on 64 @16, on 64 @16, off 64 @16 => 1 held
off 64 @16 => 1 damped
on 64 @16, on 64 @16, rest @16, on 64 @16, off 64 @16 => 4 damped

test: the pedal keeps the latest stroke of a key
pedal 127, on 57, on 57, off 57 => 1 held
off 57 => 1 kept
pedal 0 => 1 damped

test: channels release their own strokes of one string
on 57, on 57 @1, off 57 => 1 held, rings 57
off 57 @1 => 1 damped

test: under legato a key that was struck twice is pulled off after its last release
legato 127, on 57, on 60, on 57, off 57 => rings 57, 2 held
off 57 => rings 60, 2 held
off 60 => 2 damped
{
    "".join(
        f'''
test: message of modes {number} releases all keys
on 57, on 57, mode{number} 0 => 1 damped
on 57, off 57 => 2 damped
'''
        for number in range(NOTES_OFF, 128)
    )
}
test: the range of bends is its channel's
range 12 0, bend .5, on 45 => 0 bent 6
bend .5 @1, on 57 @1 => 1 bent 1
range 1 50 => 1 bent 1, 0 bent 0.75
reset 0, bend .5, on 52 => 2 bent 0.75
rest, bend .5, on 55 => 3 bent 1
range 127 127, bend .125, on 40 => 4 bent {WIDEST_SEMITONES / 8}

test: another parameter sets no range, nor does none
value 24, bend 1, on 45 => 0 bent 2
range 3 0, coarse-nrpn 0, nrpn 0, value 24, on 50 => 1 bent 3
range 3 0, coarse-rpn 0, rpn 3, value 24, on 52 => 2 bent 3
range 3 0, coarse-rpn 127, rpn 127, value 24, on 54 => 3 bent 3

mpe: the members bend by 48 semitones unless messages say other
bend .125 @1, on 45 @1 => 0 bent 6
range 24 0 @1 => 0 bent 3
bend .5 => 0 bent 4
range 4 0 => 0 bent 5
on 57 @16 => 1 bent 2

mpe: a member's range is that of all members, the master's its own
range 12 0 @1, bend 1 @2, on 45 @2 => 0 bent 12
bend 1 => 0 bent 14

test: the range of bends is set in cents and by steps
coarse-rpn 0, rpn 0, fine 50, bend 1, on 45 => 0 bent 2.5
more 0 => 0 bent 2.51
less 0, less 0 => 0 bent 2.49
reset 0, bend 1, more 0, value 9 => 0 bent 2.49

test: registered parameters tune a channel
on 45 @1, on 52 @2, fine-tuning 96 @1 => 0 bent 0.5
coarse-tuning 61 @1 => 0 bent -2.5, 1 bent 0
reset 0 @1, on 57 @1 => 2 bent -2.5
rest @1, on 55 @1 => 3 bent 0

six strings: a channel is one string, wherever it is stopped, once another channel has played
on 64 @1 => 0 on 1
on 64 @0, on 64 @2, on 52 @5 => 1 on 0, 2 on 2, 3 on 5
on 57 @1 => 4 on 1, rings 64 64 52 57
bend 1 @1 => 4 on 1, 4 bent 2
on 61 @0, on 65 @0 => rings 64 52 57 65

six strings: the computer's keys sound together, each on the string it chooses
on 60 @16, on 62 @16, on 64 @16, on 67 @16 => rings 60 62 64 67, 0 on 1, 1 on 1, 2 on 0, 3 on 0

six strings: a keyboard on the first channel sounds together, with drums beside it
on 48, on 52, on 55, on 36 @9 => rings 48 52 55 36

six strings: far below a string and beyond the set the key chooses
on 47 @1, on 65 @6, on 66 @6 => 0 on 4, 1 on 0, rings 47 65 66

six strings: a note may give its string
on 64 @16 s1, on 64 @16 s0, on 45 @16 s5 => 0 on 1, 1 on 0, 2 on 5, rings 64 64 45
off 64 @16 s0 => 0 held, 1 damped, 2 held
on 66 @16 s1 => 3 on 1, rings 64 45 66
on 64 @16 s6 => 4 on 0

poly strings: a note may give its string on a keyboard's instrument too
on 64 s1, on 64 s0, on 45 s5 => 0 on 1, 1 on 0, 2 on 5, rings 64 64 45
off 64 s0 => 0 held, 1 damped, 2 held

poly strings: a slide stays on its string while another is held
legato 127, on 52 s5, on 57 s2, on 64 s5, off 52 s5 => rings 64 57, 0 on 5

six strings: with its input at rest a guitar is forgotten
on 64 @0, on 59 @1, on 65 @0, on 67 @0 => rings 64 59 67
rest @0, rest @1, on 72, on 76 => rings 64 59 67 72 76
"""


def events_of(text: str, patch: Patch) -> list[Event]:
    """The events of an entry of a score: a word, numbers, the channel behind @ and the string behind s."""
    word, *rest = text.split()
    channel = next((int(each[1:]) for each in rest if each[0] == "@"), 0)
    string = next((int(each[1:]) for each in rest if each[0] == "s"), None)
    numbers = [float(each) for each in rest if each[0] in "-.0123456789"]
    first, second = (int(each) for each in (*numbers, 0, 0)[:2])
    match word:
        case "on":
            return [NoteOn(first, 60, channel, string=string)]
        case "off":
            return [NoteOff(first, channel, string)]
        case "bend":
            return [Bend(numbers[0], channel)]
        case "rest":
            return release_all([channel])
        case "range":
            return parameter_set(0, first, second, channel)
        case "fine-tuning" | "coarse-tuning":
            return parameter_set(FINE_TUNING if word[0] == "f" else COARSE_TUNING, first, 0, channel)
        case "turn":
            return [PatchTurned(patch.with_value(rest[0], numbers[0]))]
        case "another":
            return [PatchTurned(changed(patch, name="another", damping={"release_t60_s": 0.2}))]
        case _:
            return [Controller(CONTROLS[word], first, channel)]


def check(text: str, stage: Stage) -> None:
    if text.startswith("rings"):
        assert stage.sounding == [int(each) for each in text.split()[1:]]
        return
    number, said, *value = text.split()
    note = stage.struck[int(number)]
    if said == "bent":
        assert note.semitones == pytest.approx(float(value[0]), abs=1e-6)
    elif said == "on":
        assert note.now.now.area_m2 == pytest.approx(5e-7 * 1.1 ** (5 - int(value[0])))
        assert note.now.now.pitch_hz == pytest.approx(hz_of(note.now.key + note.semitones), rel=1e-6)
    else:
        assert note.state == said


@pytest.mark.parametrize("score", SCORES.strip().split("\n\n"), ids=lambda score: score.split("\n")[0])
def test_hands(patch: Patch, guitar: Patch, preset: Preset, score: str) -> None:
    title, *lines = score.strip().split("\n")
    strung = of_six_strings(guitar)
    own = {"test": changed(patch, mod_wheel="knobs.decay"), "mpe": changed(patch, mode="mpe"), "six strings": strung}
    stage = Stage({**own, "poly strings": changed(strung, mode="poly")}[title.split(":")[0]], preset)
    for line in lines:
        played, _, expected = line.partition(" => ")
        for text in played.split(", "):
            stage.play(*events_of(text, stage.player.patch))
        for text in expected.split(", "):
            check(text, stage)


# Strokes: parts, events by their frames, for how many frames, and which keys begin at which frames


def technique(**values: float) -> Parts:
    return {"technique": values}


SIX = (50, 40, 64, 45, 59, 55)
LATE = round(CHORD_S * RATE_HZ) + 1
SPREAD = round(USUAL_STRUM_MS / 1000 * RATE_HZ)
TURNS = [(1 + 9_600 * turn, NoteOn(key, 60)) for turn in (0, 1, 2, 4) for key in (45, 40, 50)]
STROKES: list[tuple[str, Parts, list[tuple[int, Event]], int, list[tuple[int, int]]]] = [
    *(
        (
            f"a chord at {frame}, strokes {strokes}",
            technique(strum_ms=10, strokes=strokes),
            [(frame, NoteOn(key, 60)) for key in SIX],
            8_192,
            [(key, frame + 480 * n) for n, key in enumerate(sorted(SIX, reverse=strokes == 1))],
        )
        for frame in (0, 1_000)
        for strokes in (0, 1)
    ),
    (
        "strokes alternate from chord to chord, and one note is no chord",
        technique(strum_ms=5, strokes=2),
        sorted([*TURNS, (28_800, NoteOn(60, 60))], key=lambda each: each[0]),
        9_600 * 5,
        [
            *((key, 1 + 240 * n) for n, key in enumerate((40, 45, 50))),
            *((key, 9_601 + 240 * n) for n, key in enumerate((50, 45, 40))),
            *((key, 19_201 + 240 * n) for n, key in enumerate((40, 45, 50))),
            (60, 28_800),
            *((key, 38_401 + 240 * n) for n, key in enumerate((50, 45, 40))),
        ],
    ),
    (
        "fingers that come one by one are a chord",
        technique(strum_ms=20),
        [(100, NoteOn(50, 60)), (300, NoteOn(59, 60)), (420, NoteOn(45, 60)), (100 + LATE, NoteOn(70, 60))],
        6_000,
        [(50, 100), (45, 1_060), (70, 100 + LATE), (59, 2_020)],
    ),
    *(
        (
            f"controller {number} forgets the strings to come",
            technique(strum_ms=40),
            [*((64, NoteOn(key, 60)) for key in (40, 45, 50)), (640, Controller(number, 0))],
            9_600,
            [(40, 64)],
        )
        for number in (NOTES_OFF, SOUND_OFF)
    ),
    *(
        (
            f"the footswitch of strums, channel {channel}",
            {},
            [(0, Controller(STRUM, 127, KEYS)), *((0, NoteOn(key, 60, channel)) for key in (40, 45))],
            4_096,
            [(40, 0), (45, apart)],
        )
        for channel, apart in ((KEYS, SPREAD), (3, 0))
    ),
    (
        "a key that is held plucks again",
        technique(tremolo_hz=12),
        [(1_000, NoteOn(KEY, 60)), (18_000, NoteOff(KEY))],
        RATE_HZ,
        [(KEY, 1_000 + 4_000 * turn) for turn in range(5)],
    ),
    (
        "the pedal plucks nothing",
        technique(tremolo_hz=10),
        [(0, Controller(SUSTAIN, 127)), (0, NoteOn(KEY, 60)), (640, NoteOff(KEY))],
        RATE_HZ,
        [(KEY, 0)],
    ),
    (
        "the footswitch of tremolo, until a reset",
        {},
        [(0, Controller(TREMOLO, 127)), (0, NoteOn(KEY, 60)), (RATE_HZ // 2, Controller(RESET, 0))],
        RATE_HZ,
        [(KEY, round(turn * RATE_HZ / USUAL_TREMOLO_HZ)) for turn in range(5)],
    ),
]


@pytest.mark.parametrize("block", [64, 4_096])
@pytest.mark.parametrize(
    ("parts", "events", "frames", "begun"), [row[1:] for row in STROKES], ids=[r[0] for r in STROKES]
)
def test_strokes_begin_at_their_frames(
    patch: Patch, preset: Preset, parts: Parts, events: Any, frames: int, begun: list[tuple[int, int]], block: int
) -> None:
    """Whatever block is rendered; each note ends once, and what was not begun is refused."""
    stage = Stage(changed(patch, **parts), preset)
    stage.run(events, frames, block)
    assert [(each.key, each.frame) for each in stage.begun] == begun
    struck = {(each.key, frame) for frame, each in events if isinstance(each, NoteOn)}
    refused = [each.key for each in stage.reports if each.kind == of.REFUSED]
    assert len({each.id for each in stage.begun}) + len(refused) == len(struck)


# Chords of six strings


def test_the_strings_of_a_chord_are_strummed_by_string(guitar: Patch, preset: Preset) -> None:
    """On the fifth string a key may be higher than that on the fourth."""
    stage = Stage(changed(guitar, technique={"strum_ms": 10}), preset)
    chord = [(1_000, NoteOn(key, 60, channel)) for channel, key in ((3, 50), (4, 57), (5, 45))]
    stage.run([(0, NoteOn(64, 1, 1)), *chord], 4_096)
    assert [each.channel for each in stage.begun[1:]] == [5, 4, 3]


def test_a_short_key_of_a_chord_is_as_short_when_its_turn_comes(patch: Patch, preset: Preset) -> None:
    stage = Stage(changed(patch, technique={"strum_ms": 40}), preset)
    chord = [(64, NoteOn(key, 60)) for key in (40, 45)] + [(640, NoteOff(key)) for key in (40, 45)]
    for frames, held in ((64 + 1_920 + 512, {40: False, 45: True}), (128, {40: False, 45: False})):
        stage.run(chord, frames)
        assert {note.key: note.held for note in seen(stage.player)} == held
        chord = []


def test_one_key_on_two_strings_is_two_courses(guitar: Patch, preset: Preset) -> None:
    """Legato moves the course of the string that is given, and a release ends that alone."""
    stage = Stage(changed(guitar, course=Course(strings=2)), preset)
    events = [(0, Controller(LEGATO, 127)), *((64 * n, NoteOn(59, 60, string=n)) for n in (1, 2))]
    stage.run([*events, (960, NoteOn(61, 60, string=1))], 1_920)
    assert sorted(note.key for note in seen(stage.player)) == [59, 59, 61, 61]
    stage.run([(0, NoteOff(59, string=2))], 640)
    assert sorted(note.key for note in seen(stage.player) if note.held) == [61, 61]
