"""The places of files: the one dialog that asks for them, the folders that it remembers, and the recent files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from PySide6.QtCore import QFileInfo, QStandardPaths
from PySide6.QtWidgets import QFileDialog, QWidget

from app.shared.value import Value
from engine.plain_text import name_text

MOST_RECENT = 10
LONGEST_PATH = 4_096  # characters
FileKind = Literal["open", "note", "recording", "sampler", "plugin", "instrument", "test"]
SOUNDS: tuple[FileKind, ...] = ("note", "recording", "sampler")  # whose first folder is the user's music
MODES = {
    "open": (QFileDialog.FileMode.ExistingFiles, QFileDialog.AcceptMode.AcceptOpen),
    "save": (QFileDialog.FileMode.AnyFile, QFileDialog.AcceptMode.AcceptSave),
    "folder": (QFileDialog.FileMode.Directory, QFileDialog.AcceptMode.AcceptOpen),
}


def _full_path(text: str) -> str:
    if "\0" in text or not Path(text).is_absolute():
        raise ValueError("give a full path")
    return text


FullPath = Annotated[str, Field(max_length=LONGEST_PATH), AfterValidator(_full_path)]


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
        last = self.choices.folders.get(kind, "")
        if last and QFileInfo(last).isDir():
            return Path(last)
        locations = QStandardPaths.StandardLocation
        standard = locations.MusicLocation if kind in SOUNDS else locations.DocumentsLocation
        own = QStandardPaths.writableLocation(standard)
        return first or (Path(own) if own and QFileInfo(own).isDir() else Path.home())

    def remember(self, kind: FileKind, folder: Path) -> None:
        if (text := _stored(folder)) is not None:
            self.choices = self.choices.model_copy(update={"folders": {**self.choices.folders, kind: text}})

    @property
    def recent(self) -> list[Path]:
        """The files that were opened last, the latest first; some may be gone."""
        return [Path(file) for file in self.choices.recent]

    def opened(self, file: Path) -> None:
        """Put a file first among the recent ones."""
        self.forget(file)
        if (text := _stored(file)) is not None:
            recent = (text, *self.choices.recent)[:MOST_RECENT]
            self.choices = self.choices.model_copy(update={"recent": recent})

    def forget(self, file: Path) -> None:
        """Remove a file from the recent ones."""
        recent = tuple(path for path in self.choices.recent if path != _stored(file))
        self.choices = self.choices.model_copy(update={"recent": recent})

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


def _stored(path: Path) -> str | None:
    """The text of a path in the settings; None: it has none, as bytes of a name may be no characters."""
    text = str(path.absolute())
    return text if text == name_text(text) and len(text) <= LONGEST_PATH else None
