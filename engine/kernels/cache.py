"""The folder of compiled kernels, and a check that all of them are there, made without loading the compiler."""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from engine.parameters import PLAYED
from engine.whole_file import lasting_folder


def _sources() -> list[Path]:
    """The source files of all functions that make sound and pictures, and call one another across files.

    The numbers of `bounds` and `levels` are in their code, too.
    """
    engine = Path(__file__).parents[1]
    numbers = engine / "bounds.py", engine / "levels.py"
    return sorted([*(engine / "kernels").rglob("*.py"), *engine.glob("*/_*kernel.py"), *numbers])


@cache
def _version() -> str:
    """The name of these very sources: 16 hexadecimal digits of a hash of their files and of the values' names."""
    digest = hashlib.sha256()
    for source in _sources():
        digest.update(source.read_bytes())
    digest.update(" ".join(PLAYED).encode())  # the numbers of values are in code as well
    return digest.hexdigest()[:16]


@cache
def folder() -> Path | None:
    """A folder for these very sources.

    It is where the user says, else beside them, in the home folder, or a temporary one.

    None where nothing can be written at all: then what is compiled is not kept. Numba notices that a function's own
    file has changed, but not a file that it calls into. With one folder a version nothing compiled for another memory
    layout is ever loaded.
    """
    for place in _places():
        if _can_be_written(place):
            return place
    try:
        made = lasting_folder(Path(tempfile.gettempdir()), "learned-strings-kernels")
    except OSError:
        return None
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def _places() -> Iterator[Path]:
    """The folders for compiled kernels, in the order of preference."""
    name = f"kernels-{_version()}"
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(chosen) / name
    yield Path(__file__).parent / "__pycache__" / name
    with suppress(RuntimeError):  # no home
        yield Path("~/.cache/learned-strings").expanduser() / name


def _can_be_written(place: Path) -> bool:
    """Return True if a trial file can be made there: permissions are not all that can forbid it."""
    try:
        place.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=place):
            return True
    except OSError:  # read-only, or full
        return False


def is_whole() -> bool:
    """Return True if everything has been compiled, so that nobody has to wait for it."""
    mark = _mark()
    return mark is not None and mark.exists()


def set_whole() -> None:
    """Note that everything has been compiled."""
    if (mark := _mark()) is not None:
        mark.touch()


def _mark() -> Path | None:
    """The file whose presence says that everything has been compiled; None where nothing is kept."""
    place = folder()
    return place and place / f"whole-{_version()}"
