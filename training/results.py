"""The results file: one row a run, in tidy CSV.

It is safe to write from several processes and to merge from several machines.

A row is found again by the digest of its configuration, which holds the seed; a later row replaces an earlier one
of the same run. From a row's `name` follows the command that repeats it: `learned-strings train NAME`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from filelock import FileLock

from engine.table import checked, columns_of, read_table, write_table
from training.start import given_to

QUARTERS = 4  # windows of the horizon, with an error each
SHORT_HORIZON = 400  # frames; the paper's second horizon, over which every run is measured too
RESULTS = Path(__file__).parent / "results.csv"
LARGEST_BYTES = 2 * 2**20  # of such a file: some 2,500 rows

Status = Literal["done", "diverged", "failed"]


@dataclass(frozen=True)
class Row:
    """A run and what came of it. Errors are None where there are none: diverged, failed.

    Attributes:
        digest: of the configuration; see `TrainingConfiguration.digest`.
        name: the cell's or the configuration's.
        string: "linear" or "nonlinear".
        horizon: frames that were trained and measured.
        rel_mse, rel_mae: over the validation set and the horizon, as in the paper's tables.
        rel_mse_spread, rel_mae_spread: standard deviation of the validation trajectories' own errors, as the paper's
            for DMD.
        rel_mse_q1 …: of the quarters of the horizon.
        rel_mse_400, rel_mae_400: over the first 400 frames, where the horizon reaches so far.
        start_…: of the untrained model, over the validation set; the result is never worse.
        test_…: the same of the test set, which chose neither weights nor recipes.
        …_se: standard error of a figure over the split's trajectories; see `ErrorSums.standard_error`. None
            in rows older than the measurement.
        seconds: of training, what it starts from among it; in rows without start_… the optimiser alone.
        commit: of the code, "" where it is not known.
        finished: UTC, ISO 8601.
        message: why a run failed; of one that is done, what limits its figures, as code that was never published.
    """

    digest: str
    name: str
    status: Status
    model: str
    string: str
    initial: str
    rate_hz: int
    horizon: int
    recipe: str
    seed: int
    initialisation: str = ""
    rel_mse: float | None = None
    rel_mae: float | None = None
    test_rel_mse: float | None = None
    test_rel_mae: float | None = None
    rel_mse_spread: float | None = None
    rel_mae_spread: float | None = None
    rel_mse_400: float | None = None
    rel_mae_400: float | None = None
    rel_mse_q1: float | None = None
    rel_mse_q2: float | None = None
    rel_mse_q3: float | None = None
    rel_mse_q4: float | None = None
    rel_mae_q1: float | None = None
    rel_mae_q2: float | None = None
    rel_mae_q3: float | None = None
    rel_mae_q4: float | None = None
    start_rel_mse: float | None = None
    start_rel_mae: float | None = None
    rel_mse_se: float | None = None
    rel_mae_se: float | None = None
    test_rel_mse_se: float | None = None
    test_rel_mae_se: float | None = None
    rel_mse_400_se: float | None = None
    rel_mae_400_se: float | None = None
    test_rel_mse_400: float | None = None
    test_rel_mae_400: float | None = None
    test_rel_mse_400_se: float | None = None
    test_rel_mae_400_se: float | None = None
    parameters: int | None = None
    epochs: int | None = None
    best_epoch: int | None = None
    seconds: float | None = None
    device: str = ""
    threads: int | None = None
    hardware: str = ""
    torch: str = ""
    commit: str = ""
    finished: str = ""
    message: str = ""

    @property
    def structured(self) -> bool:
        """Return True if it started from prior knowledge of the string, which the paper's models do not have."""
        return bool(given_to(self.model, self.initialisation))


COLUMNS = columns_of(Row)


def read_results(path: Path) -> list[Row]:
    """All rows of a results file, none where there is no file.

    Raises:
        SchemaError: it is not a results file, or a value is wrong; the message names the file, line and column.
        OSError: it cannot be read.
    """
    try:
        return list(checked(read_table(Row, path, "results file", LARGEST_BYTES)))
    except FileNotFoundError:
        return []


def add_rows(path: Path, rows: Iterable[Row]) -> list[Row]:
    """Add rows to a results file, or make it.

    Of two rows of one run the one that finished later stays.

    A run that is done is never replaced by a failure. Locked against other processes; whole or not at all.

    Returns:
        All rows of the file, in the order of their names.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(f"{path}.lock"):
        by_digest = {row.digest: row for row in read_results(path)}
        for row in rows:
            old = by_digest.get(row.digest)
            if old is None or _rank(row) > _rank(old):
                by_digest[row.digest] = row
            elif _rank(row) == _rank(old):  # the same run, of which one may have been measured again
                known = {name: value for name in COLUMNS if (value := getattr(row, name)) is not None}
                by_digest[row.digest] = replace(old, **known)
        merged = sorted(by_digest.values(), key=lambda row: (row.name, row.digest))
        write_table(path, Row, merged)
    return merged


def _rank(row: Row) -> tuple[bool, str]:
    """The rank of a row among those of its run: done before others, then the later one."""
    return row.status == "done", row.finished
