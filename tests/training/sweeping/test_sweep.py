from __future__ import annotations

import errno
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import psutil
import pytest
from filelock import FileLock

from engine.metrics import RelativeError
from engine.schema import SchemaError, write
from training.data.dataset import dataset_folder, load_dataset
from training.fitting.fit import Progress
from training.results import RESULTS, Row, add_rows, read_results
from training.sweeping import workers as module
from training.sweeping.plan import Plan, load_plan
from training.sweeping.sweep import Options, Unwatched, is_finished, results_of, sweep, unfinished
from training.sweeping.workers import (
    Ended,
    Event,
    Layout,
    Noted,
    Progressed,
    Task,
    Workers,
    WorkersError,
    cluster_workers,
    fitted,
    local_workers,
    perform,
)

PLAN = """
description = "Tiny."

[data]
count = 10
steps = 60

[recipe_fields]
epochs = {epochs}
batch_size = 8
steps_per_batch = 8
first_horizon = 20
validate_every = 4
{more}

[[block]]
models = ["koopman_var", "koopman"]
strings = ["nonlinear", "linear"]
initials = ["noise"]
rates_hz = [4000]
horizons = [60]
seeds = [{seeds}]
"""
MEASURED = [name for name in Row.__dataclass_fields__ if name not in ("seconds", "finished", "commit")]


@pytest.fixture
def plan(tmp_path: Path) -> Callable[..., Plan]:
    def make(seeds: str = "0, 1", epochs: int = 4, more: str = "") -> Plan:
        path = tmp_path / "trial.toml"
        path.write_text(PLAN.format(seeds=seeds, epochs=epochs, more=more), encoding="utf-8")
        return load_plan(str(path))

    return make


@pytest.fixture
def options(tmp_path: Path) -> Options:
    return Options(tmp_path / "results.csv", tmp_path / "runs", tmp_path / "cache", "cpu", 1, checkpoint_every_s=0)


class Watch(Unwatched):
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.notes: list[Noted] = []
        self.rows: list[Row] = []

    def started(self, run: Any) -> None:
        self.names.append(run.name)

    def noted(self, event: Noted) -> None:
        self.notes.append(event)

    def finished(self, row: Row) -> None:
        self.rows.append(row)


class Script:
    """Workers that train nothing: each task ends as `outcome` says, the last that was begun first."""

    description = "a script"

    def __init__(self, outcome: Callable[[Task, int], Row | str], capacity: int = 3) -> None:
        self._outcome, self._capacity = outcome, capacity
        self._tasks: deque[Task] = deque()
        self.started: list[str] = []
        self.most = 0

    def capacity(self) -> int:
        return self._capacity

    def start(self, task: Task) -> None:
        self._tasks.append(task)
        self.started.append(task.name)
        self.most = max(self.most, len(self._tasks))

    def next(self, timeout_s: float) -> Event | None:
        task = self._tasks.pop()
        outcome = self._outcome(task, self.started.count(task.name))
        return Ended(task.name, None, outcome) if isinstance(outcome, str) else Ended(task.name, outcome)


def row_of(task: Task, **changes: Any) -> Row:
    fields = {"status": "done", "model": "koopman", "string": "linear", "initial": "noise", "rate_hz": 4000}
    fields |= {"horizon": 60, "recipe": task.recipe, "seed": 0, "rel_mae": 0.5, "finished": "2026-01-01T00:00:00Z"}
    return Row(task.digest, task.name, **(fields | changes))


# --- the queue


def test_runs_begin_in_the_plans_order_and_no_more_than_there_are_workers(plan, options: Options) -> None:
    made = plan()
    workers, watch = Script(lambda task, tries: row_of(task)), Watch()
    rows = sweep(made, workers, options, watch)
    assert workers.started == watch.names == [run.name for run in made.runs]
    assert workers.most == 3
    assert [row.name for row in rows] == workers.started
    assert read_results(options.results) == sorted(rows, key=lambda row: row.name)


def test_what_failed_is_tried_again_then_recorded_and_tried_by_the_next_sweep(plan, options: Options) -> None:
    made = plan()
    worst, unlucky = made.runs[0].name, made.runs[2].name

    def outcome(task: Task, tries: int) -> Row | str:
        if task.name == worst or (task.name == unlucky and tries == 1):
            return f"OSError: try {tries}"
        return row_of(task)

    workers, watch = Script(outcome), Watch()
    rows = sweep(made, workers, options, watch)
    assert (workers.started.count(worst), workers.started.count(unlucky)) == (2, 2)
    assert {(row.name, row.status, row.message) for row in rows if row.status != "done"} == {
        (worst, "failed", "OSError: try 2")
    }
    assert [note.name for note in watch.notes] == [unlucky, worst]
    assert "tried again (OSError: try 1)" in watch.notes[0].text
    assert rows[0].finished.endswith("Z")  # as other rows say it, for the later to replace the earlier

    assert [run.name for run in unfinished(made, read_results(options.results))] == [worst]
    again = Script(lambda task, tries: row_of(task, finished="2100-01-01T00:00:00Z"))
    assert {row.status for row in sweep(made, again, options)} == {"done"}
    assert again.started == [worst]


def test_what_diverged_is_a_result(plan, options: Options) -> None:
    diverged = Script(lambda task, tries: row_of(task, status="diverged", rel_mae=None, message="the loss is nan"))
    assert {row.status for row in sweep(plan(), diverged, options)} == {"diverged"}
    nothing = Script(lambda task, tries: "not to be run")
    sweep(plan(), nothing, options)
    assert nothing.started == []
    assert is_finished(row_of(Task("a", "ours", {}, "a"))) and not is_finished(None)


def test_what_kills_its_workers_is_not_tried_again(plan, options: Options) -> None:
    class Deadly(Script):
        def next(self, timeout_s: float) -> Event | None:
            return Ended(self._tasks.pop().name, None, "its worker died 4 times", final=True)

    workers = Deadly(lambda task, tries: "")
    assert {row.status for row in sweep(plan(), workers, options)} == {"failed"}
    assert len(workers.started) == len(plan().runs)


def test_a_row_that_another_machine_added_meanwhile_is_not_done_again(plan, options: Options) -> None:
    made = plan()
    last = made.runs[-1]

    def outcome(task: Task, tries: int) -> Row:
        add_rows(options.results, [row_of(options.task(made, last), rel_mae=0.25)])
        return row_of(task)

    workers = Script(outcome, capacity=1)
    rows = sweep(made, workers, options)
    assert last.name not in workers.started
    assert rows[-1].rel_mae == 0.25


def test_a_results_file_that_cannot_be_written_ends_the_sweep_before_the_work(plan, options: Options) -> None:
    workers = Script(lambda task, tries: row_of(task))
    folder = options.results
    folder.mkdir()
    with pytest.raises(OSError):
        sweep(plan(), workers, options)
    folder.rmdir()
    folder.write_text("something else\n", encoding="utf-8")
    with pytest.raises(SchemaError, match="not a results file"):
        sweep(plan(), workers, options)
    assert workers.started == []


def test_trials_are_kept_apart(plan, tmp_path: Path) -> None:
    trial = plan()
    real = replace(trial, trial=False)
    assert results_of(real, tmp_path) == RESULTS
    assert results_of(trial, tmp_path) == tmp_path / "trial" / "results.csv"
    options = Options(runs=tmp_path)
    assert (options.task(trial, trial.runs[0]).group, options.task(real, real.runs[0]).group) == ("trial", "")


# --- a task


@pytest.fixture
def task(plan, options: Options) -> Task:
    made = plan()
    return options.task(made, made.runs[0])


def test_a_task_ends_with_its_row_and_tells_its_progress(task: Task) -> None:
    told: list[dict[str, Any]] = []
    outcome = perform(write(task), told.append)
    ended = module._ended(task.name, outcome)
    assert isinstance(ended, Ended) and ended.row is not None
    assert (ended.row.status, ended.row.digest, ended.row.threads) == ("done", task.digest, 1)
    event = module._event(told[0])
    assert isinstance(event, Progressed)
    assert (event.name, event.progress.epoch, event.progress.epochs) == (task.name, 1, 4)
    told.clear()
    assert perform(write(task), told.append) == outcome  # from the run's folder
    assert told == []


def test_a_run_that_diverges_is_recorded_so(plan, options: Options) -> None:
    made = plan(more="peak_learning_rate = 1e30")
    outcome = perform(write(options.task(made, made.runs[0])), lambda told: None)
    row = module._ended("", outcome).row
    assert row is not None
    assert (row.status, row.rel_mae) == ("diverged", None)
    assert "lower peak_learning_rate" in row.message


def test_a_damaged_data_cache_is_told(plan, task: Task, options: Options) -> None:
    configuration = plan().runs[0].configuration.data
    load_dataset(configuration, options.cache)
    folder = dataset_folder(configuration, options.cache)
    file = folder / "amplitudes.npy"
    file.write_bytes(file.read_bytes()[:1000])
    error = perform(write(task), lambda told: None)["error"]
    assert f"{folder}: damaged data cache" in error and "delete" in error
    told = Path(task.runs or "") / task.group / task.name / "failure.txt"
    assert "Traceback" in told.read_text(encoding="utf-8")


def test_a_checkpoint_of_another_configuration_is_told(plan, task: Task, options: Options) -> None:
    perform(write(task), lambda told: None)
    other = plan(epochs=5)
    error = perform(write(options.task(other, other.runs[0])), lambda told: None)["error"]
    assert "belongs to another configuration; delete it" in error


def test_a_full_disk_is_told(task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: Any, **options: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "checkpoint")

    monkeypatch.setattr("training.run.run_row", full)
    assert "No space left on device: 'checkpoint'" in perform(write(task), lambda told: None)["error"]


def test_a_worker_of_another_version_trains_nothing(task: Task) -> None:
    assert "another version" in perform(write(replace(task, digest="0")), lambda told: None)["error"]
    assert "unknown field 'colour'" in perform(write(task) | {"colour": 1}, lambda told: None)["error"]
    plain = write(task)
    plain["configuration"]["recipe"]["colour"] = 1
    assert "unknown field 'colour'" in perform(plain, lambda told: None)["error"]


def test_a_row_that_makes_no_sense_is_no_row(task: Task) -> None:
    for wrong in ({"rel_mae": math.nan}, {"status": "perhaps"}, {"horizon": "400"}):
        ended = module._ended(task.name, {"row": write(row_of(task)) | wrong})
        assert ended.row is None and "makes no sense" in ended.error


def test_a_progress_that_is_not_finite_is_not_told() -> None:
    progress = Progress(2, 8, 1, 4, 60, 1e-3, 0.5, RelativeError(0.5, 0.25), 1.0, 3.0)
    plain = {"name": "a", "progress": write(progress), "host": "here", "pid": 1}
    assert module._event(plain) == Progressed("a", progress, "here", 1)
    assert module._event(plain | {"progress": write(replace(progress, loss=math.inf))}) is None


def test_two_tasks_never_train_in_one_folder(task: Task) -> None:
    folder = Path(task.runs or "") / task.group / task.name
    folder.mkdir(parents=True)
    lock = FileLock(folder / "run.lock")
    notes = []

    def told(message: dict[str, Any]) -> None:
        if "text" in message:
            notes.append(message["text"])
            assert not (folder / "log.csv").exists()
            lock.release()

    with lock:
        assert "row" in perform(write(task), told)
    assert notes == ["waits: another process trains it"]


# --- workers that fit


def test_workers_fit_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: set(range(8)), raising=False)
    monkeypatch.setattr(module, "_memory_bytes", lambda: 20 * 2**30)
    assert len(fitted(100).environments) == 2
    assert len(fitted(100, workers=5).environments) == 5
    monkeypatch.setattr(module, "_memory_bytes", lambda: 2**40)
    found = fitted(100)
    assert (found.device, found.threads, len(found.environments)) == ("cpu", 1, 8)
    assert found.environments[0]["OMP_NUM_THREADS"] == "1"
    assert len(fitted(3).environments) == 3
    assert len(fitted(100, threads=4).environments) == 2
    assert len(fitted(100, threads=16).environments) == 1
    assert len(fitted(100, workers=20).environments) == 20
    with pytest.raises(ValueError, match="no CUDA device can be used here"):
        fitted(1, device="cuda")


@pytest.mark.parametrize(("visible", "gpus"), [(None, ["0", "1"]), ("3, MIG-7", ["3", "MIG-7"])])
def test_several_runs_share_a_gpu(monkeypatch: pytest.MonkeyPatch, visible: str | None, gpus: list[str]) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: True)
    monkeypatch.setattr("torch.cuda.device_count", lambda: 2)
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: set(range(12)), raising=False)
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if visible:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", visible)

    def places(layout: Layout) -> list[str]:
        return [environment["CUDA_VISIBLE_DEVICES"] for environment in layout.environments]

    assert places(fitted(100)) == gpus
    packed = fitted(100, per_device=3)
    assert (packed.device, packed.threads) == ("cuda", 2)
    assert places(packed) == gpus * 3
    assert places(fitted(3, per_device=3)) == [*gpus, gpus[0]]  # the few are spread
    assert fitted(100, device="cpu").device == "cpu"


def test_a_scheduler_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CONNECT_S", 0.2)
    with pytest.raises(WorkersError, match="no Dask scheduler answers there"), cluster_workers("tcp://127.0.0.1:9"):
        pass
    monkeypatch.setattr(module, "dask_is_installed", lambda: False)
    with pytest.raises(WorkersError, match="a cluster needs Dask"), cluster_workers("tcp://127.0.0.1:9"):
        pass


def test_what_dask_gives_up_is_final_or_the_end() -> None:
    from distributed import KilledWorker
    from distributed.scheduler import WorkerState

    client = SimpleNamespace(subscribe_topic=lambda topic, handler: None, submit=lambda *a, **o: future)
    state = WorkerState(address="tcp://a:1", status="closed", pid=1, name="a", nthreads=1, memory_limit=0,
                        local_directory="", nanny=None, server_id="a")  # fmt: skip
    killed = KilledWorker("key", state, 3)
    future = SimpleNamespace(add_done_callback=lambda done: None)
    task = Task("a", "ours", {}, "a")
    workers = module._DaskWorkers(client, "")  # type: ignore[arg-type]
    workers.start(task)
    (key,) = workers._names
    workers._done(SimpleNamespace(key=key, status="error", exception=lambda: killed))  # type: ignore[arg-type]
    assert workers.next(1) == Ended("a", None, module._killed(4), final=True)
    workers.start(task)
    (key,) = workers._names
    workers._done(SimpleNamespace(key=key, status="cancelled"))  # type: ignore[arg-type]
    with pytest.raises(WorkersError, match="gave up a"):
        workers.next(1)


# --- whole sweeps


class Inline(Script):
    """One worker, which is this process."""

    def __init__(self) -> None:
        super().__init__(lambda task, tries: "", capacity=1)

    def next(self, timeout_s: float) -> Event | None:
        task = self._tasks.pop()
        return module._ended(task.name, perform(write(task), lambda told: None))


@pytest.fixture
def alone(options: Options, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Options:
    """Another place for the same runs, without their plots, in this process."""
    monkeypatch.setattr("training.run._plot", lambda *arguments: None)
    return replace(options, results=tmp_path / "alone.csv", runs=tmp_path / "alone")


def wait_until(reached: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not reached():
        assert time.monotonic() < end


class Killer(Watch):
    """Kills the process that is the first to tell of its progress, some epochs into its run."""

    def __init__(self, runs: Path) -> None:
        super().__init__()
        self._runs = runs
        self.victim = ""
        self.resumed_at = 0  # the first epoch that is told after that
        self._pid = 0

    def progressed(self, event: Progressed) -> None:
        if not self.victim:
            self.victim, self._pid = event.name, event.pid
            log = self._runs / event.name / "log.csv"
            wait_until(lambda: log.read_text(encoding="utf-8").count("\n") > 5)
            psutil.Process(event.pid).kill()
        elif event.name == self.victim and event.pid != self._pid and not self.resumed_at:
            self.resumed_at = event.progress.epoch


def measured(file: Path) -> list[list[Any]]:
    return [[getattr(row, name) for name in MEASURED] for row in read_results(file)]


def here(count: int) -> Layout:
    return replace(fitted(count, device="cpu", workers=count), threads=1)


def test_a_sweep_whose_worker_is_killed_is_that_of_one_left_alone(plan, options: Options, alone: Options) -> None:
    """Two models on two data sets from two seeds: on two Dask workers with a kill, and one after another here."""
    made = plan(epochs=60)
    sweep(made, Inline(), alone)

    killer = Killer(options.runs / made.name)
    with local_workers(here(2)) as workers:
        assert "Dask" in workers.description
        rows = sweep(made, workers, options, killer)
    assert [(row.name, row.status) for row in rows] == [(run.name, "done") for run in made.runs]
    assert len(rows) == 8
    assert [note.name for note in killer.notes if note.text.endswith("died")] == [killer.victim]
    assert measured(options.results) == measured(alone.results)
    assert killer.resumed_at > 1  # from its checkpoint
    log = options.runs / made.name / killer.victim / "log.csv"
    assert [line.split(",")[0] for line in log.read_text(encoding="utf-8").split()[1:]] == [
        str(epoch) for epoch in range(1, 61)
    ]

    # the same plan again: nothing to do, nothing changed
    before = options.results.read_bytes()
    nobody = Script(lambda task, tries: "not to be run")
    assert [(r.name, r.status) for r in sweep(made, nobody, options)] == [(r.name, r.status) for r in rows]
    assert nobody.started == []
    assert options.results.read_bytes() == before

    # the results file is lost: the rows come back from the runs' folders
    options.results.unlink()
    sweep(made, Inline(), options)
    assert options.results.read_bytes() == before


def test_plain_processes_do_the_same(plan, options: Options, alone: Options, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "dask_is_installed", lambda: False)
    made = plan(seeds="0")
    made = replace(made, runs=made.runs[:1])
    sweep(made, Inline(), alone)
    with local_workers(here(1)) as workers:
        assert "as Dask is not installed" in workers.description
        sweep(made, workers, options)
    assert measured(options.results) == measured(alone.results)


def test_a_plain_process_that_dies_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = Task("a", "ours", {}, "a", threads="two")  # type: ignore[arg-type]

    def until_it_ends(workers: Workers) -> Ended:
        while True:
            event = workers.next(60)
            if isinstance(event, Ended):
                return event
            assert isinstance(event, Noted) and event.text.endswith("died")

    with module._plain(here(2)) as workers:
        assert isinstance(workers, module._PlainWorkers)
        workers.start(wrong)
        workers._places[0].process.kill()
        event = workers.next(60)
        assert isinstance(event, Noted) and event.name == "a"
        ended = until_it_ends(workers)
        assert (ended.row, ended.final) == (None, False)
        assert "task.threads: expected int" in ended.error
        # one that kills process after process is given up, and the next task has a new one
        monkeypatch.setattr(module, "DEATHS", 0)
        workers._places[0].process.kill()  # before the task, which it would end at once
        workers._places[0].process.join()
        workers.start(wrong)
        assert until_it_ends(workers) == Ended("a", None, module._killed(1), final=True)
        workers.start(wrong)
        assert "task.threads" in until_it_ends(workers).error
