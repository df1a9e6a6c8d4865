"""A preset of many strings becomes one of a string that is given; others refuse."""

from __future__ import annotations

import math
import re
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import torch

from engine.pluck import Pluck
from engine.presets import (
    STRINGS,
    PresetError,
    find_string,
    of_string,
    read_described_string,
    read_string,
)
from engine.schema import SchemaError
from engine.sources import ModelSource, TruthSource
from engine.values.string import StringParameters
from tests.engine.sounds import KNOWING, initial_m, relative, shipped

STEEL = StringParameters(0.648, 5.0671e-08, 2.0432e-16, 7850.0, 2.2e11, 8e-06, 1.4e-06, 72.2016)
TOML = "".join(f"{name} = {value}\n" for name, value in asdict(STEEL).items())


def test_a_steel_string_is_played_by_the_same_preset() -> None:
    many = shipped("studio_any_string")
    preset = of_string(many, STEEL, 44_100)
    assert preset.info.rate_hz == 44_100
    assert preset.info.modes == STEEL.modes_below(20_000)
    assert math.isclose(preset.info.horizon_s, 0.5, rel_tol=1e-3)
    initial, found = initial_m(preset.info, Pluck(0.3, 2.0))[None], []
    for source in (ModelSource(preset), TruthSource(preset.info)):
        found.append(source.advance(source.start(initial), 4410)[0])
    assert relative(*found) ** 2 < 1e-9
    assert of_string(many) is many
    assert of_string(many, modes=7).info.modes == 7
    assert of_string(many, rate_hz=4_000).info.modes == many.info.string.modes_below(2_000)


@pytest.mark.parametrize(
    ("name", "changed", "words"),
    [
        ("studio_any_string", {"tension_n": 1e6, "length_m": 0.01}, "no mode below"),
        ("studio_any_string", {"damping_d1_kg_m_s": 100.0}, "overdamped"),
        (KNOWING, {}, "choose a preset of many strings"),
    ],
)
def test_an_impossible_string_or_a_preset_of_one_is_refused(name: str, changed: dict[str, float], words: str) -> None:
    with pytest.raises(PresetError, match=words):
        of_string(shipped(name), replace(StringParameters(), **changed))


def test_a_string_file_is_read_and_may_describe_its_string(tmp_path: Path) -> None:
    file = tmp_path / "steel.toml"
    for described, words in (
        ("", ""),
        ('description = """\nOf 7850 kg/m³,\n 0.25 mm."""\n', "Of 7850 kg/m³, 0.25 mm."),
    ):
        file.write_text(described + TOML, encoding="utf-8")
        assert read_described_string(file) == (STEEL, words)


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
        (TOML.replace("tension_n", "# "), r"wrong\.toml: tension_n is missing"),
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
    **dict.fromkeys(("bass_e1", "harp_c6"), ""),
    **{
        f"piano_{key}": f"decay time near 3 kHz {s}"
        for key, s in (("c2", 8.0), ("f3", 5.32), ("c4", 3.61), ("cs5", 1.86))
    },
}
NAMES = sorted(path.stem for path in STRINGS.glob("*.toml"))


@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_string_is_a_preset_with_what_was_learned_at_its_pitch(name: str) -> None:
    """Inside the family, except those whose files say what is beyond."""
    many = shipped("studio_any_string")
    string = read_string(find_string(name))
    assert many.info.family is not None
    warnings = many.info.family.warnings(string)
    assert len(warnings) == bool(BEYOND.get(name))
    assert all(words.startswith(BEYOND[name]) for words in warnings)
    _, description = read_described_string(find_string(name))
    assert ("Beyond the family: " in description) == (name in BEYOND)
    own, expected = shipped(f"studio_any_{name}"), of_string(many, string)
    assert own.info.string == string
    assert own.info.description == f"{description} Played by the model of every string."
    for key, tensor in expected.model.state_dict().items():
        # logarithms differ in their last digit between makes of processor; so do places on the grid between NumPy
        # and the PyTorch that wrote these files, and the sine of mode 99 has 300 times that
        torch.testing.assert_close(own.model.state_dict()[key], tensor, rtol=1e-12, atol=1e-13)
    # its quiet first mode sounds the note of its name; those of two sources keep the tensions given there
    step, sharp, octave = re.fullmatch(r"[a-z]+_([a-g])(s?)([1-6])", name).groups()
    key = 12 * (int(octave) + 1) + {"c": 0, "d": 2, "e": 4, "f": 5, "g": 7, "a": 9, "b": 11}[step] + len(sharp)
    pitch_hz = math.sqrt(string.undamped_frequency(1) ** 2 - string.decay_rate(1) ** 2) / (2 * math.pi)
    cents = 1200 * math.log2(pitch_hz / 440) - 100 * (key - 69)
    assert abs(cents) < (11 if name.startswith("nylon") or name == "steel_ds3" else 0.2)
