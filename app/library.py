"""The presets that can be chosen: the shipped ones and the user's own folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from engine.preset import SHIPPED, PresetError, PresetInfo, described_parameters, preset_files, read_info


@dataclass(frozen=True)
class PresetEntry:
    """A preset that can be chosen, known by its metadata alone."""

    name: str
    path: Path
    info: PresetInfo
    parameters: int


def list_presets(*folders: Path) -> tuple[list[PresetEntry], list[str]]:
    """The usable presets by name, and a line for each file that is not one: it does not hide the rest."""
    entries, problems = [], []
    for path in preset_files(*(folders or (SHIPPED,))):
        try:
            info = read_info(path)
            entries.append(PresetEntry(path.stem, path, info, described_parameters(path, info)))
        except PresetError as error:
            problems.append(str(error))
    return entries, problems
