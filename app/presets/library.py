"""The presets that can be chosen: the shipped ones and the user's own folder."""

from __future__ import annotations

import functools
from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from psygnal import Signal

from app.presets.words import model_word
from app.shared.user_files import read_all
from engine.folders import user_folder
from engine.plain_text import name_text, one_line
from engine.presets import (
    SHIPPED,
    PresetError,
    PresetInfo,
    described_parameters,
    preset_digest,
    preset_files,
    read_info,
    unreadable,
)
from engine.schema import SchemaError
from training.cell import Cell
from training.heard_file import Heard, read_heard

FIRST = "studio_any_string"
LONGEST_TITLE = 120  # characters in a list
STUDIO = "studio_"  # begins the names of presets at full bandwidth


@dataclass(frozen=True)
class PresetEntry:
    """A preset that can be chosen, of which only the metadata has been read.

    Attributes:
        heard: how its sound differs from the truth's; None where it has not been measured.
    """

    name: str
    path: Path
    info: PresetInfo
    size_bytes: int = 0
    heard: Heard | None = None

    @cached_property
    def parameters(self) -> int:
        """The number of the model's parameters. Raises PresetError: the description is of an impossible model."""
        return described_parameters(self.path, self.info)

    @property
    def own(self) -> bool:
        """Return True if it is the user's, not shipped with the program."""
        return self.path.parent == user_folder()

    @property
    def studio(self) -> bool:
        """Return True if it is a studio preset (full bandwidth, for playing).

        Those are listed before research presets.
        """
        return self.name.startswith(STUDIO)

    @property
    def title(self) -> str:
        """The title as listed, in one line.

        The user's own are marked, so that a copy differs from the shipped one.
        """
        title = one_line(self.info.title, LONGEST_TITLE)
        return f"{title} (yours)" if self.own else title


class Library:
    """The presets that can be chosen, as `list_presets` orders them. `changed` is emitted when `entries` is new."""

    changed = Signal()

    def __init__(self, entries: list[PresetEntry]) -> None:
        self.entries = entries
        self._problems: list[str] = []  # as last returned by `list_presets`

    @property
    def names(self) -> list[str]:
        return [entry.name for entry in self.entries]

    def find(self, name: str) -> PresetEntry | None:
        return next((entry for entry in self.entries if entry.name == name), None)

    def first(self) -> PresetEntry | None:
        """The preset of the first start: `FIRST`, else the one of the least error among those of the highest rate."""
        if (entry := self.find(FIRST)) is not None:
            return entry
        highest_hz = max((entry.info.rate_hz for entry in self.entries), default=0)
        fullest = [entry for entry in self.entries if entry.info.rate_hz == highest_hz]
        return min(fullest, key=lambda e: 1.0 if e.info.rel_mae is None else e.info.rel_mae, default=None)

    def refresh(self) -> list[str]:
        """Read the folders again and replace `entries` where they have changed.

        Returns a line for each file that cannot be used, without those of the last time.
        """
        entries, problems = list_presets()
        if entries != self.entries:
            self.entries = entries
            self.changed.emit()
        problems_before, self._problems = self._problems, problems
        return [problem for problem in problems if problem not in problems_before]


def list_presets(*folders: Path) -> tuple[list[PresetEntry], list[str]]:
    """The usable presets, studio ones first, then by name; and a line for each file that cannot be used.

    Args:
        folders: by default the shipped one and the user's; of two presets of one name, that of the earlier folder.
    """
    folders = folders or (SHIPPED, user_folder())
    tables = [read_heard(folder) for folder in folders]
    # audible errors that were measured, by the digest of the preset's file
    records = {digest: by_digest for table, _ in tables for digest, by_digest in table.items()}
    problems = [problem for _, table_problems in tables for problem in table_problems]

    def read(path: Path) -> PresetEntry:
        state = path.stat()
        entry = _read_entry(path, state.st_mtime_ns, state.st_size)
        return replace(entry, heard=records.get(preset_digest(path))) if records else entry

    files = [path for folder in folders for path in preset_files(folder)]
    entries, of_files = read_all(files, read, PresetError, "a preset")
    problems += [*filter(None, map(unreadable, folders)), *of_files]
    models = Counter(title for title, _ in {(entry.title, entry.info.model) for entry in entries.values()})
    for name, entry in entries.items():
        if models[entry.title] > 1:  # two models of one string
            reported_apart = f"{entry.info.title} ({model_word(entry.info.model)})"
            entries[name] = replace(entry, info=replace(entry.info, title=reported_apart))
    return sorted(entries.values(), key=lambda entry: (not entry.studio, entry.name)), problems


@functools.lru_cache(maxsize=512)
def _read_entry(path: Path, changed_ns: int, size_bytes: int) -> PresetEntry:
    """Read an entry, cached by time and size of the file: the browser lists all presets whenever it opens."""
    info = read_info(path)
    titled_info = replace(info, title=display_title(name_text(path.stem), info))
    return PresetEntry(name_text(path.stem), path, titled_info, size_bytes)


def display_title(name: str, info: PresetInfo) -> str:
    """The title of a preset's cell of the paper's tables, by name and content; else its own title.

    A file from before a title was changed has the old one in it.
    """
    try:
        cell = Cell.parse(name)
    except SchemaError:
        return info.title
    if cell is None:
        return info.title
    named = cell.model, cell.tension_modulated, cell.initial, cell.rate_hz, cell.horizon
    key_facts = info.model, info.tension_modulated, info.initial, info.rate_hz, info.horizon_steps
    return cell.title if named == key_facts else info.title
