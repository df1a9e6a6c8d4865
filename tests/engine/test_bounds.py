"""Small files that would hang or eat memory are refused by what they ask for, before anything is built."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from engine.presets import PresetError, PresetInfo, load_preset, preset_files, read_info
from engine.presets.file import METADATA_KEY
from engine.resonators.string import undamped_frequencies
from engine.values.string import StringParameters


def with_metadata(path: Path, change: Callable[[str], str]) -> Path:
    """The same weights with other metadata, as raw text."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<Q", data)
    header = json.loads(data[8 : 8 + length])
    header["__metadata__"][METADATA_KEY] = change(header["__metadata__"][METADATA_KEY])
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + data[8 + length :])
    return path


def changed(**values: Any) -> Callable[[str], str]:
    """Fields of the metadata, those of the string or of the model's configuration by their own name."""

    def change(text: str) -> str:
        facts = json.loads(text)
        for name, value in values.items():
            inside = [facts[part] for part in ("string", "model_configuration") if name in facts[part]]
            (inside[0] if inside else facts)[name] = value
        return json.dumps(facts)

    return change


HOSTILE: dict[str, tuple[Callable[[str], str], str]] = {
    "nested a thousand deep": (
        lambda text: text[:-1] + ', "training": ' + "[" * 1000 + "]" * 1000 + "}",
        "nested|recursion",
    ),
    "nested a hundred thousand deep": (lambda text: "[" * 100_000 + "]" * 100_000, "recursion"),
    "5000 digits": (lambda text: text[:-1] + ', "seed": ' + "7" * 5000 + "}", "digits"),
    "an error of 10**400": (changed(rel_mae=10**400), "rel_mae: must be a number of at most 64 bits"),
    "2**63 states": (changed(state_size=2**63), "state_size: must be a number of at most 64 bits"),
    "10**9 states": (changed(state_size=10**9), "state_size must lie in"),
    "300,000 widths": (changed(multiplier_widths=[8] * 300_000), "50000 entries"),
    "wide layers": (changed(multiplier_widths=[10**9]), "multiplier_widths must lie in"),
    "a string of 1000 km": (changed(length_m=1e6), "length_m must lie in 0.01 … 100"),
    "a stiffness beyond any": (changed(second_moment_m4=1e10), "second_moment_m4 must lie in"),
    "a stiffness within bounds, too high a mode": (
        changed(second_moment_m4=1e-6, youngs_modulus_pa=1e13),
        "too high for a rate_hz|sub-steps",
    ),
    "10,001 points at 1 MHz": (changed(grid_points=10_001, rate_hz=1_000_000), "grid_points times rate_hz"),
    "an overdamped mode": (changed(damping_d3_kg_m_s=10.0), "mode 1 is overdamped"),
    "no unit": (changed(scale_m=1e-300), "scale_m must lie in"),
    "a title of 100 kB": (changed(title="x" * 100_000), "title: has 100000 characters"),
    "a field of 100 kB": (changed(**{"y" * 100_000: 1}), "unknown field"),
    "an escape in a field": (changed(**{"\x1b]0;owned\x07\nfield": 1}), "unknown field"),
    "metadata of 2 MB": (lambda text: text[:-1] + " " * 2_000_000 + "}", "header|longer"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_description_is_refused_in_one_line(preset_file: Path, kind: str) -> None:
    change, message = HOSTILE[kind]
    path = with_metadata(preset_file, change)
    for reader in (read_info, load_preset):
        with pytest.raises(PresetError, match=message) as caught:
            reader(path)
        reported = str(caught.value)
        assert str(path) in reported and len(reported) <= 500 and reported.isprintable()


@pytest.mark.parametrize(("model", "field"), [("frnn", "depth"), ("lru", "layers"), ("dmd", "lags")])
def test_a_billion_layers_are_refused(preset_file: Path, model: str, field: str) -> None:
    def change(text: str) -> str:
        return json.dumps(json.loads(text) | {"model": model, "model_configuration": {field: 10**9}})

    with pytest.raises(PresetError, match=f"{field} must lie in"):
        read_info(with_metadata(preset_file, change))


def test_every_shipped_preset_is_within_bounds() -> None:
    assert [type(read_info(path)) for path in preset_files()] == [PresetInfo] * len(preset_files())


@pytest.mark.parametrize("frequency_hz", [0.0, 100.0, 246.93, 2_000.0, 20_000.0, 1e6])
@pytest.mark.parametrize(
    "string", [StringParameters(), StringParameters(second_moment_m4=0), StringParameters(length_m=90)]
)
def test_modes_below_counts_them(string: StringParameters, frequency_hz: float) -> None:
    count = string.modes_below(frequency_hz)
    frequencies = undamped_frequencies(string, count + 2)
    omega = 2 * 3.141592653589793 * frequency_hz
    assert int((frequencies < omega).sum()) == count


def test_modes_below_costs_nothing_of_any_string() -> None:
    """The table of all modes would take 15 TB here."""
    string = StringParameters(length_m=100.0, tension_n=1e-3, area_m2=1e-2, density_kg_m3=1e5, second_moment_m4=0)
    assert string.modes_below(1e9) > 10**12


@pytest.mark.parametrize("value", [None, True, math.nan, -1.0])
def test_a_number_of_a_string_is_a_number_within_its_bounds(value: object) -> None:
    with pytest.raises(ValueError, match="string parameter length_m must"):
        StringParameters(length_m=value)  # type: ignore[arg-type]
