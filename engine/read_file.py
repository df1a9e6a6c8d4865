"""Files that anybody may have made, read whole: ordinary ones alone, and only up to a size."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # a pipe would keep us waiting


class UnusableFile(OSError):
    """A file that is there and must not be read: not ordinary, or larger than any of ours. `strerror` says which."""


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """All bytes of a file of at most `most_bytes`.

    Raises:
        UnusableFile: it is larger, or a folder, a pipe or a device.
        OSError: it cannot be read.
    """
    try:
        descriptor = os.open(path, _FLAGS)
    except ValueError:  # of a null character
        raise UnusableFile(errno.EINVAL, "no file can have this name", str(path)) from None
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise UnusableFile(errno.EINVAL, "not an ordinary file", str(path))
    with os.fdopen(descriptor, "rb") as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        most = f"{most_bytes // 2**20} MiB" if most_bytes >= 2**20 else f"{most_bytes // 2**10} KiB"
        raise UnusableFile(errno.EFBIG, f"larger than the {most} that it may have", str(path))
    return data
