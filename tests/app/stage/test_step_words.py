"""Steps of undo in plain words."""

from __future__ import annotations

from typing import Any

import pytest

from app.instruments.instrument import ASSIGNABLE, Instrument
from app.instruments.library import SHIPPED, read_instrument
from app.shared.parameters import OF_INSTRUMENTS
from app.stage.step_words import step_words


@pytest.fixture(scope="module")
def guitar() -> Instrument:
    return read_instrument(SHIPPED / "classical_guitar.json")


def words(before: Instrument, after: Instrument) -> str:
    return step_words({"instrument": before}, {"instrument": after})


def with_part(instrument: Instrument, **parts: Any) -> Instrument:
    return Instrument.model_validate({**dict(instrument), **parts})


def test_whatever_a_knob_turns_has_words_without_marks(guitar: Instrument) -> None:
    for field in ASSIGNABLE:
        if field == "pickup.points.1":
            continue
        value = guitar.value(field)
        for turned in (0.9 * value + 0.011, 0.9 * value - 0.011):
            try:
                reported = words(guitar, guitar.with_value(field, turned))
            except ValueError:
                continue
            assert reported and "_" not in reported and "." not in reported, field
            assert reported == ("listening point" if field.startswith("pickup.") else OF_INSTRUMENTS[field].name)


def test_a_macro_is_reported_by_its_name(guitar: Instrument) -> None:
    target = {"field": "knobs.decay", "low": 1.0, "high": 3.0}
    instrument = with_part(guitar, macros=({"name": "Damp", "value": 0.5, "targets": (target,)},))
    assert words(instrument, instrument.turned(0, 0.9)) == "Damp"
