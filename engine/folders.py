"""The folders of presets: the shipped one and the user's own. Importing this does not load torch."""

from __future__ import annotations

import os
from pathlib import Path

from engine.plain_text import name_text

FOLDER_VARIABLE = "LEARNED_STRINGS_PRESETS"


def user_folder() -> Path:
    """The path in LEARNED_STRINGS_PRESETS, else `presets` in the platform's folder for a user's data.

    The folder need not exist.
    """
    if folder := os.environ.get(FOLDER_VARIABLE):
        return Path(folder)
    from platformdirs import user_data_path

    return user_data_path("learned-strings", appauthor=False) / "presets"


def usable_files() -> list[Path]:
    """The file of each preset, sorted by name; of two with the same name, the shipped one."""
    from engine.presets import finding

    folders = (user_folder(), finding.SHIPPED)
    files = {name_text(path.stem): path for folder in folders for path in finding.preset_files(folder)}
    return [files[name] for name in sorted(files)]
