"""The takes of a session: recordings as they were played, with the files that are theirs."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import TypeAdapter

from app.export.journal import Journal
from app.export.played import Played, recorded_files
from app.instruments.fields import Name

_NAME = TypeAdapter(Name)


@dataclass(eq=False)
class RecordedTake:
    """A recording, kept in memory and, until it is saved, in its journal.

    Attributes:
        journal: None: it is saved, or could not be begun.
        name: of its files, without their endings.
        files: its sound and its MIDI file, each with its mark: size and time of change. None until it is saved.
    """

    played: Played
    journal: Journal | None
    name: str
    files: dict[Path, tuple[int, int]] = field(default_factory=dict)

    @property
    def own_files(self) -> list[Path]:
        """The files that were not moved or changed since it was saved."""
        return [file for file, mark in self.files.items() if _mark(file) == mark]

    def save_to(self, path: Path) -> None:
        """Make files its own that were just written; `path`: its sound's."""
        self.files, self.name = {file: _mark(file) for file in recorded_files(path)}, path.stem
        self.forget_journal()

    def forget_journal(self) -> None:
        if self.journal is not None:
            self.journal.delete()
            self.journal = None

    def rename(self, name: str) -> None:
        """Rename it and its files.

        Raises:
            ValueError: no file can have the name, or one has it; or its own were moved or changed.
            OSError: a file cannot be renamed.
        """
        name = _NAME.validate_python(name)
        if self.own_files != list(self.files):
            raise ValueError(f"the files of {self.name} were moved or changed since they were saved")
        renamed = {file: file.with_name(f"{name}{file.suffix}") for file in self.files}
        if there := [file.name for file in renamed.values() if os.path.lexists(file)]:
            raise ValueError(f"{there[0]} is there already; choose another name")
        for before, after in renamed.items():
            before.rename(after)
            self.files[after] = self.files.pop(before)
        self.name = name

    def delete(self) -> None:
        """Delete its own files, or its journal. Raises OSError: a file cannot be deleted."""
        for file in self.own_files:
            file.unlink()
        self.forget_journal()


def free_path(path: Path) -> Path:
    """The path of a take's sound, with a number where one of its files is there."""
    number, free = 2, path
    while any(os.path.lexists(file) for file in recorded_files(free)):
        number, free = number + 1, path.with_name(f"{path.stem} {number}{path.suffix}")
    return free


def _mark(file: Path) -> tuple[int, int]:
    """The mark of a file, which changes with it: its size in bytes and its time of change in ns; zeros: no file."""
    there = file.stat() if file.exists() else None
    return (there.st_size, there.st_mtime_ns) if there else (0, 0)
