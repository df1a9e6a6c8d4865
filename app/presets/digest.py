"""Which preset a file is, by its content."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

from engine.preset import PresetError


def preset_digest(path: Path) -> str:
    """SHA-256 of a preset's file, in hexadecimal. Raises PresetError."""
    try:
        state = path.stat()
        return _digest(path, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise PresetError(f"{path}: the preset cannot be read any more ({error.strerror}); put it back") from error


@functools.lru_cache(maxsize=512)
def _digest(path: Path, changed_ns: int, size_bytes: int) -> str:
    """Remembered for as long as the file is the same one."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
