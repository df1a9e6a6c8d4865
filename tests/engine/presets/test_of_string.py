"""A preset of many strings becomes one of a string that is given; others refuse."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from engine.pluck import Pluck
from engine.presets import (
    STRINGS,
    PresetError,
    find_preset,
    find_string,
    load_preset,
    of_string,
    read_described_string,
    read_string,
)
from engine.resonators.sine_transform import project
from engine.schema import SchemaError
from engine.sources import ModelSource, TruthSource
from engine.values.string import StringParameters

STEEL = StringParameters(0.648, 5.0671e-08, 2.0432e-16, 7850.0, 2.2e11, 8e-06, 1.4e-06, 72.2016)
TOML = """
length_m = 0.648
area_m2 = 5.0671e-08
second_moment_m4 = 2.0432e-16
density_kg_m3 = 7850.0
youngs_modulus_pa = 220000000000.0
damping_d1_kg_m_s = 8e-06
damping_d3_kg_m_s = 1.4e-06
tension_n = 72.2016
"""


def test_a_steel_string_is_played_by_the_same_preset() -> None:
    preset = of_string(load_preset(find_preset("studio_any_string")), STEEL, 44_100)
    assert preset.info.rate_hz == 44_100
    assert preset.info.modes == STEEL.modes_below(20_000)
    assert math.isclose(preset.info.horizon_s, 0.5, rel_tol=1e-3)
    initial = project(Pluck(0.3, 2.0).displacement(101), preset.info.modes)[None]
    model, truth = ModelSource(preset), TruthSource(preset.info)
    found, _ = model.advance(model.start(initial), 4410)
    expected, _ = truth.advance(truth.start(initial), 4410)
    assert float(((found - expected) ** 2).sum() / (expected**2).sum()) < 1e-9


def test_a_preset_of_one_string_says_so(small_preset: Path) -> None:
    with pytest.raises(PresetError, match="choose a preset of many strings"):
        of_string(load_preset(small_preset), STEEL)


def test_the_rate_bounds_the_modes_and_fewer_may_be_asked_for() -> None:
    preset = load_preset(find_preset("studio_any_string"))
    assert of_string(preset) is preset
    assert of_string(preset, modes=7).info.modes == 7
    assert of_string(preset, rate_hz=4_000).info.modes == preset.info.string.modes_below(2_000)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"tension_n": 1e6, "length_m": 0.01}, "no mode below"),
        ({"damping_d1_kg_m_s": 100.0}, "overdamped"),
    ],
)
def test_an_impossible_string_is_an_error_that_names_it(changed: dict[str, float], words: str) -> None:
    with pytest.raises(PresetError, match=words):
        of_string(load_preset(find_preset("studio_any_string")), replace(StringParameters(), **changed))


def test_a_string_file_is_read_and_may_describe_its_string(tmp_path: Path) -> None:
    file = tmp_path / "steel.toml"
    file.write_text('description = """\nSteel of 7850 kg/m³,\n 0.25 mm."""\n' + TOML, encoding="utf-8")
    assert read_described_string(file) == (STEEL, "Steel of 7850 kg/m³, 0.25 mm.")
    file.write_text(TOML, encoding="utf-8")
    assert read_described_string(file) == (STEEL, "")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("length_m = ", "not valid TOML"),
        ("length = 1.0", "unknown field 'length'"),
        ("length_m = -1.0", "length_m must lie in"),
        ("length_m = nan", "finite"),
        ("description = 5", "description must be a text"),
        ("a = " + "[" * 5_000, "not valid TOML"),
        ("# " + "x" * 2**20, "larger than"),
        # none of the parameters is taken from the string of the paper
        (TOML.replace("tension_n = 72.2016", ""), r"wrong\.toml: tension_n is missing"),
        ("", r"length_m, area_m2, .*, tension_n are missing; .*gives all of length_m, area_m2,"),
    ],
)
def test_a_wrong_string_file_is_named(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    with pytest.raises(SchemaError, match=words) as caught:
        read_string(file)
    assert str(file) in str(caught.value)


BEYOND = {  # where high modes ring too long, as warned of; pitch alone makes no error grow
    "bass_e1": "",
    "harp_c6": "",
    "piano_c2": "decay time near 3 kHz 8.0",
    "piano_f3": "decay time near 3 kHz 5.32",
    "piano_c4": "decay time near 3 kHz 3.61",
    "piano_cs5": "decay time near 3 kHz 1.86",
}
NAMES = sorted(path.stem for path in STRINGS.glob("*.toml"))


@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_string_is_a_preset_with_what_was_learned(name: str) -> None:
    """Inside the family, except those whose files say what is beyond."""
    many = load_preset(find_preset("studio_any_string"))
    string = read_string(find_string(name))
    assert many.info.family is not None
    warnings = many.info.family.warnings(string)
    assert len(warnings) == bool(BEYOND.get(name))
    assert all(words.startswith(BEYOND[name]) for words in warnings)
    _, description = read_described_string(find_string(name))
    assert ("Beyond the family: " in description) == (name in BEYOND)
    own, expected = load_preset(find_preset(f"studio_any_{name}")), of_string(many, string)
    assert own.info.string == string
    assert own.info.description == f"{description} Played by the model of every string."
    for key, tensor in expected.model.state_dict().items():
        # logarithms differ in their last digit between makes of processor; so do places on the grid between NumPy
        # and the PyTorch that wrote these files, and the sine of mode 99 has 300 times that
        torch.testing.assert_close(own.model.state_dict()[key], tensor, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_string_sounds_the_note_of_its_name(name: str) -> None:
    """Its quiet first mode, by equal temperament from 440 Hz; those of two sources keep the tensions given there."""
    step, sharp, octave = re.fullmatch(r"[a-z]+_([a-g])(s?)([1-6])", name).groups()
    key = 12 * (int(octave) + 1) + {"c": 0, "d": 2, "e": 4, "f": 5, "g": 7, "a": 9, "b": 11}[step] + len(sharp)
    string = read_string(find_string(name))
    pitch_hz = math.sqrt(string.undamped_frequency(1) ** 2 - string.decay_rate(1) ** 2) / (2 * math.pi)
    cents = 1200 * math.log2(pitch_hz / 440) - 100 * (key - 69)
    assert abs(cents) < (11 if name.startswith("nylon") or name == "steel_ds3" else 0.2)
