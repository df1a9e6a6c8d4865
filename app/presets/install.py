"""Installation of a preset file in the user's own folder, after all checks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from engine.bounds import LARGEST_PRESET_BYTES
from engine.plain_text import name_text
from engine.presets import PresetError, load_preset, preset_digest
from engine.read_file import read_bounded
from engine.result_file import WriteError, explain, whole_file
from engine.sources import ModelSource

SUFFIX = ".safetensors"


class InstallError(Exception):
    """A file could not be installed. The message names it, what is wrong and the remedy."""


@dataclass(frozen=True)
class Installed:
    """The place of an installed preset.

    `was_there`: nothing was copied, as a preset with the same bytes was there already.
    """

    name: str
    path: Path
    was_there: bool


def install_preset(file: Path, folder: Path, present: Iterable[Path]) -> Installed:
    """Check a preset file and copy it into `folder`, which is made if needed.

    Args:
        present: the files of all presets; where one of them has the same name, a number is appended.

    Raises:
        InstallError: the file is no usable preset, or the copy cannot be written; no part of it is left then.
    """
    try:
        ModelSource(load_preset(file))  # all checks, and that a pluck can start it
        digest = preset_digest(file)
    except (PresetError, ValueError) as error:
        raise InstallError(str(error)) from error
    present = list(present)
    for path in present:
        if _has_digest(path, digest):
            return Installed(name_text(path.stem), path, was_there=True)
    stems = {path.stem for path in present}
    stem = name_text(file.stem)
    names = (stem if number == 1 else f"{stem}_{number}" for number in count(1))
    target = next(path for name in names if name not in stems and not (path := folder / f"{name}{SUFFIX}").exists())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        data = read_bounded(file, LARGEST_PRESET_BYTES)
        with whole_file(target) as copy:
            copy.write(data)
    except OSError as error:
        raise InstallError(explain(target, error)) from error
    except WriteError as error:
        raise InstallError(str(error)) from error
    return Installed(target.stem, target, was_there=False)


def _has_digest(path: Path, digest: str) -> bool:
    try:
        return preset_digest(path) == digest
    except PresetError:
        return False
