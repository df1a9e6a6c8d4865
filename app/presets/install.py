"""Installation of a preset file in the user's own folder, after all checks."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from app.shared.user_files import install
from engine.bounds import LARGEST_PRESET_BYTES
from engine.plain_text import name_text
from engine.presets import PresetError, load_preset
from engine.sources import ModelSource
from engine.whole_file import read_bounded

SUFFIX = ".safetensors"


def install_preset(file: Path, folder: Path, present: Iterable[Path]) -> tuple[Path, bool]:
    """Check a preset file and copy it into `folder`, which is made if needed.

    Args:
        present: the files of all presets; where one of them has the same name, a number is appended.

    Returns:
        Its place, and whether a preset with the same bytes was there already, so that nothing was copied.

    Raises:
        PresetError: the file is no usable preset.
        WriteError: the copy cannot be written; no part of it is left then.
    """
    try:
        ModelSource(load_preset(file))  # all checks, and that a pluck can start it
        data = read_bounded(file, LARGEST_PRESET_BYTES)
    except OSError as error:
        raise PresetError(f"{file}: cannot be read ({error.strerror}); check the name") from error
    except ValueError as error:
        raise PresetError(str(error)) from error
    present = list(present)
    path = install(data, f"{name_text(file.stem)}{SUFFIX}", folder, present)
    return path, path in present
