"""Files that a user asked for, written whole or not at all; a failure names the remedy."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from engine import whole_file as engine_files

REMEDIES = {
    errno.ENOSPC: "free some space, or choose another disk",
    errno.EDQUOT: "free some space, or choose another disk",
    errno.EFBIG: "choose another disk, or a shorter result",
    errno.EACCES: "choose a folder that you may write to",
    errno.EPERM: "choose a folder that you may write to",
    errno.EROFS: "choose a folder that you may write to",
    errno.ENOENT: "make the folder first, or choose another",
    errno.ENOTDIR: "choose another folder",
    errno.ENAMETOOLONG: "choose a shorter name",
}


class WriteError(Exception):
    """A file could not be written. The message names the path, what happened and the remedy."""


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """An open file beside `path` that takes its place when the block ends without an error, and else is deleted.

    Raises:
        WriteError: for every OSError within the block: at its beginning where the folder cannot be written to, later
            where the disk is full.
    """
    try:
        target = replaceable(path)
        with engine_files.whole_file(target) as unfinished, unfinished.open("w+b") as file:
            yield file
    except OSError as error:
        raise WriteError(explain(path, error)) from error


def replaceable(path: Path) -> Path:
    """The file that a path names, through links. Raises WriteError where it is a folder or a device."""
    target = path.resolve()
    if target.exists() and not target.is_file():
        raise WriteError(f"{path}: not a file that can be replaced; choose another name")
    return target


def explain(path: Path, error: OSError) -> str:
    """The error in one line: the path, the system's words and what to do."""
    remedy = REMEDIES.get(error.errno or 0, "choose another place")
    return f"{path}: cannot be written ({error.strerror or error}); {remedy}"
