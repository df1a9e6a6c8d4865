"""The presets that can be chosen: the shipped ones and the user's own folder."""

from __future__ import annotations

import functools
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

from psygnal import Signal

from app.presets.folders import user_folder
from app.presets.words import model_word
from engine.plain_text import one_line
from engine.presets import (
    SHIPPED,
    PresetError,
    PresetInfo,
    described_parameters,
    preset_digest,
    preset_files,
    read_info,
)
from engine.schema import SchemaError
from training.cell import Cell
from training.heard_file import Heard, read_heard

FIRST = "studio_any_string"
LONGEST_TITLE = 120  # characters in a list
STUDIO = "studio_"  # begins the names of presets at full bandwidth


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
    def studio(self) -> bool:
        """Whether it is listed before the research presets: at full bandwidth, for playing."""
        return self.name.startswith(STUDIO)

    @property
    def title(self) -> str:
        """As it is listed: a copy in the user's folder is told from the shipped one."""
        title = one_line(self.info.title, LONGEST_TITLE)
        return f"{title} (yours)" if self.own else title


class Library:
    """The presets, found by name: studio presets first, by name among each other. `changed`: they are others now."""

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
    """The usable presets, studio ones first, then by name; and a line for each file that cannot be used.

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
                    problems.append(f"{path}: a preset of this name exists already; rename the file to use it")
                    continue
                state = path.stat()
                entry = _read_entry(path, state.st_mtime_ns, state.st_size)
                entries[path.stem] = replace(entry, heard=heard.get(preset_digest(path))) if heard else entry
            except PresetError as error:
                problems.append(str(error))
            except OSError as error:  # taken away meanwhile
                problems.append(f"{path}: cannot be read ({error.strerror})")
            except Exception as error:  # whatever one file brings about, the others are listed
                problems.append(one_line(f"{path}: cannot be used ({type(error).__name__} {error}); remove the file"))
    models = Counter(title for title, _ in {(entry.title, entry.info.model) for entry in entries.values()})
    for name, entry in entries.items():
        if models[entry.title] > 1:  # two models of one string
            told_apart = f"{entry.info.title} ({model_word(entry.info.model)})"
            entries[name] = replace(entry, info=replace(entry.info, title=told_apart))
    return sorted(entries.values(), key=lambda entry: (not entry.studio, entry.name)), problems


@functools.lru_cache(maxsize=512)
def _read_entry(path: Path, changed_ns: int, size_bytes: int) -> PresetEntry:
    """Remembered for as long as the file is the same one: the browser looks each time that it opens."""
    info = read_info(path)
    listed = replace(info, title=display_title(path.stem, info))
    return PresetEntry(path.stem, path, listed, described_parameters(path, info), size_bytes)


def display_title(name: str, info: PresetInfo) -> str:
    """Of a preset that fills a cell of the paper's tables, the cell's title, however old the file; else its own."""
    try:
        cell = Cell.parse(name)
    except SchemaError:
        return info.title
    if cell is None:
        return info.title
    named = cell.model, cell.tension_modulated, cell.initial, cell.rate_hz, cell.horizon
    stored = info.model, info.tension_modulated, info.initial, info.rate_hz, info.horizon_steps
    return cell.title if named == stored else info.title
