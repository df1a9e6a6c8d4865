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
        OSError: the folder is not there or cannot be written, or the disk is full; it names `path`.
    """
    stem = f".{path.name[:100]}.{this_computer()}"
    _remove_left_over(path.parent, stem)
    unfinished = path.with_name(f"{stem}-{os.getpid()}.unfinished")
    try:
        with naming(path):
            yield unfinished
            unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Within, an OSError of the system's names what was to be written: of a full disk it names no file at all."""
    try:
        yield
    except OSError as error:
        nobodys = error.filename is None or ".unfinished" in str(error.filename)
        if error.errno is not None and nobodys:
            error.filename = str(path)
        raise


def _remove_left_over(folder: Path, stem: str) -> None:
    """Of processes of this computer that are no more; another's, in a shared folder, cannot be asked about."""
    pattern = re.compile(re.escape(stem) + r"-(\d{1,9})\.unfinished")
    with suppress(OSError):
        for name in os.listdir(folder):  # noqa: PTH208 - names alone: the folder may be large
            found = pattern.fullmatch(name)
            if found and not is_alive(int(found[1])):
                (folder / name).unlink(missing_ok=True)


def this_computer() -> str:
    """In a name, the mark of processes of this computer."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def is_alive(process: int) -> bool:
    """Whether there is such a process on this computer."""
    import psutil  # only where something was left

    return bool(psutil.pid_exists(process))
