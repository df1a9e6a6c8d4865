"""The strings of keys: pitches, what hands and knobs do to them, their figures, and how far hard strokes glide."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from app.instruments.instrument import BodyChoice, Fretted, Instrument, Knobs, OpenString, StringSet
from app.instruments.library import SHIPPED, read_instrument
from app.instruments.tuning import TuningChoice
from app.player.events import NoteOn
from app.player.facts import FIGURES, bright_mode, knob_for, outside_of_key, t60_s
from app.player.glide import START_S, glides_cents
from app.player.strings import KNOBS, Strings
from engine.kernels import strings as law
from engine.kernels.constants import D1, LENGTH, TENSION
from engine.parameters import OF_INSTRUMENTS
from engine.resonators import string as of_law
from engine.resonators.family import inharmonicity
from engine.values.effects import Amp, Room
from engine.values.string import Losses, StringParameters
from tests.app.player.conftest import STEEL
from tests.app.player.stage import PRESET, SOURCES, cents, changed, hz_of, pitch_hz, play, string_of


def made(string: StringParameters, place: int, value: float) -> StringParameters:
    """The string with another value, by its place in the row."""
    return replace(string, **{fields(string)[place].name: value})


def in_tune(string: StringParameters, hz: float) -> bool:
    return abs(cents(string.pitch_hz, hz)) < 1e-3


def test_every_key_has_its_pitch_by_length_alone(instrument):
    for key in range(28, 89):
        found = string_of(instrument, key)
        assert in_tune(found.parameters, hz_of(key)) and 1 <= found.modes <= 99
        assert replace(found.parameters, length_m=STEEL.length_m) == STEEL


def test_a_set_frets_the_highest_string_at_or_below_and_slackens_the_lowest(guitar):
    tuned = changed(guitar, tuning=TuningChoice(a4_hz=443.0))
    strings = {key: string_of(tuned, key).parameters for key in (30, 40, 44, 45, 64, 80)}
    assert all(in_tune(string, hz_of(key) * 443 / 440) for key, string in strings.items())
    assert strings[30].tension_n < 0.5 * strings[40].tension_n
    assert strings[30].length_m == pytest.approx(strings[40].length_m, rel=1e-3)


def test_bends_and_slides_reach_the_pitch_and_a_damper_adds_its_decay_to_every_partial():
    for semitones in (-2, -0.5, 0.3, 2, 12):
        ratio = 2 ** (semitones / 12)
        by_tension = made(STEEL, TENSION, law.bent(STEEL.row, ratio))
        by_length = made(STEEL, LENGTH, law.slid(STEEL.row, ratio))
        assert in_tune(by_tension, ratio * STEEL.pitch_hz) and in_tune(by_length, ratio * STEEL.pitch_hz)
        assert (by_tension.length_m, by_length.tension_n) == (STEEL.length_m, STEEL.tension_n)
    assert law.bent(replace(STEEL, second_moment_m4=1e-9).row, 0.05) < 0, "below what stiffness alone gives"
    added = of_law.decay_rates(made(STEEL, D1, law.damped(STEEL.row, 0.2)), 20) - of_law.decay_rates(STEEL, 20)
    assert added.tolist() == pytest.approx([math.log(1000) / 0.2] * 20)


def test_gauge_and_density_leave_pitch_and_decay_and_change_how_stiff_it_is():
    def turned(**knobs: float) -> StringParameters:
        law.turned(STEEL.row, [getattr(Knobs(**knobs), name) for name in KNOBS], out := [0.0] * 8)
        return StringParameters(*out)

    thick = turned(gauge=1.5, density=1.2)
    assert in_tune(made(thick, LENGTH, law.fretted(thick.row, 220.0)), 220.0)
    assert thick.decay_rate(1) == pytest.approx(STEEL.decay_rate(1))
    assert thick.second_moment_m4 == pytest.approx(1.5**4 * STEEL.second_moment_m4)
    assert turned() == STEEL


@pytest.mark.parametrize(("name", "key"), [("instrument", 57), ("guitar", 57), ("guitar", 30)])
def test_tension_and_length_go_together_at_a_keys_pitch(name, key, request):
    played: Instrument = request.getfixturevalue(name)
    own = string_of(played, key)
    for knob, value in (("tension", 4.0), ("length", 2.0)):
        found = string_of(played.with_value(f"knobs.{knob}", value), key)
        assert in_tune(found.parameters, own.pitch_hz)
        assert found.parameters.tension_n == pytest.approx(4 * own.parameters.tension_n, rel=5e-3)
        assert found.parameters.length_m == pytest.approx(2 * own.parameters.length_m, rel=5e-3)
        assert found.shortened == pytest.approx(own.shortened, rel=5e-3)  # pulled as far
        assert inharmonicity(found.parameters) == pytest.approx(inharmonicity(own.parameters) / 16, rel=1e-2)
        rest = [replace(each.parameters, length_m=1.0, tension_n=1.0) for each in (found, own)]
        assert rest[0] == rest[1]
    same = string_of(played.with_values({"knobs.tension": 4.0, "knobs.length": 0.5}), key).parameters
    found_m_n = (same.tension_n, same.length_m)
    assert found_m_n == pytest.approx((own.parameters.tension_n, own.parameters.length_m))


SLACK = Fretted(string=replace(STEEL, tension_n=1e-3, second_moment_m4=0.0))
ROD = StringSet(strings=(OpenString(note=60, string=replace(STEEL, second_moment_m4=1e-9)),))


@pytest.mark.parametrize(
    ("strings", "key", "error"),
    [
        (SLACK, 88, "key 88 of test.*length_m"),
        (ROD, 31, "key 31.*no tension slackens its string so far; choose a higher key"),
    ],
)
def test_an_impossible_key_is_named(instrument, strings, key, error):
    found = Strings(changed(instrument, strings=strings, range=(28, 88)))
    assert found.of_key(27) is found.of_key(89) is None, "beyond the range"
    with pytest.raises(ValueError, match=error):
        found.of_key(key)


# How far a hard stroke begins above its pitch


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(
    ("name", "key", "decay"),
    [("slack_bass", 44, 1.0), ("slack_bass", 50, 20.0), ("electric_bass", 45, 1.0), ("harpsichord", 84, 1.0)],
)
def test_a_rendered_note_starts_as_sharp(name, key, decay, source):
    """Of the string alone. Keys high enough for many periods in START_S: partials of a lower one overlap."""
    instrument = read_instrument(SHIPPED / f"{name}.json").with_values(
        {"noise.onset_db": -60.0, "knobs.decay": decay}
    )
    instrument = changed(instrument, amp=Amp(), body=BodyChoice(), room=Room())
    own_hz, wanted = string_of(instrument, key).pitch_hz, glides_cents(instrument)[key, 127]
    sound = play(instrument, START_S, (0.0, NoteOn(key, 127)), source=source)
    found = cents(pitch_hz(sound, own_hz * 2 ** (wanted / 1200), 0.0, START_S, 0.06), own_hz)
    assert found == pytest.approx(wanted, rel=0.15)


def test_the_glide_grows_with_amplitude_squared_and_is_of_keys_that_have_a_string(instrument):
    """So that its error over a layer of velocities has one least value."""
    glides = glides_cents(instrument)
    assert (np.diff(glides[60, 1:]) > 0).all()
    halved = glides_cents(instrument.with_value("pluck.hardest_mm", instrument.pluck.hardest_mm / 2))
    tight = glides_cents(instrument.with_value("knobs.tension", 2.0))
    assert glides[60, 127] / halved[60, 127] == pytest.approx(4, rel=0.01)
    assert glides[60, 127] / tight[60, 127] == pytest.approx(4, rel=0.03)  # 1 / T₀ℓ²
    low, high = instrument.range
    assert list(np.flatnonzero(np.isfinite(glides).all(axis=1))) == list(range(low, high + 1))
    beyond = glides_cents(changed(instrument, range=(60, 127), tuning=TuningChoice(transpose=48)))
    assert np.isfinite(beyond[60]).all() and np.isnan(beyond[127]).all()


KEY = 57


def test_decay_is_reported_of_the_first_partial_and_of_the_one_near_three_kilohertz(instrument):
    string = string_of(instrument, KEY).parameters
    assert bright_mode(string) == 14  # of 220 Hz
    for mode in (1, 14):
        assert math.exp(-string.decay_rate(mode) * t60_s(string, mode, instrument)) == pytest.approx(1e-3)
    assert bright_mode(string_of(changed(instrument, range=(28, 127)), 120).parameters) == 1


@pytest.mark.parametrize("lossy", [False, True])
def test_a_figure_leads_back_to_its_knob(instrument, guitar, lossy):
    """Also where losses by mode are in it; beyond its ends it is its end. A guitar's is of the string that plays."""
    chosen = instrument.model_copy(update={"losses": Losses(friction=1e-3)}) if lossy else instrument
    for field, figure in FIGURES.items():
        turned = chosen.with_value(field, 1.7)
        wanted, own = (figure.of(string_of(each, KEY).parameters, each) for each in (turned, chosen))
        assert (wanted > own) != figure.falls
        assert knob_for(chosen, (KEY, None), field, wanted) == pytest.approx(1.7)
        ends = [knob_for(chosen, (KEY, None), field, far) for far in (0.0, 1e30)]
        assert ends == pytest.approx(OF_INSTRUMENTS[field].limits[:: -1 if figure.falls else 1])
        assert (
            not lossy
            or "decay" not in field
            or own < 0.9 * figure.of(string_of(instrument, KEY).parameters, instrument)
        )
    wanted = FIGURES["knobs.length"].of(string_of(guitar, KEY, 5).parameters, guitar)
    assert knob_for(guitar, (KEY, 5), "knobs.length", 2 * wanted) == pytest.approx(2.0, rel=1e-2)


def test_a_figure_beyond_the_bounds_is_the_bound_and_a_silent_key_is_reported(instrument):
    heavy = changed(instrument, strings=Fretted(string=replace(STEEL, density_kg_m3=50_000.0)))
    turned = heavy.with_value("knobs.density", knob_for(heavy, (KEY, None), "knobs.density", 1e9))
    assert string_of(turned, KEY).parameters.density_kg_m3 == 1e5
    with pytest.raises(ValueError, match="key 10 of test is silent"):
        knob_for(instrument, (10, None), "knobs.tension", 80.0)


def test_what_lies_outside_the_training_is_reported_of_the_string_as_the_knobs_have_it(instrument):
    """Near 3 kHz; the decay of the first mode, with which no error grows, is not named. A silent key has nothing."""
    slow = changed(instrument, knobs={"decay": 20.0, "brightness_decay": 20.0})
    words = [outside_of_key(PRESET.info, each, NoteOn(KEY, 60)) for each in (instrument, slow)]
    assert [sum(line.startswith("decay time") for line in each) for each in words] == [1, 0]
    assert outside_of_key(PRESET.info, changed(instrument, range=(60, 72)), NoteOn(40, 60)) == []
