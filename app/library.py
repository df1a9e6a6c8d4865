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

    @property
    def unplayable(self) -> str:
        """Why its model cannot be let go from rest, or nothing."""
        if self.info.model_configuration.get("input") == "two_frames":
            return "its model needs the frame before the first, which a string at rest does not have"
        return ""


class Library:
    """The presets in the order of the list, found by name."""

    def __init__(self, entries: list[PresetEntry]) -> None:
        self.entries = entries

    @property
    def names(self) -> list[str]:
        return [entry.name for entry in self.entries]

    def find(self, name: str) -> PresetEntry | None:
        return next((entry for entry in self.entries if entry.name == name), None)

    def first(self) -> PresetEntry | None:
        """What a first start shows: the best of the highest rate."""
        highest_hz = max((entry.info.rate_hz for entry in self.entries), default=0)
        fullest = [entry for entry in self.entries if entry.info.rate_hz == highest_hz]
        return min(fullest, key=lambda e: 1.0 if e.info.rel_mae is None else e.info.rel_mae, default=None)


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
