"""Where presets lie: the shipped folder and the user's own, known without loading anything heavy."""

from __future__ import annotations

import os
from pathlib import Path

from platformdirs import user_data_path

FOLDER_VARIABLE = "LEARNED_STRINGS_PRESETS"


def user_folder() -> Path:
    """LEARNED_STRINGS_PRESETS, else the platform's place for a user's data. It need not be there."""
    given = os.environ.get(FOLDER_VARIABLE)
    return Path(given) if given else user_data_path("learned-strings", appauthor=False) / "presets"


def usable_files() -> list[Path]:
    """The files that names mean, by name: of two of one name, the shipped one."""
    from engine.presets import finding

    folders = (user_folder(), finding.SHIPPED)
    files = {path.stem: path for folder in folders for path in finding.preset_files(folder)}
    return [files[name] for name in sorted(files)]
