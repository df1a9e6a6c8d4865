"""The window's view of every export: work with progress, which can be cancelled, and its result in words."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from app.export.recipe import RecipeError
from app.shared.worker import Progress
from engine.presets import PresetError
from engine.sources import Runaway
from engine.whole_file import WriteError

EXPECTED = (PresetError, RecipeError, Runaway, WriteError, ValueError)  # their messages are for the user


class ExportJob(Protocol):
    """An export whose choices are made.

    Attributes:
        file: that is written, or the first of several.
        cancelled: the files that are left after it was cancelled, in words.
    """

    cancelled: str

    @property
    def file(self) -> Path: ...

    def run(self, progress: Progress) -> str:
        """Write the files and return the result in words, a line each. Any thread.

        Raises:
            Cancelled: `progress` raised it.
            One of EXPECTED: it failed.
        """
