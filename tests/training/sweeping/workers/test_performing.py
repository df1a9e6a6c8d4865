from __future__ import annotations

import errno
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock

from engine.metrics import RelativeError
from engine.schema import write
from training.data.dataset import dataset_folder, load_dataset
from training.fitting.fit import Progress
from training.results import Row
from training.sweeping.sweep import Options
from training.sweeping.workers.base import Ended, Progressed, Task
from training.sweeping.workers.performing import end_of, event_of, perform


def test_a_task_ends_with_its_row_and_reports_its_progress(task: Task) -> None:
    reported: list[dict[str, Any]] = []
    outcome = perform(write(task), reported.append)
    ended = end_of(task.name, outcome)
    assert isinstance(ended, Ended) and ended.row is not None
    assert (ended.row.status, ended.row.digest, ended.row.threads) == ("done", task.digest, 1)
    event = event_of(reported[0])
    assert isinstance(event, Progressed)
    assert (event.name, event.progress.epoch, event.progress.epochs) == (task.name, 1, 4)
    reported.clear()
    assert perform(write(task), reported.append) == outcome  # from the run's folder
    assert reported == []


def test_a_run_that_diverges_is_recorded_so(plan, options: Options) -> None:
    made = plan(more="peak_learning_rate = 1e30")
    outcome = perform(write(options.task(made, made.runs[0])), lambda reported: None)
    row = end_of("", outcome).row
    assert row is not None
    assert (row.status, row.rel_mae) == ("diverged", None)
    assert "lower peak_learning_rate" in row.message


def test_a_damaged_data_cache_is_reported(plan, task: Task, options: Options) -> None:
    configuration = plan().runs[0].configuration.data
    load_dataset(configuration, options.cache)
    folder = dataset_folder(configuration, options.cache)
    file = folder / "amplitudes.npy"
    file.write_bytes(file.read_bytes()[:1000])
    error = perform(write(task), lambda reported: None)["error"]
    assert f"{folder}: damaged data cache" in error and "delete" in error
    reported = Path(task.runs or "") / task.group / task.name / "failure.txt"
    assert "Traceback" in reported.read_text(encoding="utf-8")
    shutil.rmtree(folder)
    assert "rows" in perform(write(task), lambda reported: None)
    assert not reported.exists()  # it did not fail in the end


def test_a_checkpoint_of_another_configuration_is_reported(plan, task: Task, options: Options) -> None:
    perform(write(task), lambda reported: None)
    other = plan(epochs=5)
    error = perform(write(options.task(other, other.runs[0])), lambda reported: None)["error"]
    assert "was trained with other settings; delete it" in error


def test_a_full_disk_is_reported(task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: Any, **options: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "checkpoint")

    monkeypatch.setattr("training.run.run_rows", full)
    assert "No space left on device: 'checkpoint'" in perform(write(task), lambda reported: None)["error"]


def test_a_worker_of_another_version_trains_nothing(task: Task) -> None:
    assert "another version" in perform(write(replace(task, digest="0")), lambda reported: None)["error"]
    assert "unknown field 'colour'" in perform(write(task) | {"colour": 1}, lambda reported: None)["error"]
    plain = write(task)
    plain["configuration"]["recipe"]["colour"] = 1
    assert "unknown field 'colour'" in perform(plain, lambda reported: None)["error"]


def test_a_row_that_makes_no_sense_is_no_row(task: Task) -> None:
    row = write(Row(task.digest, task.name, "done", "koopman", "linear", "noise", 4000, 60, task.recipe, 0))
    for wrong in ({"rel_mae": math.nan}, {"status": "perhaps"}, {"horizon": "400"}):
        ended = end_of(task.name, {"rows": [row, row | wrong]})
        assert ended.row is None and "makes no sense" in ended.error


def test_a_progress_that_is_not_finite_is_not_reported() -> None:
    progress = Progress(2, 8, 1, 4, 60, 1e-3, 0.5, RelativeError(0.5, 0.25), 1.0, 3.0)
    plain = {"name": "a", "progress": write(progress), "host": "here", "pid": 1}
    assert event_of(plain) == Progressed("a", progress, "here", 1)
    assert event_of(plain | {"progress": write(replace(progress, loss=math.inf))}) is None


def test_two_tasks_never_train_in_one_folder(task: Task) -> None:
    folder = Path(task.runs or "") / task.group / task.name
    folder.mkdir(parents=True)
    lock = FileLock(folder / "run.lock")
    notes = []

    def reported(message: dict[str, Any]) -> None:
        if "text" in message:
            notes.append(message["text"])
            assert not (folder / "log.csv").exists()
            lock.release()

    with lock:
        assert "rows" in perform(write(task), reported)
    assert notes == ["waits: another process trains it"]
