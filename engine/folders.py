"""The folders of presets, runs and data sets. Importing this does not load torch."""

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
    return _data_folder() / "presets"


def working_folder(variable: str, name: str) -> Path:
    """The path in an environment variable, else `name` beside the sources.

    Installed without its project file, as a wheel or in a bundle, the program keeps it in the platform's folder for a
    user's data.
    """
    if folder := os.environ.get(variable):
        return Path(folder)
    root = Path(__file__).parents[1]
    return (root if (root / "pyproject.toml").exists() else _data_folder()) / name


def _data_folder() -> Path:
    """The program's folder among the platform's for a user's data; it need not exist."""
    from platformdirs import user_data_path

    return user_data_path("learned-strings", appauthor=False)


def usable_files() -> list[Path]:
    """The file of each preset, sorted by name; of two with the same name, the shipped one."""
    from engine.presets import finding

    folders = (user_folder(), finding.SHIPPED)
    files = {name_text(path.stem): path for folder in folders for path in finding.preset_files(folder)}
    return [files[name] for name in sorted(files)]
