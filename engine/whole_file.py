"""Files that are read whole, up to a size, and written whole or not at all; and what killed processes have left."""

from __future__ import annotations

import errno
import os
import platform
import re
import shutil
import stat
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # a pipe would keep us waiting
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
ENDING = ".unfinished"


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


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to: the file there becomes `path` when the block ends well.

    An error leaves nothing of it, and `path` as it was.

    What killed processes have left in its folder is removed first.

    Raises:
        OSError: the folder is not there or cannot be written, or the disk is full; it names `path`.
    """
    remove_left_over(path.parent)
    unfinished = path.with_name(f"{_mark(path.name)}{ENDING}")
    try:
        with naming(path):
            yield unfinished
            unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A folder beside `path` to fill: it takes its place when the block ends well, and an error leaves nothing.

    Raises:
        OSError: see `whole_file`.
    """
    with working_folder(path.parent, path.name) as working:
        made, before = working / "made", working / "before"
        made.mkdir()
        yield made
        with naming(path):
            if path.exists():
                path.replace(before)
            try:
                made.replace(path)
            except OSError:
                if before.exists():
                    before.replace(path)
                raise


@contextmanager
def working_folder(parent: Path, name: str) -> Iterator[Path]:
    """A folder for the time of the block. What killed processes have left in `parent` is removed first.

    Raises:
        OSError: `parent` is not there or cannot be written; it names `parent`.
    """
    made = lasting_folder(parent, name)
    try:
        yield made
    finally:
        shutil.rmtree(made, ignore_errors=True)


def lasting_folder(parent: Path, name: str) -> Path:
    """A new folder for the time of this process, which removes it; see `working_folder`."""
    remove_left_over(parent)
    with naming(parent):
        return Path(tempfile.mkdtemp(prefix=f"{_mark(name)}-", suffix=ENDING, dir=parent))


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Put `path` into an OSError from within that names no file, or only an unfinished one.

    The system names no file where the disk is full.
    """
    try:
        yield
    except OSError as error:
        nobodys = error.filename is None or ".unfinished" in str(error.filename)
        if error.errno is not None and nobodys:
            error.filename = str(path)
        raise


def remove_left_over(folder: Path) -> None:
    """Remove unfinished files and folders of this user's processes that are no more.

    Those of other users or computers stay: in a shared folder, nobody here knows whether they are under way.
    """
    pattern = re.compile(rf"\..+\.{this_computer()}-(\d{{1,9}})(-\w+)?{re.escape(ENDING)}", re.DOTALL)
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            match = pattern.fullmatch(entry.name)
            if not match or not _is_own(entry) or is_alive(int(match[1])):
                continue
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry.path, ignore_errors=True)
            else:
                Path(entry.path).unlink(missing_ok=True)


def _is_own(entry: os.DirEntry[str]) -> bool:
    """Return True if this user owns an entry of a folder; also where the system has no owners."""
    return not hasattr(os, "getuid") or entry.stat(follow_symlinks=False).st_uid == os.getuid()


def _mark(name: str) -> str:
    """The beginning of an unfinished file's name: what it becomes, and the process that writes it."""
    short = os.fsencode(name)[:100].decode(errors="ignore")
    return f".{short}.{this_computer()}-{os.getpid()}"


def this_computer() -> str:
    """The mark, in a name, of processes of this computer."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def is_alive(process: int) -> bool:
    """Return True if there is such a process on this computer."""
    import psutil  # only where something was left

    return bool(psutil.pid_exists(process))


class WriteError(Exception):
    """A file could not be written. The message names the path, what happened and the remedy."""


@contextmanager
def result_file(path: Path) -> Iterator[BinaryIO]:
    """A file that a user asked for, open beside `path`, as `whole_file`.

    Raises:
        WriteError: for every OSError within the block: at its beginning where the folder cannot be written to, later
            where the disk is full.
    """
    try:
        target = replaceable(path)
        with whole_file(target) as unfinished, unfinished.open("w+b") as file:
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
