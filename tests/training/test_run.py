from __future__ import annotations

import csv
from pathlib import Path

import pytest

from engine.metrics import RelativeError
from training.fit import Progress
from training.run import LOG_FIELDS, TrainingLog, trained_range


def progress(epoch: int, loss: float = 1.0) -> Progress:
    validation = RelativeError(0.5, 0.25) if epoch % 2 == 0 else None
    return Progress(epoch, 9, 150, 1e-3, loss, validation, 2.0 * epoch, 1.0)


def read(path: Path) -> list[list[str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def test_the_log_has_a_line_per_epoch(tmp_path: Path) -> None:
    log = TrainingLog(tmp_path / "run" / "log.csv")
    log.add(progress(1))
    log.add(progress(2))
    assert read(tmp_path / "run" / "log.csv") == [
        list(LOG_FIELDS),
        ["1", "150", "0.001", "1", "", "", "2.00"],
        ["2", "150", "0.001", "1", "0.5", "0.25", "4.00"],
    ]


def test_a_run_that_goes_on_from_an_older_checkpoint_repeats_no_epoch(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    log = TrainingLog(path)
    for epoch in (1, 2, 3, 4):
        log.add(progress(epoch))
    with path.open("a", encoding="utf-8") as file:
        file.write("5,150,0.0")  # killed within a line
    log = TrainingLog(path)
    log.add(progress(3, loss=7))
    log.add(progress(4, loss=8))
    assert [(row[0], row[3]) for row in read(path)[1:]] == [("1", "1"), ("2", "1"), ("3", "7"), ("4", "8")]


@pytest.mark.parametrize("kind", ["gaussian", "noise"])
def test_the_trained_range_is_that_of_the_draws(kind: str) -> None:
    found = trained_range(kind)
    assert found.peak_m == (1e-3, 1e-2)
    assert (found.position is None, found.width is None) == (kind == "noise", kind == "noise")
