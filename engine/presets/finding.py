"""The list of preset files: the shipped ones, or those of any folder."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

from engine.plain_text import name_text, one_line
from engine.presets.file import PresetError

SHIPPED = Path(__file__).parents[2] / "presets"
SUFFIX = ".safetensors"


def preset_files(*folders: Path) -> list[Path]:
    """The preset files of the given folders (the shipped ones by default), by name.

    A folder that is missing, or that nobody may look into, has none; `unreadable` gives the reason.
    """
    paths = []
    for folder in folders or (SHIPPED,):
        with contextlib.suppress(OSError):
            paths += [path for path in folder.iterdir() if path.suffix == SUFFIX]
    return sorted(paths, key=lambda path: path.stem)


def unreadable(folder: Path) -> str:
    """The reason, in one line, why a folder cannot be looked into; empty where it can, or is not there."""
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
        PresetError: there is none; the message has names like it.
    """
    by_name = {name_text(path.stem): path for path in (preset_files() if files is None else files)}
    if name_or_path in by_name:
        return by_name[name_or_path]
    path = Path(name_or_path)
    if path.exists():
        return path
    if path.suffix == SUFFIX or len(path.parts) > 1:
        raise PresetError(f"{one_line(name_or_path)}: no such file; check the path")
    close = get_close_matches(name_or_path, by_name)
    known = f"did you mean {' or '.join(close)}?" if close else "`learned-strings presets` lists all."
    raise PresetError(f"no preset {name_or_path!r}; {known} Give one of your own by its file, as runs/my_run{SUFFIX}")
