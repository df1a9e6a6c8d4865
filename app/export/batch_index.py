"""The index of a batch: a CSV file with a row for each WAV file, written whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from filelock import FileLock

from engine import bounds
from engine.result_file import WriteError, explain
from engine.schema import SchemaError
from engine.table import read_table, write_table

INDEX = "index.csv"
Status = Literal["written", "kept", "failed"]


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
        WriteError: a table that is no index has its name, or it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.rows = read_rows(path)

    def add(self, rows: Sequence[BatchRow]) -> None:
        """Adds rows to the file as it is now, as another batch may write into the same folder; none: does nothing.

        What failed does not replace the row of a file that is still there.

        Raises:
            WriteError: the file cannot be written.
        """
        if not rows:
            return
        try:
            with FileLock(self._path.with_name(f".{self._path.name}.lock")):
                self.rows |= read_rows(self._path)
                self.rows |= {row.file: row for row in rows if row.status != "failed" or not self._have(row.file)}
                write_table(self._path, BatchRow, self.rows.values())
        except OSError as error:
            raise WriteError(explain(self._path, error)) from error

    def _have(self, file: str) -> bool:
        row = self.rows.get(file)
        return row is not None and row.status != "failed" and (self._path.parent / file).exists()


def read_rows(path: Path) -> dict[str, BatchRow]:
    """By file name, without damaged lines; empty where there is no index.

    Raises:
        WriteError: it is another table, or cannot be read.
    """
    try:
        rows = list(read_table(BatchRow, path, "index of a batch", bounds.LARGEST_TABLE_BYTES))
    except FileNotFoundError:
        return {}
    except SchemaError as error:
        raise WriteError(f"{path}: is there already, and no index of a batch; choose another folder") from error
    except OSError as error:
        raise WriteError(explain(path, error)) from error
    return {row.file: row for row in rows if isinstance(row, BatchRow)}
