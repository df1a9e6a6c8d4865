"""Files and folders that are written whole or not at all, and what killed processes have left of them."""

from __future__ import annotations

import os
import platform
import re
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

ENDING = ".unfinished"


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to.

    It takes its place when the block ends well, and an error leaves nothing.

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
    """Name what was to be written in an OSError of the system's within.

    Of a full disk it names no file at all.
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
