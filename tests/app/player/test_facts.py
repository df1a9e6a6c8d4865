"""A string in figures, from a figure back to the knob, and what of it lies outside the training."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from app.instruments.instrument import Fretted, Instrument
from app.player.events import NoteOn
from app.player.facts import FIGURES, bright_mode, knob_for, outside_of_key, t60_s
from app.shared.parameters import OF_INSTRUMENTS
from engine.presets import Preset
from engine.values.string import Losses
from tests.app.player.conftest import STEEL
from tests.app.player.stage import changed, string_of

KEY = 57


def test_decay_is_reported_of_the_first_partial_and_of_the_one_near_three_kilohertz(instrument: Instrument) -> None:
    string = string_of(instrument, KEY).parameters
    assert bright_mode(string) == 14  # of 220 Hz
    for mode in (1, 14):
        assert math.exp(-string.decay_rate(mode) * t60_s(string, mode, instrument)) == pytest.approx(1e-3)
    assert bright_mode(string_of(changed(instrument, range=(28, 127)), 120).parameters) == 1


@pytest.mark.parametrize("lossy", [False, True])
def test_a_figure_leads_back_to_its_knob(instrument: Instrument, guitar: Instrument, lossy: bool) -> None:
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


def test_a_figure_beyond_the_bounds_is_the_bound_and_a_silent_key_is_reported(instrument: Instrument) -> None:
    heavy = changed(instrument, strings=Fretted(string=replace(STEEL, density_kg_m3=50_000.0)))
    turned = heavy.with_value("knobs.density", knob_for(heavy, (KEY, None), "knobs.density", 1e9))
    assert string_of(turned, KEY).parameters.density_kg_m3 == 1e5
    with pytest.raises(ValueError, match="key 10 of test is silent"):
        knob_for(instrument, (10, None), "knobs.tension", 80.0)


def test_what_lies_outside_the_training_is_reported_of_the_string_as_the_knobs_have_it(
    instrument: Instrument, preset: Preset
) -> None:
    """Near 3 kHz; the decay of the first mode, with which no error grows, is not named. A silent key has nothing."""
    slow = changed(instrument, knobs={"decay": 20.0, "brightness_decay": 20.0})
    words = [outside_of_key(preset.info, each, NoteOn(KEY, 60)) for each in (instrument, slow)]
    assert [sum(line.startswith("decay time") for line in each) for each in words] == [1, 0]
    assert outside_of_key(preset.info, changed(instrument, range=(60, 72)), NoteOn(40, 60)) == []
