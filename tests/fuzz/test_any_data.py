"""Any data to any reader: a value, or that reader's own error."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from app.export.recipe import SoundRecipe
from app.instruments.instrument import Instrument
from app.session.choices import Choices
from app.window.settings import Settings, load_settings
from engine import bounds
from engine.plain_text import LONGEST_MESSAGE, one_line
from engine.presets import PresetInfo
from engine.resonators.string import resonator_of
from engine.schema import SchemaError, explained, parse_json, read, write
from engine.truth import SplittingSolver
from engine.values.string import StringParameters
from training.configuration import TrainingConfiguration

NUMBERS = st.integers() | st.floats() | st.sampled_from([10**400, 2**63, -(2**64)])
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=50),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=10), inner, max_size=5),
    max_leaves=20,
)


def fields_of(kind: type, *more: str) -> st.SearchStrategy[dict[str, Any]]:
    known = getattr(kind, "model_fields", None) or kind.__dataclass_fields__
    return st.dictionaries(st.sampled_from(sorted([*known, *more])) | st.text(max_size=8), VALUES, max_size=6)


@pytest.mark.parametrize("kind", [PresetInfo, StringParameters, TrainingConfiguration])
@given(data=st.data())
def test_any_data_is_read_or_refused(kind, data):
    plain = data.draw(fields_of(kind))
    try:
        value = read(kind, plain, "there")
    except SchemaError as error:
        assert str(error).isprintable() and len(str(error)) <= LONGEST_MESSAGE
    else:
        assert read(kind, write(value), "there") == value


@given(facts=fields_of(Settings), choices=fields_of(Choices, "preset", "instrument", "keys_play"))
def test_any_settings_file_lets_the_app_start(tmp_path_factory, facts, choices):
    path = tmp_path_factory.getbasetemp() / "settings.json"
    path.write_text(json.dumps({**facts, "choices": choices}))
    settings, notice = load_settings(path)
    assert isinstance(settings, Settings) and notice.isprintable() and len(notice) <= LONGEST_MESSAGE


@pytest.mark.parametrize("kind", [Instrument, SoundRecipe])
@given(data=st.data())
def test_any_document_is_checked(kind, data):
    facts = data.draw(fields_of(kind))
    try:
        value = kind.model_validate(facts)
    except (ValueError, OverflowError) as error:
        assert not isinstance(error, ValidationError) or explained(error)
    else:
        assert kind.model_validate_json(value.model_dump_json()) == value


@given(
    factors=st.lists(st.floats(1e-8, 1e8), min_size=8, max_size=8),
    modes=st.integers(-5, 20_000),
    points=st.integers(-5, 20_000),
    rate_hz=st.floats(0.01, 1e9),
)
def test_a_string_within_bounds_can_be_computed(factors, modes, points, rate_hz):
    """Whatever passes has tables of ordinary size, modes that oscillate, and finite motion."""
    plain = {name: value * by for (name, value), by in zip(write(StringParameters()).items(), factors, strict=True)}
    try:
        string = StringParameters(**plain)
        string.check_motion(modes, points, rate_hz, tension_modulated=True)
    except ValueError as error:
        assert str(error).isprintable()
        return
    if modes * points > 50_000:
        return  # it may take a moment
    resonator = resonator_of(string, modes, grid_points=points)
    resonator.eigenvalues()
    solver = SplittingSolver(resonator, rate_hz, silence=1e-9)
    assert solver.substeps <= bounds.MOST_SUBSTEPS
    assert all(bool(np.isfinite(table).all()) for table in solver.constants)


@given(st.text(max_size=3_000))
def test_a_message_is_one_printable_line(text):
    line = one_line(text)
    assert line.isprintable() and len(line) <= LONGEST_MESSAGE and one_line(line) == line


@given(st.binary(max_size=300) | st.text(max_size=300))
def test_json_is_plain_data_or_refused(text):
    try:
        parse_json(text, "there")
    except SchemaError as error:
        assert str(error).startswith("there: ")
