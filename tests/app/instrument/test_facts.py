"""A string in figures, and from a figure back to the knob."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from app.instrument.facts import FIGURES, bright_mode, facts_of, figures_of, knob_for, reported, t60_s
from app.instrument.strings import Strings
from app.patches.patch import Fretted, Knobs, Patch
from app.shared.parameters import OF_PATCHES
from engine.values.string import Losses, StringParameters

KEY = 57


def string_of(patch: Patch) -> StringParameters:
    found = Strings(patch).of_key(KEY)
    assert found is not None
    return found.parameters


def test_figures_are_three_digits_and_a_unit() -> None:
    reported_as = {70.31: "70.3 N", 649.6: "650 N", 17829.0: "17829 N", 0.0512: "0.0512 N", 4.1e-5: "4.1e-05 N"}
    assert reported(0.0, "N") == "0 N"
    assert {figure: reported(figure, "N") for figure in reported_as} == reported_as
    assert reported(0.5, "") == "0.500"


def test_every_knob_of_the_string_has_a_figure(patch: Patch) -> None:
    assert {field.removeprefix("knobs.") for field in FIGURES} == set(Knobs.model_fields)
    figures = figures_of(string_of(patch), patch)
    assert figures["knobs.tension"] == "75.0 N"
    assert figures["knobs.density"] == "7850 kg/m³"
    assert figures["knobs.modulus"] == "200 GPa"
    assert figures["knobs.gauge"] == "0.798 mm"  # 2 √(0.5 mm² / π)
    found = Strings(patch).of_key(KEY)
    assert found is not None
    assert facts_of(found) == {"key": "A3", "pitch": "220.0 Hz", "mass": "3.92 g/m", "stress": "150 MPa"}


def test_decay_is_reported_of_the_first_partial_and_of_the_one_near_three_kilohertz(patch: Patch) -> None:
    string = string_of(patch)
    assert bright_mode(string) == 14  # of 220 Hz
    for mode in (1, 14):
        assert math.exp(-string.decay_rate(mode) * t60_s(string, mode, patch)) == pytest.approx(1e-3)
    high = Strings(patch.model_copy(update={"range": (28, 127)})).of_key(120)
    assert high is not None
    assert bright_mode(high.parameters) == 1


@pytest.mark.parametrize("field", FIGURES)
def test_a_figure_leads_back_to_its_knob(patch: Patch, field: str) -> None:
    figure = FIGURES[field]
    turned = patch.with_value(field, 1.7)
    wanted = figure.of(string_of(turned), turned)
    assert (wanted > figure.of(string_of(patch), patch)) != figure.falls
    assert knob_for(patch, (KEY, None), field, wanted) == pytest.approx(1.7)
    ends = [knob_for(patch, (KEY, None), field, far) for far in (0.0, 1e30)]
    low, high = OF_PATCHES[field].limits
    assert (ends[::-1] if figure.falls else ends) == pytest.approx([low, high])


@pytest.mark.parametrize("field", ["knobs.decay", "knobs.brightness_decay"])
def test_decay_by_mode_is_in_the_figure(patch: Patch, field: str) -> None:
    figure, lossy = FIGURES[field], patch.model_copy(update={"losses": Losses(friction=1e-3)})
    string = string_of(patch)
    assert figure.of(string, lossy) < 0.9 * figure.of(string, patch)
    turned = lossy.with_value(field, 1.7)
    wanted = figure.of(string_of(turned), turned)
    assert knob_for(lossy, (KEY, None), field, wanted) == pytest.approx(1.7)


def test_a_figure_beyond_the_bounds_is_the_bound(patch: Patch) -> None:
    strings = patch.strings
    assert isinstance(strings, Fretted)
    dense = replace(strings.string, density_kg_m3=50_000.0)
    heavy = patch.model_copy(update={"strings": Fretted(string=dense)})
    turned = heavy.with_value("knobs.density", knob_for(heavy, (KEY, None), "knobs.density", 1e9))
    assert string_of(turned).density_kg_m3 == 1e5


def test_a_silent_key_is_reported(patch: Patch) -> None:
    with pytest.raises(ValueError, match="key 10 of test is silent"):
        knob_for(patch, (10, None), "knobs.tension", 80.0)


def test_a_guitars_key_is_measured_on_the_string_that_is_played(guitar: Patch) -> None:
    lowest = Strings(guitar).of_key(57, 5)
    assert lowest is not None
    wanted = FIGURES["knobs.length"].of(lowest.parameters, guitar)
    assert knob_for(guitar, (57, 5), "knobs.length", 2 * wanted) == pytest.approx(2.0, rel=1e-2)
