"""The shelf: the strings that are shipped as files.

Each is a preset of its own with what was learned of many.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from engine.presets import STRINGS, Preset, of_string, read_described_string, save_preset

TITLES = {
    "nylon_e4": "Nylon guitar, E4",
    "nylon_b3": "Nylon guitar, B3",
    "nylon_g3": "Nylon guitar, G3",
    "nylon_d3": "Nylon guitar, D3 (wound)",
    "nylon_a2": "Nylon guitar, A2 (wound)",
    "nylon_e2": "Nylon guitar, E2 (wound)",
    "steel_e4": "Electric guitar, E4",
    "steel_b3": "Electric guitar, B3",
    "steel_g3": "Electric guitar, G3",
    "steel_d3": "Electric guitar, D3 (wound)",
    "steel_a2": "Electric guitar, A2 (wound)",
    "steel_e2": "Electric guitar, E2 (wound)",
    "bass_g2": "Electric bass, G2 (wound)",
    "bass_d2": "Electric bass, D2 (wound)",
    "bass_a1": "Electric bass, A1 (wound)",
    "bass_e1": "Electric bass, E1 (wound)",
    "harp_c6": "Concert harp, C6 (nylon)",
    "harp_c5": "Concert harp, C5 (nylon)",
    "harp_c4": "Concert harp, C4 (nylon)",
    "harp_c2": "Concert harp, C2 (wire)",
    "piano_cs5": "Piano string, C sharp 5, plucked",
    "piano_c4": "Piano string, C4, plucked",
    "piano_f3": "Piano string, F3, plucked",
    "piano_c2": "Piano string, C2, plucked",
    "steel_ds3": "Steel wire, D sharp 3",
}


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
