"""The program's name and version, as written into files and reports."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version

PROGRAM = "Learned Strings"


@cache
def program_version() -> str:
    """The installed version; "development" where the source runs without being installed."""
    try:
        return version("learned-strings")
    except PackageNotFoundError:
        return "development"
