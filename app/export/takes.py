"""The takes of a session: recordings as they were played, with the files that are theirs."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import TypeAdapter

from app.export.journal import Journal
from app.export.played import Played, recorded_files
from app.patches.fields import Name
from engine.whole_file import WriteError, explain

_NAME = TypeAdapter(Name)


@dataclass(eq=False)
class RecordedTake:
    """A recording, kept in memory and, until it is saved, in its journal.

    Attributes:
        journal: None: it is saved, or could not be begun.
        name: of its files, without their endings.
        files: its sound and its MIDI file, each with its mark; none until it is saved.
    """

    played: Played
    journal: Journal | None
    name: str
    files: dict[Path, tuple[int, ...]] = field(default_factory=dict)

    def save_to(self, path: Path) -> None:
        """Make the files of a recording that were just written to `path` its own."""
        files = recorded_files(path)
        self.name, self.files = files[0].stem, {file: _mark(file) for file in files}
        self.forget_journal()

    def forget_journal(self) -> None:
        if self.journal is not None:
            self.journal.delete()
        self.journal = None

    def rename(self, name: str) -> None:
        """Rename it and its files.

        Raises:
            ValueError: no file can have the name, or one has it; its own were moved or changed; or they cannot be
                renamed. What is renamed by then stays its own.
        """
        name = _NAME.validate_python(name)
        renamed = {file: file.with_name(f"{name}{file.suffix}") for file in self.files}
        for before, after in renamed.items():
            if _mark(before) != self.files[before]:
                raise ValueError(f"{before} is not there as it was saved")
            if after.exists() and before != after:
                raise ValueError(f"{after.name} is there already; choose another name")
        for before, after in renamed.items():
            try:
                before.rename(after)
            except OSError as error:
                raise ValueError(explain(after, error)) from error
            self.files[after] = self.files.pop(before)
        self.name = name

    def delete(self) -> list[Path]:
        """Delete its files, or its journal; return those of its names that are other files by now, which stay.

        Raises:
            WriteError: one cannot be deleted.
        """
        for file, mark in self.files.items():
            try:
                if _mark(file) == mark:
                    file.unlink()
            except OSError as error:
                raise WriteError(explain(file, error)) from error
        self.forget_journal()
        return [file for file in self.files if file.exists()]


def free_path(path: Path, taken: Collection[Path]) -> Path:
    """The path of a take's sound, with a number where one of its files is or will be there."""
    number, free = 2, path
    while free in taken or any(file.exists() or file.is_symlink() for file in recorded_files(free)):
        number, free = number + 1, path.with_name(f"{path.stem} {number}{path.suffix}")
    return free


def _mark(file: Path) -> tuple[int, ...]:
    """Numbers that another file of the same name does not have; none where there is none."""
    try:
        there = file.stat()
    except OSError:
        return ()
    return there.st_dev, there.st_ino, there.st_size, there.st_mtime_ns
