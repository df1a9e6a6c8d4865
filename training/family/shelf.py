"""The shelf: the strings that are shipped as files.

Each is a preset of its own with what was learned of many.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from engine.presets import STRINGS, Preset, of_string, read_described_string, save_preset
from engine.schema import read_toml

TITLES: dict[str, str] = read_toml(Path(__file__).with_suffix(".toml"))


def put_on_shelf(preset: Preset, folder: Path) -> list[Path]:
    """Write a preset for each string of `TITLES`; the errors that it holds are those of the family."""
    written = []
    for name, title in TITLES.items():
        string, description = read_described_string(STRINGS / f"{name}.toml")
        named = of_string(preset, string)
        info = replace(named.info, title=title, description=f"{description} Played by the model of every string.")
        written.append(folder / f"studio_any_{name}.safetensors")
        save_preset(written[-1], info, named.model)
    return written
