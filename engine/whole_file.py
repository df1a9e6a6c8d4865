"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import platform
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to: it takes its place when the block ends well, and an error leaves nothing.

    What a process that was killed has left of the same file is removed first.

    Raises:
        OSError: the folder is not there or cannot be written, or the disk is full.
    """
    stem = f".{path.name[:100]}.{zlib.crc32(platform.node().encode()):08x}"
    _remove_left_over(path.parent, stem)
    unfinished = path.with_name(f"{stem}-{os.getpid()}.unfinished")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def _remove_left_over(folder: Path, stem: str) -> None:
    """Of processes of this computer that are no more; another's, in a shared folder, cannot be asked about."""
    pattern = re.compile(re.escape(stem) + r"-(\d{1,9})\.unfinished")
    with suppress(OSError):
        for name in os.listdir(folder):  # noqa: PTH208 - names alone: the folder may be large
            found = pattern.fullmatch(name)
            if found and not _is_alive(int(found[1])):
                (folder / name).unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    import psutil  # only where something was left

    return bool(psutil.pid_exists(process))
