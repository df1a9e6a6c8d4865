"""The presets that can be chosen: the shipped ones and the user's own folder."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path

from psygnal import Signal

from app.presets.folders import user_folder
from engine.presets import (
    SHIPPED,
    PresetError,
    PresetInfo,
    described_parameters,
    preset_digest,
    preset_files,
    read_info,
)
from training.heard_file import Heard, read_heard

FIRST = "studio_any_string"


@dataclass(frozen=True)
class PresetEntry:
    """A preset that can be chosen, known by its metadata alone, and `heard`: how true it sounds, if that is known."""

    name: str
    path: Path
    info: PresetInfo
    parameters: int
    size_bytes: int = 0
    heard: Heard | None = None

    @property
    def own(self) -> bool:
        """Whether it is the user's, not shipped with the program."""
        return self.path.parent == user_folder()

    @property
    def title(self) -> str:
        """As it is listed: a copy in the user's folder is told from the shipped one."""
        return f"{self.info.title} (yours)" if self.own else self.info.title


class Library:
    """The presets in the order of the list, found by name. `changed` tells that there are others now."""

    changed = Signal()

    def __init__(self, entries: list[PresetEntry]) -> None:
        self.entries = entries
        self._problems: list[str] = []  # that have been told

    @property
    def names(self) -> list[str]:
        return [entry.name for entry in self.entries]

    def find(self, name: str) -> PresetEntry | None:
        return next((entry for entry in self.entries if entry.name == name), None)

    def first(self) -> PresetEntry | None:
        """What a first start shows: the string of every string, or else the best of the highest rate."""
        if (chosen := self.find(FIRST)) is not None:
            return chosen
        highest_hz = max((entry.info.rate_hz for entry in self.entries), default=0)
        fullest = [entry for entry in self.entries if entry.info.rate_hz == highest_hz]
        return min(fullest, key=lambda e: 1.0 if e.info.rel_mae is None else e.info.rel_mae, default=None)

    def refresh(self) -> list[str]:
        """Reads the folders again; whoever holds this library has the new entries.

        Returns what is not usable, without what was told the last time.
        """
        entries, problems = list_presets()
        if entries != self.entries:
            self.entries = entries
            self.changed.emit()
        told, self._problems = self._problems, problems
        return [problem for problem in problems if problem not in told]


def list_presets(*folders: Path) -> tuple[list[PresetEntry], list[str]]:
    """The usable presets by name, and a line for each file that is not one: it does not hide the rest.

    By default those of the shipped and of the user's folder; of two of one name, the one of the first folder.
    """
    entries: dict[str, PresetEntry] = {}
    folders = folders or (SHIPPED, user_folder())
    tables = [read_heard(folder) for folder in folders]
    heard = {digest: found for known, _ in tables for digest, found in known.items()}
    problems = [problem for _, found in tables for problem in found]
    for folder in folders:
        for path in preset_files(folder):
            try:
                if path.stem in entries:
                    problems.append(f"{path}: there is a preset of this name already; rename the file to use it")
                    continue
                state = path.stat()
                entry = _read_entry(path, state.st_mtime_ns, state.st_size)
                entries[path.stem] = replace(entry, heard=heard.get(preset_digest(path))) if heard else entry
            except PresetError as error:
                problems.append(str(error))
            except OSError as error:  # taken away meanwhile
                problems.append(f"{path}: cannot be read ({error.strerror})")
    return [entries[name] for name in sorted(entries)], problems


@functools.lru_cache(maxsize=512)
def _read_entry(path: Path, changed_ns: int, size_bytes: int) -> PresetEntry:
    """Remembered for as long as the file is the same one: the browser looks each time that it opens."""
    info = read_info(path)
    return PresetEntry(path.stem, path, info, described_parameters(path, info), size_bytes)
