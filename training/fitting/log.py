"""The log of a run: a line for each epoch, also across interruptions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from engine.schema import SchemaError
from engine.table import append_record, read_table, write_table
from training.fitting.fit import FitProgress

LARGEST_BYTES = 2**24
DIGITS = 6  # of a figure in the log


@dataclass(frozen=True)
class Epoch:
    """A line of the log; the errors are those of validation, None where it was not measured; horizon in frames."""

    epoch: int
    horizon: int
    learning_rate: float
    loss: float | None = None
    rel_mse: float | None = None
    rel_mae: float | None = None
    seconds: float = 0.0


def read_log(path: Path) -> list[Epoch]:
    """The epochs of a log.

    A line that is not whole, or holds a figure that is not finite, is left out.

    Raises:
        SchemaError: it is not a log.
        OSError: it cannot be read.
    """
    lines = read_table(Epoch, path, "training log", LARGEST_BYTES, lines_apart=True)
    return [line for line in lines if not isinstance(line, SchemaError)]


class TrainingLog:
    """A log that is written epoch by epoch. A run continues from its checkpoint, which may be older than its log."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._trimmed = False  # whether later epochs of an earlier run are gone from the file

    def add(self, progress: FitProgress) -> None:
        """Add the epoch that has ended; later ones of an earlier run are dropped."""
        p, measured = progress, progress.validation
        figures = (p.loss, measured.rel_mse, measured.rel_mae) if measured else (p.loss, None, None)
        loss, rel_mse, rel_mae = map(_rounded, figures)
        rate = _rounded(p.learning_rate) or 0.0
        ended = Epoch(p.epoch, p.horizon, rate, loss, rel_mse, rel_mae, round(p.seconds, 2))
        if not self._trimmed:
            kept = [line for line in read_log(self.path) if line.epoch < ended.epoch] if self.path.exists() else []
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_table(self.path, Epoch, kept)
            self._trimmed = True
        append_record(self.path, ended)


def _rounded(value: float | None) -> float | None:
    """A figure to `DIGITS` digits; None where it is none, or is not finite."""
    return float(f"{value:.{DIGITS}g}") if value is not None and math.isfinite(value) else None
