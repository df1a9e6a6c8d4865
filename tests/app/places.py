"""Places of files for tests: folders that are remembered, and what a user chooses in a dialog."""

from pathlib import Path
from typing import get_args

import pytest
from PySide6.QtWidgets import QFileDialog, QWidget

from app.views.file_places import FileChoices, FileKind, FilePlaces


def files_in(folder: Path) -> FileChoices:
    """The choices of a user who kept files of every kind there."""
    return FileChoices(folders=dict.fromkeys(get_args(FileKind), folder))


def places_in(folder: Path) -> FilePlaces:
    return FilePlaces(files_in(folder))


def choose_files(monkeypatch: pytest.MonkeyPatch, *files: Path) -> list[str]:
    """Choose these in every dialog from now on; none: cancel. The places that the dialogs suggested."""
    shown: list[str] = []

    def choose(parent: QWidget, title: str, place: str, *filters: str) -> list[str]:
        shown.append(place)
        return [str(file) for file in files]

    monkeypatch.setattr(QFileDialog, "getOpenFileNames", lambda *given: (choose(*given), ""))
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *given: (next(iter(choose(*given)), ""), ""))
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *given: next(iter(choose(*given)), ""))
    return shown
