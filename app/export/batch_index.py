"""The index of a batch: a CSV file with a row for each WAV file, written whole or not at all."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Literal, get_args

from app.export.files import ExportError
from app.shared.whole_file import WriteError, whole_file

INDEX = "index.csv"
Status = Literal["written", "kept", "failed"]
STATUSES: tuple[Status, ...] = get_args(Status)


@dataclass(frozen=True)
class BatchRow:
    """A line of the index. Errors are the model's relative MAE at the listening points; the truth has none.

    Attributes:
        rel_mae_trained: as far as the model was trained; rel_mae: over the whole file.
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


class BatchIndex:
    """The CSV file, with rows of earlier batches in the same folder."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.rows: dict[str, BatchRow] = {}
        try:
            with path.open(encoding="utf-8", newline="") as file:
                self.rows = {row.file: row for row in map(_read_row, csv.DictReader(file))}
        except (OSError, ValueError, KeyError, TypeError):
            pass  # none yet, or not one of ours: it is written anew

    def add(self, rows: Sequence[BatchRow]) -> None:
        """Without any row there is no file. Raises ExportError."""
        self.rows |= {row.file: row for row in rows}
        if not self.rows:
            return
        text = io.StringIO()
        table = csv.DictWriter(text, [one.name for one in fields(BatchRow)], lineterminator="\n")
        table.writeheader()
        table.writerows(asdict(row) for row in self.rows.values())
        try:
            with whole_file(self._path) as file:
                file.write(text.getvalue().encode())
        except WriteError as error:
            raise ExportError(str(error)) from error


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
    )
