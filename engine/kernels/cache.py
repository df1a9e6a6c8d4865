"""Where compiled kernels are kept, and whether all of them are there; told without loading the compiler."""

from __future__ import annotations

import hashlib
import os
import tempfile
from functools import cache
from pathlib import Path


def _sources() -> list[Path]:
    """Of all compiled functions, which call one another across files."""
    engine = Path(__file__).parents[1]
    return sorted([*(engine / "kernels").glob("*.py"), *engine.glob("*/_*kernel.py")])


@cache
def _version() -> str:
    digest = hashlib.sha256()
    for source in _sources():
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


@cache
def folder() -> Path:
    """A folder for these very sources: where the user says, else beside them, in the home folder, or a temporary one.

    Numba notices that a function's own file has changed, but not a file that it calls into. With one folder a version
    nothing compiled for another memory layout is ever loaded.
    """
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen)
    name = f"kernels-{_version()}"
    for place in (Path(__file__).parent / "__pycache__", Path("~/.cache/learned-strings").expanduser()):
        try:
            (place / name).mkdir(parents=True, exist_ok=True)
        except (OSError, RuntimeError):  # read-only, or no home
            continue
        if os.access(place / name, os.W_OK):
            return place / name
    return Path(tempfile.mkdtemp(prefix=name))


def is_whole() -> bool:
    """Whether everything has been compiled, so that nobody has to wait for it."""
    return _mark().exists()


def set_whole() -> None:
    """Notes that everything has been compiled."""
    _mark().touch()


def _mark() -> Path:
    return folder() / f"whole-{_version()}"
