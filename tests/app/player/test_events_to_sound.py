"""Events to sound: what keys, hands, techniques, strokes and courses of an instrument must sound like, row by row.

A row has an instrument, `name field=value …:`, and a score: events, each with its time before it where that is not 0.
`on` and `off` have a key; `v` is a velocity (else 60), `@` a channel, `s` a string.
"""

from collections.abc import Callable
from math import log, log10
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
from engine.kernels.playing.channels import SLIDE_S, WIDEST_SEMITONES
from engine.kernels.playing.chords import CHORD_S, USUAL_STRUM_MS
from engine.kernels.playing.hands import USUAL_TREMOLO_HZ
from engine.kernels.playing.keys import USUAL_HARMONIC
from tests.app.player.stage import (
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

CONTROLS = {
    **{name.lower().replace("_", "-"): number for name, number in vars(midi).items() if isinstance(number, int)},
    **{"pedal": midi.SUSTAIN, "wheel": midi.MOD_WHEEL, "mute": midi.SOFT, "fine": midi.FINE_VALUE},
    **{"coarse-rpn": midi.REGISTERED, "rpn": midi.FINE_REGISTERED, "more": midi.INCREMENT, "less": midi.DECREMENT},
    **{"coarse-nrpn": midi.OTHER, "nrpn": midi.FINE_OTHER},
    **{f"mode{number}": number for number in range(midi.NOTES_OFF, 128)},
}
BUNDLES = {  # of fields
    "hammer": "pluck.shape=raised_cosine pluck.width=0.1 pluck.width_hard=0.1 pluck.strikes=yes pluck.stops=no",
    "adds": "pluck.stops=no",
    "slow": "pluck.release_ms=2 pluck.release_hard_ms=0.7",
    "moving": "polarisations.angle_deg=30 polarisations.second_cents=2 polarisations.conductance_s_kg=0.02"
    " polarisations.second_conductance_s_kg=0.004",
    "strummed": "course.strings=3 course.cents=2 course.apart_ms=3 course.bridge=1 technique.strum_ms=7"
    " technique.tremolo_hz=9",
    "edge": "javari.gap_um=3 javari.stiffness_n_m=20000 javari.loss_s_m=0.5",
    "flexible": "pluck.width=0.3 pluck.width_hard=0.1 pluck.softest_mm=0.1 pluck.hardest_mm=0.1",
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


def rows(table: str) -> list[list[str]]:
    return [[each.strip() for each in line.split("|")] for line in table.strip().split("\n")]


def numbers_of(text: str) -> list[list[float]]:
    return [[float(each) for each in part.split()] for part in text.split(";")]


# Two ways to one sound, over some seconds, and how far apart they are at most


AGAIN = "on 45, .3 on 45, .5 off 45"
PULLED_ON = "legato 127, on 45, .2 on 48 v90, .4 off 48, .6 off 45"
ALIKE = f"""
test: harmonics 64, on 45                | test technique.harmonic={USUAL_HARMONIC}: on 45  | 0.3 0
test mod_wheel=technique.harmonic: wheel 127, on 45 | test technique.harmonic={USUAL_HARMONIC}: on 45 | 0.3 0
test: harmonics 64, harmonics 63, on 45  | test: on 45                                      | 0.3 0
test: mute 127, on 45                    | test damping.mute=1: on 45                       | 0.3 0
test mod_wheel=damping.mute: wheel 127, on 45 | test damping.mute=1: on 45                  | 0.3 0
test mod_wheel=technique.vibrato_cents: wheel 127, on 45 | test technique.vibrato_cents=35: on 45 | 0.5 0
test mod_wheel=technique.vibrato_cents bend_by=length: wheel 127, on 45 | test technique.vibrato_cents=35 bend_by=length: on 45 | 0.5 0
test mod_wheel=technique.vibrato_cents: on 45 | test: on 45                                 | 0.3 0
test mod_wheel=technique.strum_ms: wheel 127, on 40, on 45 | test technique.strum_ms=40: on 40, on 45 | 0.3 0
test mod_wheel=technique.tremolo_hz: wheel 127, on 45 | test technique.tremolo_hz=12: on 45 | 0.3 0
test technique.strum_ms=40: on 40, on 45, .012 off 40, .012 off 45 | test: on 40, .04 on 45, .012 off 40, .052 off 45 | 0.2 0
test damping.let_ring=yes: on 45, .3 off 45 | test: on 45                                   | 0.6 0
test: on 45, on 45, .3 off 45, .3 off 45 | test: on 45, .3 off 45                           | 0.6 0
test flexible pluck.shape=triangular: on 45 v1 | test flexible pluck.shape=triangular: on 45 v127 | 0.2 0
test hammer pluck.shape=triangular: on 45 | test hammer pluck.shape=triangular pluck.strikes=no: on 45 | 0.1 0
test hammer pluck.shape=rounded: on 45   | test hammer pluck.shape=rounded pluck.strikes=no: on 45 | 0.1 0
test: volume 100, expression 127, on 45  | test: on 45                                      | 0.1 0
test: volume 50 @1, expression 64 @1, rest @1, on 45 @1 | test: on 45 @1                    | 0.1 0
test: volume 50 @1, expression 64 @1, on 45 | test: on 45                                   | 0.1 0
test course.strings=2: {PULLED_ON}       | test: {PULLED_ON}                                | 0.9 1e-6
test moving course.bridge=1: {AGAIN}     | test moving: {AGAIN}                             | 0.8 0
test course.strings=2 course.cents=2 course.bridge=1: {AGAIN} | test course.strings=2 course.cents=2: {AGAIN} | 0.8 0
test edge javari.distance_mm=10 javari.gap_um=200: on 45 v20 | test: on 45 v20 | 0.3 1e-4
test edge javari.distance_mm=0: {AGAIN}  | test: {AGAIN}                                    | 0.8 0
"""  # noqa: E501


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("one", "other", "bounds"), rows(ALIKE))
def test_two_ways_to_one_sound(read, one, other, bounds, source):
    ((seconds, apart),) = numbers_of(bounds)
    sounds = [play(instrument, seconds, *events, source=source) for instrument, events in map(read, (one, other))]
    assert np.abs(sounds[1]).max() > 1e-3
    np.testing.assert_allclose(*sounds, rtol=0, atol=apart * np.abs(sounds[1]).max())


# Model and truth agree: the energy of their difference, re the truth's, is below a bound


BENDS = ", ".join(f"{0.3 + 0.01 * step:.2f} bend {step / 20}" for step in range(20))
BUSY = f"on 45 v110, .2 on 52 v90, {BENDS}, .6 off 45, .7 on 52 v127, .9 bend 0, 1 pedal 127, 1.1 off 52, 1.2 on 64"
STEPS = ".001 on 45, .002 on 52, .2 bend .5, .31 on 45 v50, .45 bend 0, .5 off 45, .52 off 52, .6 on 47 v40"
EDGED = STEPS.replace(".45", ".4 turn javari.gap_um=60, .45").replace(".6", ".55 turn javari.gap_um=0, .6")
AGREE = f"""
test: {BUSY}, 1.3 pedal 0      | 1e-5
test adds: {BUSY}, 1.3 pedal 0 | 1e-5
test technique.harmonic=3 polarisations.angle_deg=30: on 45 v100 | 1e-6
test technique.tremolo_hz=10: on 45 | 1e-5
test hammer slow pickup.points=0.3: on 45 v127, .15 on 45 v100, .3 on 64 v127 | 1e-6
test hammer slow pickup.kind=bridge: on 45 v127, .15 on 45 v100, .3 on 64 v127 | 1e-6
test moving strummed pickup.points=0.2 pickup.kind=bridge: {STEPS}        | 1e-5
test moving strummed pickup.points=0.2 pickup.kind=velocity: {STEPS}      | 1e-5
test moving strummed pickup.points=0.2 pickup.kind=bridge adds: {STEPS}   | 1e-5
test moving strummed pickup.points=0.2 pickup.kind=velocity adds: {STEPS} | 1e-5
test moving edge javari.distance_mm=10 pickup.kind=bridge: {EDGED}        | 1e-5
test moving edge javari.distance_mm=10 pickup.kind=velocity: {EDGED}      | 1e-5
test moving edge javari.distance_mm=10 pickup.kind=bridge adds: {EDGED}   | 1e-5
test moving edge javari.distance_mm=10 pickup.kind=velocity adds: {EDGED} | 1e-5
mandolin: on 62 v100           | 1e-6
santur_in_shur: on 62 v100     | 1e-6
tanpura_drone: on 36 v100      | 1e-6
tanpura_drone: on 60 v100      | 1e-6
sitar: on 43 v100              | 1e-6
sitar: on 72 v100              | 1e-6
"""


@pytest.mark.parametrize(("played", "apart"), rows(AGREE))
def test_model_and_truth_agree(read, played, apart):
    instrument, events = read(played)
    model, truth = (play(instrument, events[-1][0] + 0.5, *events, source=source) for source in SOURCES)
    assert np.isfinite(model).all() and np.abs(truth).max() > 1e-3
    assert relative(model, truth) < float(apart)


# Pitches: from when until when a key is heard, and how near to it, in cents


HAMMERED_ON = "legato 127, on 45 v40, .4 on 48 v127, .8 off 48, 1.2 off 45"
HALF_S = round(127 * log(0.5 / SLIDE_S[0]) / log(SLIDE_S[1] / SLIDE_S[0]))
PITCHES = f"""
test: on 28 v8 | .1 1 28 .5
test: on 40 v8 | .1 1 40 .5
test: on 57 v8 | .1 1 57 .5
test: on 88 v8 | .1 1 88 .5
test: on 57 v8, .05 bend 1, 1 bend 0                | .1 .95 59 .5; 1.1 1.9 57 .5
test: on 57 v8, .05 bend -1, 1 bend 0               | .1 .95 55 .5; 1.1 1.9 57 .5
test bend_by=length: on 57 v8, .05 bend 1, 1 bend 0 | .1 .95 59 .5; 1.1 1.9 57 .5
test mode=mpe: on 45 v8 @1, on 57 v8 @2, .02 bend {4 / 48} @2 | .1 1 45 .5; .1 1 61 .5
guitar mode=poly: {HAMMERED_ON} | .1 .27 45 6; .5 .67 48 6; .9 1.07 45 6
guitar: {HAMMERED_ON}           | .1 .27 45 6; .5 .67 48 6; .9 1.07 45 6
guitar mode=poly: legato 127, on 45 v40, .4 on 42 v40 | .5 .75 45 7; .5 .75 42 7
guitar mode=poly: portamento 64, slide-time {HALF_S}, legato 64, on 45, .4 on 50 | .6 .7 47.65 115; 1.1 1.35 50 7
"""


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("played", "heard"), rows(PITCHES))
def test_pitches(read, played, heard, source):
    instrument, events = read(played)
    windows = numbers_of(heard)
    sound = play(instrument, windows[-1][1] + 0.05, *events, source=source)
    for begin_s, end_s, key, apart in windows:
        found = pitch_hz(sound, hz_of(key), begin_s, end_s, max(0.03, apart / 1200))
        assert abs(cents(found, hz_of(key))) < apart, (begin_s, key)


# Levels: from when until when, and between which dB re the key alone, which is held


HALF_DB, EXPRESSED_DB, SOFTER_DB = (40 * log10(value) for value in (50 / 100, 64 / 127, 40 / 127))
LOUDER = f"""
test: on 45, .3 off 45                                  | 0 .29 0 0; .5 .6 -300 -50
test: pedal 127, on 45, .3 off 45, .8 pedal 0           | 0 .79 0 0; 1 1.1 -300 -50
test: on 45, .1 on 57 v90, .4 sound-off 0               | .5 1 -300 -180
test adds: on 45, on 45, .3 off 45, .3 off 45           | .1 .29 5 7; .6 .7 -300 -50
test adds: on 45, .4 on 45 v2                           | .45 .6 -1.5 1.5
test: volume 50, on 45                                  | 0 .2 {HALF_DB} {HALF_DB}
test: volume 0, on 45                                   | 0 .2 -300 -180
test: expression 64, on 45                              | 0 .2 {EXPRESSED_DB} {EXPRESSED_DB}
test: volume 50 @1, expression 64 @1, reset 0 @1, on 45 @1 | 0 .2 {HALF_DB} {HALF_DB}
test: on 45, .5 expression 40                           | 0 .49 0 0; .6 .7 {SOFTER_DB} {SOFTER_DB}
test: mute 127, on 45                                   | .8 .9 -300 -20
test: mute 127, on 45, .05 mute 0                       | .8 .9 -20 -0.5
test: on 45, .4 on 48 v127                              | .4 .6 6 40
test: legato 127, on 45, .4 on 48 v127                  | .45 .6 -6 1
test: {PULLED_ON}                                       | .9 1 -300 -20
"""


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("played", "heard"), rows(LOUDER))
def test_levels(read, played, heard, source):
    windows = numbers_of(heard)
    instrument, events = read(played)
    sound, alone = (
        play(instrument, windows[-1][1], *each, source=source) for each in (events, [(0.0, NoteOn(45, 60))])
    )
    for begin_s, end_s, low_db, high_db in windows:
        found = level_db(sound, begin_s, end_s) - level_db(alone, begin_s, end_s)
        assert low_db - 0.02 <= found <= high_db + 0.02, begin_s


# Hands: what is played, and then how the notes that were struck are, by their numbers, and which keys ring


SCORES = f"""
test: a foot is on a pedal from 64 on
pedal 64, on 57, off 57 => 0 kept
pedal 63 => 0 damped
legato 64, on 45, on 48 => rings 57 48
legato 63, on 50 => rings 57 48 50

test mod_wheel=knobs.decay: a reset leaves the next key and the ringing one in tune and lifts the pedal
bend 1, pedal 127, wheel 127, on 57 => 0 bent 2, 0 held
off 57 => 0 kept
reset 0 => 0 damped
on 52 => 1 bent 0

test mod_wheel=knobs.decay: what a file leaves behind bends no key of the computer
on 45, bend 1, rest, on 57 @16 => 0 damped, 1 bent 0

test mod_wheel=knobs.decay: a channel's reset leaves the others
on 45, bend 1, on 57 @1, bend 1 @1, rest => 0 damped, 1 held, 1 bent 2

test mod_wheel=knobs.decay: the first channel's wheel and pedal hold for the computer's keys
on 57 @16, bend .5, pedal 127, off 57 @16 => 0 bent 1, 0 kept
mode123 0 => 0 kept
pedal 0 => 0 damped

test mod_wheel=knobs.decay: another instrument begins with wheels at rest and the foot on the pedal
on 40, range 12 0, bend 1, wheel 127, pedal 127, turn knobs.decay=1.1, on 45 => 1 bent 12
another, on 57, off 57 => 2 kept, 2 bent 0
bend .5, on 52 => 3 bent 1

six: a release belongs to the stroke before it
on 64 @1, on 64 @1, off 64 @1 => 1 held
off 64 @1 => 1 damped
on 64 @1, off 64 @1, off 64 @1, on 64 @1 => 3 held
off 64 @1 => 3 damped
on 64 @1, on 64 @1, rest @1, on 64 @1 => 6 held
off 64 @1 => 6 damped

six: so it does on the computer's keys
on 64 @16, on 64 @16, off 64 @16 => 1 held
off 64 @16 => 1 damped
on 64 @16, on 64 @16, rest @16, on 64 @16, off 64 @16 => 4 damped

test mod_wheel=knobs.decay: the pedal keeps the latest stroke of a key
pedal 127, on 57, on 57, off 57 => 1 held
off 57 => 1 kept
pedal 0 => 1 damped

test mod_wheel=knobs.decay: channels release their own strokes of one string
on 57, on 57 @1, off 57 => 1 held, rings 57
off 57 @1 => 1 damped

test mod_wheel=knobs.decay: under legato a key that was struck twice is pulled off after its last release
legato 127, on 57, on 60, on 57, off 57 => rings 57, 2 held
off 57 => rings 60, 2 held
off 60 => 2 damped
{
    "".join(
        f'''
test mod_wheel=knobs.decay: message of modes {number} releases all keys
on 57, on 57, mode{number} 0 => 1 damped
on 57, off 57 => 2 damped
'''
        for number in range(midi.NOTES_OFF, 128)
    )
}
test mod_wheel=knobs.decay: the range of bends is its channel's
range 12 0, bend .5, on 45 => 0 bent 6
bend .5 @1, on 57 @1 => 1 bent 1
range 1 50 => 1 bent 1, 0 bent 0.75
reset 0, bend .5, on 52 => 2 bent 0.75
rest, bend .5, on 55 => 3 bent 1
range 127 127, bend .125, on 40 => 4 bent {WIDEST_SEMITONES / 8}

test mod_wheel=knobs.decay: another parameter sets no range, nor does none
value 24, bend 1, on 45 => 0 bent 2
range 3 0, coarse-nrpn 0, nrpn 0, value 24, on 50 => 1 bent 3
range 3 0, coarse-rpn 0, rpn 3, value 24, on 52 => 2 bent 3
range 3 0, coarse-rpn 127, rpn 127, value 24, on 54 => 3 bent 3

test mode=mpe: the members bend by 48 semitones unless messages say other
bend .125 @1, on 45 @1 => 0 bent 6
range 24 0 @1 => 0 bent 3
bend .5 => 0 bent 4
range 4 0 => 0 bent 5
on 57 @16 => 1 bent 2

test mode=mpe: a member's range is that of all members, the master's its own
range 12 0 @1, bend 1 @2, on 45 @2 => 0 bent 12
bend 1 => 0 bent 14

test mod_wheel=knobs.decay: the range of bends is set in cents and by steps
coarse-rpn 0, rpn 0, fine 50, bend 1, on 45 => 0 bent 2.5
more 0 => 0 bent 2.51
less 0, less 0 => 0 bent 2.49
reset 0, bend 1, more 0, value 9 => 0 bent 2.49

test mod_wheel=knobs.decay: registered parameters tune a channel
on 45 @1, on 52 @2, fine-tuning 96 @1 => 0 bent 0.5
coarse-tuning 61 @1 => 0 bent -2.5, 1 bent 0
reset 0 @1, on 57 @1 => 2 bent -2.5
rest @1, on 55 @1 => 3 bent 0

six: a channel is one string, wherever it is stopped, once another channel has played
on 64 @1 => 0 on 1
on 64 @0, on 64 @2, on 52 @5 => 1 on 0, 2 on 2, 3 on 5
on 57 @1 => 4 on 1, rings 64 64 52 57
bend 1 @1 => 4 on 1, 4 bent 2
on 61 @0, on 65 @0 => rings 64 52 57 65

six: the computer's keys sound together, each on the string it chooses
on 60 @16, on 62 @16, on 64 @16, on 67 @16 => rings 60 62 64 67, 0 on 1, 1 on 1, 2 on 0, 3 on 0

six: a keyboard on the first channel sounds together, with drums beside it
on 48, on 52, on 55, on 36 @9 => rings 48 52 55 36

six: far below a string and beyond the set the key chooses
on 47 @1, on 65 @6, on 66 @6 => 0 on 4, 1 on 0, rings 47 65 66

six: a note may give its string
on 64 @16 s1, on 64 @16 s0, on 45 @16 s5 => 0 on 1, 1 on 0, 2 on 5, rings 64 64 45
off 64 @16 s0 => 0 held, 1 damped, 2 held
on 66 @16 s1 => 3 on 1, rings 64 45 66
on 64 @16 s6 => 4 on 0

six mode=poly: a note may give its string on a keyboard's instrument too
on 64 s1, on 64 s0, on 45 s5 => 0 on 1, 1 on 0, 2 on 5, rings 64 64 45
off 64 s0 => 0 held, 1 damped, 2 held

six mode=poly: a slide stays on its string while another is held
legato 127, on 52 s5, on 57 s2, on 64 s5, off 52 s5 => rings 64 57, 0 on 5

guitar course.strings=2: one key on two strings is two courses, of which legato moves one and a release ends one
legato 127, on 59 s1, on 59 s2 => rings 59 59 59 59
on 61 s1 => rings 61 61 59 59
off 59 s2 => 2 damped, 4 held

test technique.harmonic=2: a harmonic is plucked short of its first node
on 45 => 0 at 0.2
turn technique.harmonic=5, on 47 => 1 at 0.08

test mode=mpe pluck.position=0.2: slide moves the pluck until all is released, for it is a sound controller (RP-015)
slide 127 @1, on 57 @1, reset 0 @1, on 57 @1 => 0 at 0.5, 1 at 0.5
rest @1, on 57 @1 => 2 at 0.2

six: with its input at rest a guitar is forgotten
on 64 @0, on 59 @1, on 65 @0, on 67 @0 => rings 64 59 67
rest @0, rest @1, on 72, on 76 => rings 64 59 67 72 76
"""


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


@pytest.mark.parametrize("score", SCORES.strip().split("\n\n"), ids=lambda score: score.strip().split("\n")[0])
def test_hands(read, score):
    title, *lines = score.strip().split("\n")
    stage = Stage(read(title.split(":")[0])[0])
    for line in lines:
        played, _, expected = line.partition(" => ")
        for text in played.split(", "):
            stage.play(*(event for _, event in events_of(text, stage.player.instrument)))
        for text in expected.split(", "):
            check(text, stage)


# Strokes: which keys begin at which frames, whatever block is rendered


LATE, SPREAD = round(CHORD_S * RATE_HZ) + 1, round(USUAL_STRUM_MS / 1000 * RATE_HZ)
SIX = ", ".join(f"{{0}} on {key}" for key in (50, 40, 64, 45, 59, 55))
THREE = ", ".join(f"{{0}} on {key}" for key in (45, 40, 50))
TURNS = ", ".join([*(THREE.format(frame) for frame in (1, 9601, 19201)), "28800 on 60", THREE.format(38401)])
TREMBLING = " ".join(f"45@{round(turn * RATE_HZ / USUAL_TREMOLO_HZ)}" for turn in range(5))
STROKES = f"""
test technique.strum_ms=10: {SIX.format(0)}                          | 8192 | 40@0 45@480 50@960 55@1440 59@1920 64@2400
test technique.strum_ms=10 technique.strokes=1: {SIX.format(1000)}   | 8192 | 64@1000 59@1480 55@1960 50@2440 45@2920 40@3400
test technique.strum_ms=5 technique.strokes=2: {TURNS}               | 48000 | 40@1 45@241 50@481 50@9601 45@9841 40@10081 40@19201 45@19441 50@19681 60@28800 50@38401 45@38641 40@38881
test technique.strum_ms=20: 100 on 50, 300 on 59, 420 on 45, {100 + LATE} on 70 | 6000 | 50@100 45@1060 70@{100 + LATE} 59@2020
guitar technique.strum_ms=10: on 64 @1 v1, 2000 on 50 @3, 2000 on 57 @4, 2000 on 45 @5 | 4096 | 64@0 45@2000 57@2480 50@2960
test technique.strum_ms=40: {THREE.format(64)}, 640 mode123 0        | 9600 | 40@64
test technique.strum_ms=40: {THREE.format(64)}, 640 sound-off 0      | 9600 | 40@64
test: strum 64 @16, on 40 @16, on 45 @16                             | 4096 | 40@0 45@{SPREAD}
test: strum 64 @16, strum 63 @16, on 40 @16, on 45 @16               | 4096 | 40@0 45@0
test: strum 127 @16, on 40 @3, on 45 @3                              | 4096 | 40@0 45@0
test technique.tremolo_hz=12: 1000 on 45, 18000 off 45               | 48000 | 45@1000 45@5000 45@9000 45@13000 45@17000
test technique.tremolo_hz=10: pedal 127, on 45, 640 off 45           | 48000 | 45@0
test: tremolo 64, tremolo 63, on 45                                  | 48000 | 45@0
test: tremolo 64, on 45, 24000 reset 0                               | 48000 | {TREMBLING}
"""  # noqa: E501


@pytest.mark.parametrize("block", [64, 4_096])
@pytest.mark.parametrize(("played", "frames", "begun"), rows(STROKES))
def test_strokes_begin_at_their_frames(read, played, frames, begun, block):
    instrument, events = read(played)
    stage = Stage(instrument)
    stage.run([(round(frame), event) for frame, event in events], int(frames), block)
    assert " ".join(f"{each.key}@{each.frame}" for each in stage.begun) == begun
    refused = [each.key for each in stage.reports if each.kind == of.REFUSED]
    struck = sum(isinstance(event, NoteOn) for _, event in events)
    assert len({each.id for each in stage.begun}) + len(refused) == struck
