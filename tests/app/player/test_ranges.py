"""Plucks and strings stay within their ranges, whatever the knobs, macros and wheels of an instrument stand at."""

import itertools
import random
from collections.abc import Iterator

import numpy as np
import pytest

from app.instruments.drums import Drums
from app.instruments.instrument import ASSIGNABLE, VELOCITIES, Fretted, Instrument
from app.instruments.library import SHIPPED, list_instruments
from app.player.drum_keys import DrumKeys
from app.player.events import ControlChange, NoteOn
from app.player.strings import KNOBS
from app.player.table import wheeled
from engine.bounds import AMPLITUDE_MM_RANGE, POSITION_RANGE
from engine.kernels import constants as of
from engine.kernels import strings
from engine.kernels.midi import HARMONICS, MOD_WHEEL, SLIDE
from engine.kernels.playing.plucks import vary
from engine.parameters import OF_INSTRUMENTS
from engine.pluck import Pluck
from engine.strike import Strike
from engine.values.ear import Ear
from tests.app.player.stage import RATE_HZ, Stage, changed

STROKES = 12
INSTRUMENTS = {entry.instrument.name: entry.instrument for entry in list_instruments(SHIPPED)[0]}
PLUCKING = [field for field in ASSIGNABLE if field.startswith("pluck.")]
EVERY = pytest.mark.parametrize("instrument", INSTRUMENTS.values(), ids=INSTRUMENTS)


def with_ends(instrument: Instrument, fields: list[str], draw: random.Random) -> Instrument:
    """An instrument with some knobs at an end, then all macros; an end that another value forbids is left out."""
    for field in fields:
        try:
            instrument = instrument.with_knob(field, draw.choice(OF_INSTRUMENTS[field].limits))
        except ValueError:  # a softest pluck above the hardest
            continue
    for macro in range(len(instrument.macros)):
        if draw.random() < 0.5:
            instrument = instrument.turned(macro, draw.choice((0.0, 1.0)))
    return instrument


def at_ends(instrument: Instrument) -> Iterator[Instrument]:
    """Each macro and each knob of the pluck at either end, then some at random together."""
    draw = random.Random(instrument.name)
    for macro, end in itertools.product(range(len(instrument.macros)), (0.0, 1.0)):
        yield instrument.turned(macro, end)
    for fields in ([field] for field in PLUCKING):
        yield with_ends(instrument, fields, draw)
    for _ in range(4):
        yield with_ends(instrument, draw.sample(PLUCKING, 6), draw)


def test_every_stroke_of_every_knob_is_a_pluck():
    draw = random.Random(1)
    for turned in itertools.chain.from_iterable(map(at_ends, INSTRUMENTS.values())):
        for velocity in (*VELOCITIES, draw.randint(2, 126)):
            pluck = turned.pluck.pluck(velocity)
            own = pluck.position, pluck.amplitude_mm, pluck.width
            for _ in range(STROKES):
                stroke, key = draw.randrange(1_000_000), draw.randrange(128)
                position, amplitude_mm, width = vary(*own, turned.pluck.variation, stroke, key)
                Pluck(position, amplitude_mm, pluck.shape, width)
        for wheel in (-1, 0, 127, 128):
            wheeled(turned, wheel, "")


@EVERY
def test_no_knob_makes_a_string_or_a_blow_impossible(instrument):
    chosen, found = instrument.strings, np.empty(of.STRING)
    if isinstance(chosen, Drums):
        keys, (low, high) = DrumKeys(instrument, Ear(tuple(instrument.pickup.points))), instrument.range
        for key, curve in itertools.product(range(low, high + 1), OF_INSTRUMENTS["pluck.curve"].limits):
            drum = keys.of_key(key)
            assert (drum is None) == (keys.tuned_to(key) is None)
            assert drum is None or all(isinstance(drum.strike(each, curve), Strike) for each in VELOCITIES)
        return
    own = [chosen.string] if isinstance(chosen, Fretted) else [each.string for each in chosen.strings]
    limits = [OF_INSTRUMENTS[f"knobs.{name}"].limits for name in KNOBS]
    for string, knobs in itertools.product(own[:: max(len(own) - 1, 1)], itertools.product(*limits)):
        strings.turned(np.array(string.row), np.array(knobs), found)
        assert strings.possible(found), (knobs, found)


@pytest.mark.parametrize("mode", ["poly", "mpe"])
def test_wheels_slides_hands_and_techniques_stay_within_ranges(mode):
    ends = {"pluck.position": POSITION_RANGE[0], "pluck.hardest_mm": AMPLITUDE_MM_RANGE[1]}
    extreme = changed(INSTRUMENTS["Classical guitar"].with_values(ends), mode=mode, pluck={"variation": 1.0})
    for field in ("pluck.position", "pluck.hardest_mm", "pluck.width", "technique.harmonic"):
        stage = Stage(changed(extreme, mod_wheel=field))
        for value in (0, 127, 128):
            hands = (ControlChange(number, value) for number in (MOD_WHEEL, SLIDE, HARMONICS))
            for event in (*hands, *(NoteOn(40 + 7 * n, velocity) for n, velocity in enumerate((1, 64, 127)))):
                stage.player.handle(event)
            assert np.isfinite(stage.left(RATE_HZ // 4)).all()
        assert len({each.id for each in stage.begun}) == 9
        assert all(Pluck(each.position, each.amplitude_mm, "gaussian", each.width) for each in stage.begun)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf"), -1.0, 1e300])
def test_the_nearest_pluck_is_always_one(value):
    made = Pluck(shape="rounded").nearest(position=value, amplitude_mm=value, width=value)
    assert made.shape == "rounded" and POSITION_RANGE[0] <= made.position <= POSITION_RANGE[1]
