"""The table of audible errors beside the presets: one a line, known by the digest of the preset's file.

So a preset that changes carries no old claim, and a copy keeps its own. The table may come from anywhere: whatever is
wrong in it is reported, and skipped.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from filelock import FileLock

from engine import bounds
from engine.schema import SchemaError
from engine.table import columns_of, read_table, write_table

NAME = "heard.csv"
METHOD = 1  # of the measurement: lines of another one say nothing
LARGEST_BYTES = 2**20
MOST_REPORTED = 3  # bad lines of a file
LONGEST_NAME = 200

_BOUNDS = {
    "seconds": (0.0, 600.0),
    "distance_db": (0.0, 200.0),
    "level_db": (-200.0, 200.0),
    "rise_db": (0.0, 200.0),
    "pitch_cents": (-12_000.0, 12_000.0),
    "split_cents": (0.0, 12_000.0),
    "runs_away_s": (0.0, 600.0),
    "hum_db": (-200.0, 200.0),
}


@dataclass(frozen=True)
class Heard:
    """A preset's sound against the truth's: medians over the plucks, see `engine.compare.audible.AudibleErrors`.

    Attributes:
        name: of the preset's file, for people; `sha256` is what counts.
        seconds: how long it was listened to.
        distance_db: the mean over the plucks; a pluck that runs away counts with all of the floor.
        split_cents: None: most plucks have one pitch.
        runs_away_s: the earliest of all plucks; None: none does.
        hum_db: what is left where a voice is made to end because its string is silent, of full scale; None: nothing,
            or it has not been measured.

    Raises:
        ValueError: a value that no measurement gives.
    """

    name: str
    sha256: str
    seconds: float
    distance_db: float
    level_db: float
    rise_db: float
    pitch_cents: float | None = None
    split_cents: float | None = None
    runs_away_s: float | None = None
    method: int = METHOD
    hum_db: float | None = None

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[0-9a-f]{64}", self.sha256):
            raise ValueError("sha256 must be 64 hexadecimal digits")
        if not self.name or len(self.name) > LONGEST_NAME or not self.name.isprintable():
            raise ValueError(f"name must be printable, of 1 … {LONGEST_NAME} characters")
        bounds.check_all(self, _BOUNDS)


COLUMNS = columns_of(Heard)


def read_heard(folder: Path) -> tuple[dict[str, Heard], list[str]]:
    """Read the audible errors of a folder's presets by digest, and a line for whatever is wrong. Raises nothing."""
    path = folder / NAME
    rows: dict[str, Heard] = {}
    problems: list[str] = []
    try:
        for row in read_table(Heard, path, "table of heard presets", LARGEST_BYTES, lines_apart=True):
            if isinstance(row, SchemaError):
                problems.append(str(row))
            elif row.method == METHOD:
                rows[row.sha256] = row
    except (FileNotFoundError, NotADirectoryError):
        return {}, []
    except SchemaError as error:
        return {}, [str(error)]
    except OSError as error:
        return {}, [f"{path}: cannot be read ({error.strerror or error}); presets are listed without it"]
    if (more := len(problems) - MOST_REPORTED) > 0:
        problems = [*problems[:MOST_REPORTED], f"{path}: {more} more lines cannot be used"]
    return rows, problems


def add_heard(folder: Path, measured: Iterable[Heard]) -> None:
    """Add to a folder's table, or make it; a preset's new line replaces the one of its name.

    Locked against other processes; whole or not at all. Lines that cannot be used are left out.

    Raises:
        OSError: the folder cannot be written.
    """
    path = folder / NAME
    with FileLock(path.with_name(f".{NAME}.lock")):
        known = {row.name: row for row in read_heard(folder)[0].values()}
        known |= {row.name: row for row in measured}
        write_table(path, Heard, (_rounded(known[name]) for name in sorted(known)))


def _rounded(row: Heard) -> Heard:
    """Round to a thousandth, which is far less than can be heard; adding nothing makes -0 a 0."""
    figures = {name: getattr(row, name) for name in _BOUNDS}
    return replace(row, **{name: round(value, 3) + 0.0 for name, value in figures.items() if value is not None})
