"""The index of a batch: a CSV file with a row for each WAV file, written whole or not at all."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Literal, get_args

from filelock import FileLock

from app.export.files import ExportError
from engine import bounds
from engine.read_file import read_bounded
from engine.result_file import WriteError, explain, whole_file

INDEX = "index.csv"
Status = Literal["written", "kept", "failed"]
_BEGINNING = b"file,status,"  # of every index
STATUSES: tuple[Status, ...] = get_args(Status)


@dataclass(frozen=True)
class BatchRow:
    """A line of the index. Errors are the model's relative MAE at the listening points; the truth has none.

    Attributes:
        status: "kept": a file that was there already with the same recipe.
        clipped: number of samples.
        rel_mae_trained: up to the training horizon; rel_mae: over the whole file.
        message: why it failed, or a warning.
        string: the name of the string that a preset of many plays; "": the preset's own.
    """

    file: str
    status: Status
    preset: str
    position: float
    amplitude_mm: float
    source: str
    rate_hz: int
    seconds: float | None = None
    peak_db: float | None = None
    clipped: int | None = None
    rel_mae_trained: float | None = None
    rel_mae: float | None = None
    message: str = ""
    string: str = ""


class BatchIndex:
    """The CSV file; `rows`, by file name, has those of earlier batches in the same folder too.

    Raises:
        ExportError: a table that is no index has its name, or it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.rows = _read_rows(path)

    def add(self, rows: Sequence[BatchRow]) -> None:
        """Adds rows to the file as it is now, as another batch may write into the same folder; none: does nothing.

        What failed does not replace the row of a file that is still there.

        Raises:
            ExportError: the file cannot be written.
        """
        if not rows:
            return
        try:
            with FileLock(self._path.with_name(f".{self._path.name}.lock")):
                self.rows |= _read_rows(self._path)
                self.rows |= {row.file: row for row in rows if row.status != "failed" or not self._have(row.file)}
                self._write()
        except OSError as error:
            raise ExportError(explain(self._path, error)) from error

    def _have(self, file: str) -> bool:
        row = self.rows.get(file)
        return row is not None and row.status != "failed" and (self._path.parent / file).exists()

    def _write(self) -> None:
        text = io.StringIO()
        table = csv.DictWriter(text, [one.name for one in fields(BatchRow)], lineterminator="\n")
        table.writeheader()
        table.writerows(asdict(row) for row in self.rows.values())
        try:
            with whole_file(self._path) as file:
                file.write(text.getvalue().encode())
        except WriteError as error:
            raise ExportError(str(error)) from error


def _read_rows(path: Path) -> dict[str, BatchRow]:
    """By file name; empty where there is no index, or a damaged one, which will be replaced.

    Raises:
        ExportError: it is another table.
    """
    try:
        raw = read_bounded(path, bounds.LARGEST_TABLE_BYTES)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ExportError(explain(path, error)) from error
    if not _BEGINNING.startswith(raw[: len(_BEGINNING)]):
        raise ExportError(f"{path}: is there already, and no index of a batch; choose another folder")
    try:
        text = raw.decode("utf-8")
        return {row.file: row for row in map(_read_row, csv.DictReader(io.StringIO(text, newline="")))}
    except (ValueError, KeyError, TypeError, StopIteration, csv.Error):
        return {}


def _read_row(cells: dict[str, str]) -> BatchRow:
    def number(name: str) -> float | None:
        return float(cells[name]) if cells[name] else None

    status = next(status for status in STATUSES if status == cells["status"])
    return BatchRow(
        cells["file"],
        status,
        cells["preset"],
        float(cells["position"]),
        float(cells["amplitude_mm"]),
        cells["source"],
        int(cells["rate_hz"]),
        number("seconds"),
        number("peak_db"),
        int(cells["clipped"]) if cells["clipped"] else None,
        number("rel_mae_trained"),
        number("rel_mae"),
        cells["message"],
        cells.get("string", ""),  # a column that earlier versions did not write
    )
