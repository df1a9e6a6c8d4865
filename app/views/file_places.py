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
LONGEST_PATH = 4_096  # characters
FileKind = Literal["open", "note", "recording", "sampler", "plugin", "instrument", "test", "figure"]
SOUNDS: tuple[FileKind, ...] = ("note", "recording", "sampler")  # whose first folder is the user's music
MODES = {
    "open": (QFileDialog.FileMode.ExistingFiles, QFileDialog.AcceptMode.AcceptOpen),
    "save": (QFileDialog.FileMode.AnyFile, QFileDialog.AcceptMode.AcceptSave),
    "folder": (QFileDialog.FileMode.Directory, QFileDialog.AcceptMode.AcceptOpen),
}


def _full_path(path: Path) -> Path:
    """The path, where settings can hold it: bytes of a name may be no characters."""
    text = str(path)
    if not path.is_absolute() or len(text) > LONGEST_PATH or "\0" in text or name_text(text) != text:
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
        """The folder that was used last for a kind of file; where that is gone `first`, else music or documents."""
        last = self.choices.folders.get(kind)
        if last is not None and QFileInfo(str(last)).isDir():
            return last
        locations = QStandardPaths.StandardLocation
        standard = locations.MusicLocation if kind in SOUNDS else locations.DocumentsLocation
        own = QStandardPaths.writableLocation(standard)
        return first or (Path(own) if own and QFileInfo(own).isDir() else Path.home())

    def remember(self, kind: FileKind, folder: Path) -> None:
        self._change(self.choices.recent, {**self.choices.folders, kind: folder.absolute()})

    def opened(self, file: Path) -> None:
        """Put a file first among the recent ones."""
        self.forget(file)
        self._change((file.absolute(), *self.choices.recent)[:MOST_RECENT], self.choices.folders)

    def forget(self, file: Path) -> None:
        """Remove a file from the recent ones."""
        recent = tuple(path for path in self.choices.recent if path != file.absolute())
        self._change(recent, self.choices.folders)

    def _change(self, recent: tuple[Path, ...], folders: dict[FileKind, Path]) -> None:
        with suppress(ValueError):  # of a path that cannot be remembered
            self.choices = FileChoices(recent=recent, folders=folders)

    def ask(
        self, parent: QWidget, kind: FileKind, title: str, mode: str, filters: str = "", path: Path | None = None
    ) -> list[Path]:
        """Ask for files, a file to write or a folder, one of MODES; none where the user gives none.

        Args:
            filters: as of `QFileDialog`.
            path: that is suggested, or its name alone. A file to write gets its ending.
        """
        dialog = QFileDialog(parent, title, str(self.folder(kind)), filters)
        file_mode, accept_mode = MODES[mode]
        dialog.setFileMode(file_mode)
        dialog.setAcceptMode(accept_mode)
        if path is not None:
            if path.is_absolute() and QFileInfo(str(path.parent)).isDir():
                dialog.setDirectory(str(path.parent))
            dialog.selectFile(path.name)
            dialog.setDefaultSuffix(path.suffix)
        accepted, chosen = dialog.exec(), [Path(file) for file in dialog.selectedFiles()]
        dialog.deleteLater()
        if not accepted or not chosen:
            return []
        self.remember(kind, chosen[0] if mode == "folder" else chosen[0].parent)
        if path is not None and chosen[0].suffix.lower() != path.suffix.lower():  # of "strings v1.2"
            named = chosen[0].with_name(chosen[0].name + path.suffix)
            return self.ask(parent, kind, title, mode, filters, named) if named.exists() else [named]
        return chosen
