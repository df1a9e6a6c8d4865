"""Python processes that the project starts: they find code as this one does, and nothing in the current folder."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_ROOT = os.path.realpath(Path(__file__).parents[1])
_SAFE = "PYTHONSAFEPATH"


def is_bundled() -> bool:
    """Return True if the program runs from a bundle, whose own program takes the place of Python."""
    return getattr(sys, "frozen", False)


def python_command(*words: str) -> list[str]:
    """The command of another process of this Python: `words` are "-m", a module and its arguments, or "-c", code."""
    return [sys.executable, "-P", *words]


def python_environment() -> dict[str, str]:
    """The environment of a `python_command`, which finds modules where this process finds them.

    `python -m` and an empty entry in PYTHONPATH put the current folder on the path. There a file that is named as a
    module would be run. It is left out, unless it holds this very code.
    """
    try:
        current = os.path.realpath(Path.cwd())
    except OSError:  # it was removed
        current = ""
    places = [
        path
        for path in sys.path
        if Path(path).is_absolute() and (os.path.realpath(path) != current or current == _ROOT)
    ]
    return {**os.environ, _SAFE: "1", "PYTHONPATH": os.pathsep.join(dict.fromkeys([*places, _ROOT]))}


@contextmanager
def safe_children() -> Iterator[None]:
    """Keep the current folder from Python processes that libraries start within, as those of `multiprocessing`."""
    before = os.environ.get(_SAFE)
    os.environ[_SAFE] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE]
        else:
            os.environ[_SAFE] = before
