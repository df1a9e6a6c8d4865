"""An instrument: what it refuses, and what its numbers mean."""

import itertools
import json
import math
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from app.instruments.instrument import ASSIGNABLE, Instrument, OpenString, Pickup, PluckChoices, StringSet, Technique
from app.instruments.library import SHIPPED, find_instrument, list_instruments
from engine.parameters import OF_INSTRUMENTS
from engine.schema import explained
from tests.app.instruments.conftest import STRING, make_instrument


def macro_of(field: str, low: float, high: float) -> list[dict[str, Any]]:
    return [{"name": "m", "targets": [{"field": field, "low": low, "high": high}]}]


LENGTHLESS = {**STRING, "length_m": 0}


def test_impossible_values_are_refused_by_name():
    text = Path(__file__).with_name("refused.txt").read_text(encoding="utf-8")
    for name, meant in (
        ("LENGTHLESS", json.dumps(LENGTHLESS)),
        ("STRING", json.dumps(STRING)),
        ("LONG", "x" * 65_537),
        ("DRUM", json.dumps(json.loads((SHIPPED / "concert_toms.json").read_text())["strings"]["drums"][0]["drum"])),
    ):
        text = text.replace(f": {name}", f": {meant}").replace(f'"{name}"', f'"{meant}"')
    for line in text.splitlines()[2:]:
        field, _, changes = line.partition(" | ")
        with pytest.raises(ValidationError, match=field):
            make_instrument(**json.loads(changes))


def test_an_instrument_survives_json_and_what_plucks_it_stops_its_string_unless_it_says_otherwise():
    strings = StringSet(strings=tuple(OpenString(note=n, string=make_instrument().strings.string) for n in (40, 45)))  # type: ignore[union-attr]
    whole = make_instrument(strings=strings, macros=macro_of("level_db", -3, 3), pluck={"stops": False})
    assert Instrument.model_validate_json(whole.model_dump_json()) == whole
    older = make_instrument().model_dump()
    del older["pluck"]["stops"]
    assert Instrument.model_validate(older).pluck.stops
    instruments = list_instruments(SHIPPED)[0]
    struck = {
        each.name for each in instruments if not each.instrument.pluck.stops and each.instrument.category != "drums"
    }
    assert struck == {"cimbalom", "felt_on_wires", "santur_in_shur"}


def test_equal_steps_of_velocity_are_equal_steps_in_db_and_a_curve_bends_the_middle():
    facts = {"shape": "gaussian", "softest_mm": 0.1, "hardest_mm": 2, "width": 0.12, "width_hard": 0.04}
    choices = PluckChoices.model_validate(facts)
    plucks = [choices.pluck(1 + 126 * share) for share in (0, 0.25, 0.5, 0.75, 1)]
    ratios = [hard.amplitude_mm / soft.amplitude_mm for soft, hard in itertools.pairwise(plucks)]
    assert ratios == pytest.approx([20**0.25] * 4)
    assert (plucks[0].amplitude_mm, plucks[-1].amplitude_mm) == pytest.approx((0.1, 2))
    assert (plucks[0].width, plucks[-1].width) == pytest.approx((0.12, 0.04))
    assert choices.pluck(500) == plucks[-1] and choices.pluck(-3) == plucks[0]
    for curve in (-1.0, -0.3, 0.4, 1.0):
        bent = PluckChoices.model_validate({**facts, "curve": curve})
        ends = [bent.pluck(velocity).amplitude_mm for velocity in (1, 127)]
        assert ends == pytest.approx([0.1, 2])
        assert (bent.pluck(64).amplitude_mm > plucks[2].amplitude_mm) == (curve > 0)


def test_each_assignable_field_can_be_read_and_changed():
    first = make_instrument(pickup=Pickup(points=(0.2, 0.3)), level_db=1, technique=Technique(harmonic=2))
    for field in ASSIGNABLE:
        value = first.value(field)
        changed = first.with_value(field, value * 0.95)
        assert changed.value(field) == pytest.approx(value * 0.95)
        assert changed.with_value(field, value) == first
        with pytest.raises(ValueError, match=field.split(".")[-2 if field[-1].isdigit() else -1]):
            first.with_value(field, 1e5)


def test_fields_have_the_defaults_and_limits_of_the_table():
    instrument = make_instrument()
    for field, declared in OF_INSTRUMENTS.items():
        if not field.startswith("pickup."):  # which a test's instrument may lack
            assert instrument.value(field) == declared.default, field
    for field in ("amp.drive_db", "amp.tone_db", "room.mix", "room.t60_s"):
        low, high = OF_INSTRUMENTS[field].limits
        assert (instrument.with_value(field, low).value(field), instrument.with_value(field, high).value(field)) == (
            low,
            high,
        )
        for beyond in (low - 1e-6, high + 1e-6):
            with pytest.raises(ValueError, match=f"{field.split('.')[1]} must lie in"):
                instrument.with_value(field, beyond)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tension_n": "60"}, "string.tension_n: must be a valid number, found '60'"),
        ({"tension_n": True}, "string.tension_n: must be a valid number, found True"),
        ({"tension_n": math.nan}, "string.tension_n: must be a finite number"),
        ({"tension_n": 0}, "string: string parameter tension_n must lie in 0.001 … 1000000, not 0"),
        ({"tension_n": None}, "string.tension_n: must be a valid number"),
        ({"colour": 1}, "string: unknown field 'colour'"),
    ],
)
def test_the_engines_values_are_checked_where_they_stand(changes, words):
    with pytest.raises(ValueError) as caught:
        make_instrument(strings={"kind": "fretted", "string": {**STRING, **changes}})
    assert explained(caught.value).startswith(f"strings.fretted.{words}")


def test_a_string_or_drum_is_given_whole():
    for name in STRING:
        less = {each: value for each, value in STRING.items() if each != name}
        with pytest.raises(ValueError, match=f"{name} must be given; add what is missing"):
            make_instrument(strings={"kind": "fretted", "string": less})
    drums = {"kind": "drums", "drums": [{"note": 40, "name": "d", "drum": {"shape": "circle", "length_m": 0.3}}]}
    with pytest.raises(ValueError, match=r"width_m, thickness_m, .*, damping_d3_kg_s must be given"):
        make_instrument(strings=drums)


def macro_of_two(one: str, other: str, *ends: float) -> list[dict[str, Any]]:
    return [
        {"name": "m", "targets": [*macro_of(one, *ends[:2])[0]["targets"], *macro_of(other, *ends[2:])[0]["targets"]]}
    ]


def test_a_macro_writes_its_targets():
    first = make_instrument(macros=macro_of_two("knobs.decay", "pluck.position", 0.5, 2.5, 0.4, 0.1))
    turned = first.turned(0, 0.25)
    assert turned.knobs.decay == pytest.approx(1.0) and turned.pluck.position == pytest.approx(0.325)
    assert turned.macros[0].value == 0.25
    assert first.turned(0, 7).knobs.decay == pytest.approx(2.5)


def test_a_macro_whose_targets_would_cross_turns_as_far_as_it_can():
    macros = macro_of_two("pluck.softest_mm", "pluck.hardest_mm", 0.1, 2.5, 3.0, 1.0)
    instrument = make_instrument(pluck={"softest_mm": 0.1, "hardest_mm": 3.0}, macros=macros)
    for value in (0.0, 0.4, 0.7, 1.0, 0.2):
        instrument = instrument.turned(0, value)
        assert instrument.macros[0].value == value and instrument.pluck.softest_mm <= instrument.pluck.hardest_mm


def test_a_macro_follows_a_knob_that_it_turns():
    guitar = find_instrument("Steel-string acoustic").instrument
    names = [macro.name for macro in guitar.macros]
    room, tone = names.index("Room"), names.index("Tone")
    followed = guitar.with_knob("room.mix", 0.5)
    assert followed.macros[room].value == pytest.approx(0.5)
    assert followed.turned(room, 0.5).value("room.mix") == pytest.approx(0.5)
    assert followed.macros[:room] == guitar.macros[:room]
    bright = guitar.turned(tone, 0.8)
    again = bright.with_knob("pluck.width", bright.value("pluck.width"))
    assert again.macros[tone].value == pytest.approx(0.8)
    darker = bright.with_knob("pluck.width", 0.5)
    assert 0.5 < darker.macros[tone].value < 0.8
