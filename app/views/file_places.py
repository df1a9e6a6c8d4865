"""The places of files: the one dialog that asks for them, the folders that it remembers, and the recent files."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from PySide6.QtCore import QFileInfo, QStandardPaths
from PySide6.QtWidgets import QFileDialog, QWidget

from app.shared.value import Value
from engine.plain_text import name_text

MOST_RECENT = 10
FileKind = Literal["open", "note", "recording", "sampler", "plugin", "instrument", "test", "figure"]


def _full_path(path: Path) -> Path:
    """The path, where settings can hold it: bytes of a name may be no characters."""
    if not path.is_absolute() or "\0" in str(path) or name_text(str(path)) != str(path):
        raise ValueError("give a full path")
    return path


FullPath = Annotated[Path, AfterValidator(_full_path)]


class FileChoices(Value):
    """The folder that was used last, by kind of file, and the files that were opened last, the latest first."""

    folders: dict[FileKind, FullPath] = Field({})
    recent: tuple[FullPath, ...] = Field((), max_length=MOST_RECENT)


class FilePlaces:
    """The way to ask for the place of a file. `choices`: to be remembered."""

    def __init__(self, choices: FileChoices | None = None) -> None:
        self.choices = choices or FileChoices()

    def folder(self, kind: FileKind, first: Path | None = None) -> Path:
        """The folder that was used last for a kind of file; where that is gone `first`, else the user's music."""
        last = self.choices.folders.get(kind)
        if last is not None and QFileInfo(str(last)).isDir():
            return last
        music = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.MusicLocation)
        return first or (Path(music) if QFileInfo(music).isDir() else Path.home())

    def remember(self, kind: FileKind, folder: Path) -> None:
        self._change(folders={**self.choices.folders, kind: folder.absolute()})

    def opened(self, file: Path) -> None:
        """Put a file first among the recent ones; one that is gone is removed from them."""
        first = [file.absolute()] if QFileInfo(str(file)).isFile() else []
        others = (path for path in self.choices.recent if path != file.absolute())
        self._change(recent=[*first, *others][:MOST_RECENT])

    def _change(self, **fields: object) -> None:
        with suppress(ValueError):  # of a path that cannot be remembered
            self.choices = FileChoices.model_validate({**dict(self.choices), **fields})

    def ask_to_open(self, parent: QWidget, filters: str) -> list[Path]:
        """Ask for files; `filters`: as of `QFileDialog`."""
        names, _ = QFileDialog.getOpenFileNames(parent, "Open", str(self.folder("open")), filters)
        for name in names[:1]:
            self.remember("open", Path(name).parent)
        return [Path(name) for name in names]

    def ask_folder(self, parent: QWidget, kind: FileKind, title: str) -> Path | None:
        name = QFileDialog.getExistingDirectory(parent, title, str(self.folder(kind)))
        if name:
            self.remember(kind, Path(name))
        return Path(name) if name else None

    def ask_to_save(self, parent: QWidget, kind: FileKind, title: str, filters: str, path: Path) -> Path | None:
        """Ask for a file to write, which gets the ending of `path`: that is suggested, or its name alone."""
        folder = path.parent if path.is_absolute() and QFileInfo(str(path.parent)).isDir() else self.folder(kind)
        name, _ = QFileDialog.getSaveFileName(parent, title, str(folder / path.name), filters)
        if not name:
            return None
        file = Path(name)
        self.remember(kind, file.parent)
        if file.suffix.lower() == path.suffix.lower():
            return file
        file = file.with_name(file.name + path.suffix)  # of "strings v1.2"
        return self.ask_to_save(parent, kind, title, filters, file) if file.exists() else file
