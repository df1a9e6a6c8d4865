from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.export.sampled.plan import MOST_LAYERS, WIDEST_STEP, SampledPlan
from app.instruments.instrument import Fretted, Instrument
from app.player.glide import glides_cents
from engine.values.string import StringParameters

InstrumentOf = Callable[..., Instrument]
STRING = StringParameters()
WHOLE = Instrument(name="Whole", category="keys", strings=Fretted(string=STRING), range=(0, 127))


@given(
    st.tuples(st.integers(0, 127), st.integers(0, 127)).map(lambda ends: (min(ends), max(ends))),
    st.integers(1, WIDEST_STEP),
    st.integers(1, MOST_LAYERS),
)
def test_each_key_and_velocity_has_one_zone(keys: tuple[int, int], every: int, layers: int) -> None:
    sounded = [
        (key, velocity)
        for zone in SampledPlan(WHOLE, keys, every, layers).zones
        for key in range(zone.keys[0], zone.keys[1] + 1)
        for velocity in range(zone.velocities[0], zone.velocities[1] + 1)
    ]
    assert sorted(sounded) == [(k, v) for k in range(keys[0], keys[1] + 1) for v in range(1, 128)]


def test_no_key_is_transposed_unless_asked(instrument: Instrument) -> None:
    assert {zone.keys for zone in SampledPlan(instrument).zones} == {(key, key) for key in range(45, 65)}
    assert all(zone.key == zone.keys[0] for zone in SampledPlan(instrument).zones)
    spans = {(zone.keys, zone.key) for zone in SampledPlan(instrument, every=3).zones}
    assert {((45, 47), 46), ((63, 64), 63)} < spans
    assert len(spans) == 7


@pytest.mark.parametrize("every", [1, 3])
def test_a_layer_is_rendered_where_its_largest_error_of_pitch_is_least(
    every: int, instrument_of: InstrumentOf
) -> None:
    plan = SampledPlan(instrument_of(pluck={"hardest_mm": 20.0}), layers=3, every=every)
    zones, glides = [zone for zone in plan.zones if 50 in zone.keys], glides_cents(plan.instrument)
    assert [zone.velocities for zone in zones] == [(1, 42), (43, 84), (85, 127)]
    for zone in zones:
        (low, high), (softest, hardest) = zone.keys, zone.velocities
        notes = glides[low : high + 1, softest : hardest + 1]
        errors = [np.abs(notes - glides[zone.key, velocity]).max() for velocity in range(softest, hardest + 1)]
        assert errors[zone.velocity - softest] == min(errors) <= plan.pitch_error_cents
        assert errors[-1] > 1.5 * min(errors)  # as it was rendered at the hardest
    assert plan.pitch_error_cents > 10
    assert SampledPlan(plan.instrument, layers=32, every=every).pitch_error_cents < 0.5 * plan.pitch_error_cents


def test_a_string_that_does_not_glide_is_rendered_at_its_hardest(instrument: Instrument) -> None:
    string = replace(instrument.strings.string, youngs_modulus_pa=0.0, second_moment_m4=0.0)
    flexible = instrument.model_copy(update={"strings": Fretted(string=string)})
    plan = SampledPlan(flexible, layers=3)
    assert [zone.velocity for zone in plan.zones if zone.key == 50] == [42, 84, 127]
    assert plan.pitch_error_cents == 0


def test_largest_bytes_counts_every_frame(instrument: Instrument, instrument_of: Callable[..., Instrument]) -> None:
    plan = SampledPlan(instrument, (50, 59), layers=2, seconds=1.5, rate_hz=48_000, bits="24")
    assert plan.largest_bytes == 10 * 2 * 72_000 * 3
    stereo = instrument_of(pickup={"points": (0.2, 0.3)})
    assert SampledPlan(stereo, (50, 59), layers=2, seconds=1.5, bits="16").largest_bytes == 10 * 2 * 72_000 * 2 * 2


@pytest.mark.parametrize(
    ("choices", "reported"),
    [
        ({"every": 0}, "every must lie in 1 … 12, not 0"),
        ({"layers": 33}, "layers must lie in 1 … 32, not 33"),
        ({"seconds": float("nan")}, "seconds must lie in 0.1 … 60, not nan"),
        ({"rate_hz": 10**9}, "rate_hz must lie in 8000 … 192000"),
        ({"keys": (40, 64)}, "keys must be a range within the instrument's own, 45-64, not 40-64"),
        ({"keys": (60, 50)}, "not 60-50"),
        ({"format": "mp3"}, "format 'mp3' is not one of flac, wav"),
        ({"bits": "32f"}, "bits '32f' is not one of 16, 24"),
    ],
)
def test_what_cannot_be_is_refused_by_name(instrument: Instrument, choices: dict, reported: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reported)):
        SampledPlan(instrument, **choices)


def test_a_scale_of_its_own_is_never_transposed(instrument_of: Callable[..., Instrument]) -> None:
    scale = "! five.scl\nfive equal steps\n 5\n 240.\n 480.\n 720.\n 960.\n 2/1\n"
    tuned = instrument_of(tuning={"scale": scale})
    assert SampledPlan(tuned).every == 1
    with pytest.raises(ValueError, match="every must be 1"):
        SampledPlan(tuned, every=2)


def test_keys_that_the_tuning_leaves_out_have_no_sample(instrument_of: Callable[..., Instrument]) -> None:
    white = ["0", "x", "2", "x", "4", "5", "x", "7", "x", "9", "x", "11"]
    keymap = "\n".join(["12", "0", "127", "60", "69", "440.0", "12", *white]) + "\n"
    tuned = instrument_of(tuning={"keymap": keymap})
    assert {zone.key for zone in SampledPlan(tuned, (48, 59)).zones} == {48, 50, 52, 53, 55, 57, 59}
    with pytest.raises(ValueError, match="keys: the instrument's tuning leaves all of them out"):
        SampledPlan(tuned, (49, 49))
