"""Which preset files there are: the shipped ones, or those of any folder."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path

from engine.plain_text import one_line
from engine.presets.file import PresetError

SHIPPED = Path(__file__).parents[2] / "presets"


def preset_files(*folders: Path) -> list[Path]:
    """The preset files of the given folders (the shipped ones by default), by name.

    A folder that is missing, or that nobody may look into, has none; `unreadable` gives the reason.
    """
    found = []
    for folder in folders or (SHIPPED,):
        with contextlib.suppress(OSError):
            found += [path for path in folder.iterdir() if path.suffix == ".safetensors"]
    return sorted(found, key=lambda path: path.stem)


def unreadable(folder: Path) -> str:
    """Why a folder that is there cannot be looked into, in one line; empty where it can, or is not there."""
    try:
        next(folder.iterdir(), None)
    except FileNotFoundError:
        return ""
    except OSError as error:
        return one_line(f"{folder}: cannot be looked into ({error.strerror}); check its name and permissions")
    return ""


def find_preset(name_or_path: str, files: Iterable[Path] | None = None) -> Path:
    """The file of a preset given by its name among `files` (by default the shipped ones), or by path.

    Raises:
        PresetError: there is none; the message lists the names.
    """
    by_name = {path.stem: path for path in (preset_files() if files is None else files)}
    if name_or_path in by_name:
        return by_name[name_or_path]
    path = Path(name_or_path)
    if path.exists():
        return path
    known = ", ".join(by_name) or "none is installed"
    raise PresetError(f"no preset {name_or_path!r}; give a file or one of: {known}")
