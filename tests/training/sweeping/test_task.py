import json
import math
import shutil
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from filelock import FileLock

from engine.compare.relative import RelativeError
from engine.schema import read, write
from training.data.dataset import dataset_folder, load_dataset
from training.fitting.fit import FitProgress
from training.fitting.log import TrainingLog
from training.results import Row
from training.sweeping.task import PROGRESS, Task, perform, read_progress


def folder_of(task: Task) -> Path:
    return task.folder_of(task.runs[0].name)


def test_a_task_ends_with_its_row_and_reports_its_progress(task, monkeypatch):
    seen = []
    add = TrainingLog.add

    def followed(log: TrainingLog, progress: FitProgress) -> None:
        add(log, progress)
        seen.append(read_progress(folder_of(task)))  # of the epoch before

    monkeypatch.setattr(TrainingLog, "add", followed)
    outcome = perform(write(task))
    (row,) = (read(Row, row, "row") for row in outcome["rows"])
    assert (row.status, row.digest, row.threads) == ("done", task.runs[0].digest, 1)
    assert seen[0] is None and seen[1] is not None and (seen[1].epoch, seen[1].epochs) == (1, 4)
    assert not (folder_of(task) / PROGRESS).exists()
    assert perform(write(task)) == outcome  # from the run's folder


def test_a_damaged_data_cache_is_reported(plan, task, options):
    configuration = plan().runs[0].configuration.data
    load_dataset(configuration, options.cache)
    folder = dataset_folder(configuration, options.cache)
    file = folder / "amplitudes.npy"
    file.write_bytes(file.read_bytes()[:1000])
    error = perform(write(task))["error"]
    assert f"{folder}: damaged data cache" in error and "delete" in error
    reported = folder_of(task) / "failure.txt"
    assert "Traceback" in reported.read_text(encoding="utf-8")
    shutil.rmtree(folder)
    assert perform(write(task))["rows"]
    assert not reported.exists()  # it did not fail in the end


def test_a_worker_of_another_version_trains_nothing(task):
    assert "another version" in perform(write(replace(task, digests=("0",))))["error"]
    assert "unknown field 'colour'" in perform(write(task) | {"colour": 1})["error"]
    plain = write(task)
    plain["runs"][0]["configuration"]["recipe"]["colour"] = 1
    assert "unknown field 'colour'" in perform(plain)["error"]


@pytest.mark.parametrize("loss", [0.5, math.inf, math.nan])
def test_a_progress_is_read_where_it_is_whole_and_finite(tmp_path, loss):
    progress = FitProgress(2, 8, 1, 4, 60, 1e-3, loss, RelativeError(0.5, 0.25), 1.0, 3.0)
    assert read_progress(tmp_path) is None
    (tmp_path / PROGRESS).write_text(json.dumps(write(progress)), encoding="utf-8")
    assert read_progress(tmp_path) == (progress if math.isfinite(loss) else None)
    for damaged in (b"\xff\xfe", b"{", b'{"epoch": "one"}', b"[" * 100_000):
        (tmp_path / PROGRESS).write_bytes(damaged)
        assert read_progress(tmp_path) is None


def test_two_tasks_never_train_in_one_folder(task, capfd):
    folder_of(task).mkdir(parents=True)
    lock = FileLock(folder_of(task) / "run.lock")
    with lock:
        second = threading.Thread(target=perform, args=(write(task),))
        second.start()
        while "waits: another process trains it" not in capfd.readouterr().err:
            assert second.is_alive()
        assert not (folder_of(task) / "log.csv").exists()
    second.join()
    assert (folder_of(task) / "log.csv").exists()
