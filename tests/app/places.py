"""Places of files for tests: folders that are remembered, and what a user chooses in a dialog."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest
from PySide6.QtWidgets import QFileDialog

from app.views.file_places import FileChoices, FileKind, FilePlaces


def files_in(folder: Path) -> FileChoices:
    """The choices of a user who kept files of every kind there."""
    return FileChoices(folders=dict.fromkeys(get_args(FileKind), folder))


def places_in(folder: Path) -> FilePlaces:
    return FilePlaces(files_in(folder))


def choose_files(monkeypatch: pytest.MonkeyPatch, *files: Path) -> list[QFileDialog]:
    """Choose these in every dialog from now on; none: cancel. The dialogs that were shown."""
    shown: list[QFileDialog] = []
    monkeypatch.setattr(QFileDialog, "exec", lambda dialog: shown.append(dialog) or bool(files))
    monkeypatch.setattr(QFileDialog, "selectedFiles", lambda dialog: [str(file) for file in files])
    return shown
