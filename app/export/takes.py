"""The takes of a session: recordings in the order in which they were played, with the files that are theirs."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import TypeAdapter

from app.export.journal import Journal
from app.export.played import Played, recorded_files
from app.patches.fields import Name
from engine.schema import explained
from engine.whole_file import WriteError, explain

_NAME = TypeAdapter(Name)


@dataclass(eq=False)
class RecordedTake:
    """A recording, kept in memory and, until it is saved, in its journal.

    Attributes:
        name: of its files, without their endings.
        journal: None: it is saved, or could not be begun.
        files: WAV and MIDI file that are its own, each with its mark; none until it is saved.
    """

    played: Played
    journal: Journal | None
    name: str = ""
    files: dict[Path, tuple[int, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.name = self.name or self.played.patch.name

    @property
    def saved(self) -> bool:
        return bool(self.files)

    @property
    def folder(self) -> Path:
        return next(iter(self.files)).parent

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
        """Rename it and its files, or change nothing.

        Raises:
            ValueError: no file can have the name, or one has it; or its own were moved, deleted or replaced.
            WriteError: the folder cannot be written to.
        """
        try:
            name = _NAME.validate_python(name)
        except ValueError as error:
            raise ValueError(explained(error)) from error
        if name == self.name:
            return
        wanted = recorded_files(self.folder / f"{name}.wav") if self.saved else ()
        renamed = dict(zip(self._own_files(), wanted, strict=True))
        if taken := next((file for file in renamed.values() if file.exists()), None):
            raise ValueError(f"{taken.name} is there already; choose another name")
        done: list[Path] = []
        for before, after in renamed.items():
            try:
                before.rename(after)
            except OSError as error:
                for file, back in zip(done, renamed, strict=False):
                    file.rename(back)
                raise WriteError(explain(after, error)) from error
            done.append(after)
        self.name, self.files = name, {file: _mark(file) for file in done}

    def delete(self) -> list[Path]:
        """Delete its files, or its journal; return those of its names that are other files by now, which stay.

        Raises:
            WriteError: one cannot be deleted.
        """
        others = []
        for file, mark in self.files.items():
            if (found := _mark(file)) != mark:
                others += [file] if found else []
                continue
            try:
                file.unlink()
            except OSError as error:
                raise WriteError(explain(file, error)) from error
        self.forget_journal()
        return others

    def _own_files(self) -> list[Path]:
        """Its files. Raises ValueError: one of them is not there as it was written."""
        for file, mark in self.files.items():
            if _mark(file) != mark:
                raise ValueError(f"{file} is not there as it was saved; nothing was changed")
        return list(self.files)


def free_path(folder: Path, name: str, taken: Collection[str]) -> Path:
    """The path of a take's WAV file in a folder, with a number where one of its files is there.

    Args:
        taken: names of files that will be there.
    """
    number, path = 2, folder / f"{name}.wav"
    while path.name in taken or any(file.exists() or file.is_symlink() for file in recorded_files(path)):
        number, path = number + 1, folder / f"{name} {number}.wav"
    return path


def _mark(file: Path) -> tuple[int, ...]:
    """Numbers that another file of the same name does not have; none where there is none."""
    try:
        there = file.stat()
    except OSError:
        return ()
    return there.st_dev, there.st_ino, there.st_size, there.st_mtime_ns
