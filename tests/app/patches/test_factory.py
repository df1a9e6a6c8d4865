"""The shipped patches: each can be played over all its keys, at every velocity, as physics and as an instrument.

The string of a key is found here by its closed form: the highest open string at or below the key's pitch is shortened
until its quiet first partial has that pitch.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import pytest

from app.patches.library import SHIPPED, file_stem, list_patches
from app.patches.patch import CATEGORIES, Patch
from app.patches.tuning import Tuning
from engine import bounds
from engine.presets import load_preset
from engine.presets.finding import SHIPPED as PRESETS
from engine.resonators.family import inharmonicity
from engine.resonators.string import StringParameters

ENTRIES, PROBLEMS = list_patches(SHIPPED)
PATCHES = [entry.patch for entry in ENTRIES]
PITCH_RANGE_HZ = (30, 1500)
MOST_INHARMONIC = 3e-3  # beyond it nothing was ever measured of the model
MOST_TENSION_RISE = 0.5
MOST_MODES = 99
HIGHEST_HZ = 20_000.0
GRID_POINTS = 101


def string_of(patch: Patch, pitch_hz: float) -> StringParameters:
    """The string that sounds a pitch, with the patch's knobs."""
    omega, below = 2 * math.pi * pitch_hz, False
    if patch.strings.kind == "fretted":
        chosen = patch.strings.string
    else:
        note = round(69 + 12 * math.log2(pitch_hz / 440))
        lower = [each for each in patch.strings.strings if each.note <= note]
        chosen, below = (lower or patch.strings.strings[:1])[-1].string, not lower
    knobs, base = patch.knobs, chosen.parameters
    string = replace(
        base,
        area_m2=base.area_m2 * knobs.gauge**2,
        second_moment_m4=base.second_moment_m4 * knobs.gauge**4 * knobs.stiffness,
        density_kg_m3=base.density_kg_m3 * knobs.density,
        youngs_modulus_pa=base.youngs_modulus_pa * knobs.modulus,
        damping_d1_kg_m_s=base.damping_d1_kg_m_s * knobs.decay,
        damping_d3_kg_m_s=base.damping_d3_kg_m_s * knobs.brightness_decay,
    )
    load, bending = string.mass_per_length_kg_m * omega**2, string.youngs_modulus_pa * string.second_moment_m4
    if below:
        eta = math.pi / string.length_m
        return replace(string, tension_n=load / eta**2 - bending * eta**2)
    eta_squared = 2 * load / (string.tension_n + math.sqrt(string.tension_n**2 + 4 * bending * load))
    return replace(string, length_m=math.pi / math.sqrt(eta_squared))


def keys_of(patch: Patch) -> dict[int, float]:
    """The pitch of each key that sounds."""
    tuning = Tuning(patch.tuning)
    low, high = patch.range
    return {key: tuning.hz(key) for key in range(low, high + 1) if tuning.mapped(key)}


def test_there_are_many_and_none_is_broken() -> None:
    assert PROBLEMS == [] and len(ENTRIES) >= 32
    counted = Counter(patch.category for patch in PATCHES)
    assert all(counted[category] >= 5 for category in CATEGORIES), counted
    assert len({patch.name for patch in PATCHES}) == len(PATCHES)
    assert len({patch.mode for patch in PATCHES}) > 1 and sum(bool(patch.tuning.scale) for patch in PATCHES) >= 4


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)
def test_a_file_is_named_after_its_patch_and_tells_what_it_is(entry) -> None:
    patch = entry.patch
    assert entry.name == file_stem(patch.name) and entry.name.isascii()
    assert 20 <= len(patch.description) <= 200 and patch.description.endswith(".")
    assert patch.strings.kind == "fretted" or patch.strings.strings[0].note >= patch.range[0] - 24


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.name)
def test_every_key_is_a_string_that_the_model_knows(patch: Patch) -> None:
    family = load_preset(PRESETS / f"{patch.preset}.safetensors").info.family
    assert family is not None
    assert family.position[0] <= patch.pluck.position <= family.position[1]
    half = 0.5 if patch.pluck.shape == "raised_cosine" else 1.0
    for width in (patch.pluck.width, patch.pluck.width_hard):
        assert patch.pluck.shape == "triangular" or family.half_width[0] <= half * width <= family.half_width[1]
    keys = keys_of(patch)
    assert len(keys) >= 20
    for key, pitch_hz in keys.items():
        assert PITCH_RANGE_HZ[0] <= pitch_hz <= PITCH_RANGE_HZ[1], key
        string = string_of(patch, pitch_hz)
        assert string.undamped_frequency(1) / (2 * math.pi) == pytest.approx(pitch_hz, rel=1e-9)
        assert inharmonicity(string) <= MOST_INHARMONIC, (key, inharmonicity(string))
        assert 0.5 <= math.log(1000) / string.decay_rate(1) <= 40, (key, math.log(1000) / string.decay_rate(1))
        modes = min(MOST_MODES, string.modes_below(HIGHEST_HZ))
        bounds.check_motion(string, modes, GRID_POINTS, 48_000, tension_modulated=True)


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.name)
def test_no_pluck_raises_the_tension_beyond_training(patch: Patch) -> None:
    worst = 0.0
    plucks = [patch.pluck.pluck(velocity).displacement(GRID_POINTS) for velocity in (1, 64, 96, 127)]
    for pitch_hz in keys_of(patch).values():
        string = string_of(patch, pitch_hz)
        resonator = string.resonator(min(MOST_MODES, string.modes_below(HIGHEST_HZ)), grid_points=GRID_POINTS)
        rises = [float(resonator.relative_tension_rise(resonator.to_modes(pluck))) for pluck in plucks]
        assert rises == sorted(rises)
        worst = max(worst, rises[-1])
    assert worst <= MOST_TENSION_RISE


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.name)
def test_macros_stand_where_the_fields_are(patch: Patch) -> None:
    """Touching a macro without moving it changes nothing that is heard, and both its ends can be played."""
    assert 3 <= len(patch.macros) <= 8
    for number, macro in enumerate(patch.macros):
        same, low, high = (patch.turned(number, value) for value in (macro.value, 0, 1))
        for target in macro.targets:
            assert same.value(target.field) == pytest.approx(patch.value(target.field), rel=5e-3, abs=1e-3)
            assert low.value(target.field) != high.value(target.field)
