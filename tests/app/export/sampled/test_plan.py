"""Plans of samples: which keys and velocities sound by which sample."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.export.sampled.plan import MOST_LAYERS, WIDEST_STEP, SampledPlan
from app.instruments.instrument import Fretted
from app.player.glide import glides_cents
from tests.app.export.sampled.conftest import STEREO, instrument_of

WHOLE = instrument_of(range=(0, 127))


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


def test_no_key_is_transposed_unless_asked() -> None:
    assert {(zone.keys, zone.key) for zone in SampledPlan(instrument_of()).zones} == {
        ((key, key), key) for key in range(45, 65)
    }
    spans = {(zone.keys, zone.key) for zone in SampledPlan(instrument_of(), every=3).zones}
    assert {((45, 47), 46), ((63, 64), 63)} < spans
    assert len(spans) == 7


@pytest.mark.parametrize("every", [1, 3])
def test_a_layer_is_rendered_where_its_largest_error_of_pitch_is_least(every: int) -> None:
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


def test_a_string_that_does_not_glide_is_rendered_at_its_hardest() -> None:
    string = replace(WHOLE.strings.string, youngs_modulus_pa=0.0, second_moment_m4=0.0)
    plan = SampledPlan(instrument_of(strings=Fretted(string=string)), layers=3)
    assert [zone.velocity for zone in plan.zones if zone.key == 50] == [42, 84, 127]
    assert plan.pitch_error_cents == 0


def test_largest_bytes_counts_every_frame() -> None:
    plan = SampledPlan(instrument_of(), (50, 59), layers=2, seconds=1.5, rate_hz=48_000, bits="24")
    assert plan.largest_bytes == 10 * 2 * 72_000 * 3
    assert replace(plan, instrument=instrument_of(pickup=STEREO), bits="16").largest_bytes == 10 * 2 * 72_000 * 2 * 2


FIVE = {"scale": "! five.scl\nfive equal steps\n 5\n 240.\n 480.\n 720.\n 960.\n 2/1\n"}
WHITE = {"keymap": "12\n0\n127\n60\n69\n440.0\n12\n0\nx\n2\nx\n4\n5\nx\n7\nx\n9\nx\n11\n"}


@pytest.mark.parametrize(
    ("tuning", "choices", "reported"),
    [
        ({}, {"every": 0}, "every must lie in 1 … 12, not 0"),
        ({}, {"layers": 33}, "layers must lie in 1 … 32, not 33"),
        ({}, {"seconds": float("nan")}, "seconds must lie in 0.1 … 60, not nan"),
        ({}, {"rate_hz": 10**9}, "rate_hz must lie in 8000 … 192000"),
        ({}, {"keys": (40, 64)}, "keys must be a range within the instrument's own, 45-64, not 40-64"),
        ({}, {"keys": (60, 50)}, "not 60-50"),
        ({}, {"format": "mp3"}, "format 'mp3' is not one of flac, wav"),
        ({}, {"bits": "32f"}, "bits '32f' is not one of 16, 24"),
        (FIVE, {"every": 2}, "every must be 1"),
        (WHITE, {"keys": (49, 49)}, "keys: the instrument's tuning leaves all of them out"),
    ],
)
def test_what_cannot_be_is_refused_by_name(tuning: dict, choices: dict, reported: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reported)):
        SampledPlan(instrument_of(tuning=tuning), **choices)


def test_a_tuning_is_never_transposed_and_keys_that_it_leaves_out_have_no_sample() -> None:
    assert SampledPlan(instrument_of(tuning=FIVE)).every == 1
    zones = SampledPlan(instrument_of(tuning=WHITE), (48, 59)).zones
    assert {zone.key for zone in zones} == {48, 50, 52, 53, 55, 57, 59}
