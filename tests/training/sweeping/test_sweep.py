from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import psutil
import pytest

from engine.schema import SchemaError, write
from training.results import RESULTS, Row, add_rows, read_results
from training.sweeping.sweep import Options, Watch, is_finished, results_of, sweep, unfinished
from training.sweeping.workers import Layout, cluster_workers, fitted, local_workers
from training.sweeping.workers.base import Ended, Event, Noted, Progressed, Task
from training.sweeping.workers.performing import end_of, perform

MEASURED = [name for name in Row.__dataclass_fields__ if name not in ("seconds", "finished", "commit")]


class Record(Watch):
    """Keeps what is reported."""

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


def test_a_sweep_that_ends_in_time_leaves_the_rest_to_the_same_call(plan, options: Options) -> None:
    """A run that is under way then has no row: it continues from its checkpoint."""
    made, begun = plan(), time.monotonic()
    ends = replace(options, ends_s=begun + 0.2)

    def outcome(task: Task, tries: int) -> Row:
        if task.name == made.runs[1].name:
            time.sleep(max(0.0, begun + 0.3 - time.monotonic()))
        return row_of(task)

    first = sweep(made, Script(outcome, capacity=1), ends, Record())
    assert [row.name for row in first] == [run.name for run in made.runs[:2]]
    watch = Record()
    rows = sweep(made, Script(lambda task, tries: row_of(task)), options, watch)
    assert watch.names == [run.name for run in made.runs[2:]]
    assert [row.name for row in rows] == [run.name for run in made.runs]
    over = sweep(made, Script(lambda task, tries: pytest.fail("begun")), replace(options, ends_s=begun), Record())
    assert over == rows


def test_runs_begin_in_the_plans_order_and_no_more_than_there_are_workers(plan, options: Options) -> None:
    made = plan()
    workers, watch = Script(lambda task, tries: row_of(task)), Record()
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

    workers, watch = Script(outcome), Record()
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
    assert {row.status for row in sweep(made, again, options, Mock())} == {"done"}
    assert again.started == [worst]


def test_the_seeds_of_a_cell_are_one_piece_where_they_are_trained_at_once(plan, options: Options) -> None:
    made = plan(seeds="0, 1, 2")
    at_once = replace(options, seeds_at_once=True)
    unlucky = made.runs[1].name
    add_rows(options.results, [row_of(options.task(made, made.runs[0]))])  # seed 0 of the first cell is done
    tasks: list[Task] = []

    def outcome(task: Task, tries: int) -> Row | str:
        tasks.append(task)
        return f"OSError: try {tries}" if task.name == unlucky else row_of(task)

    class Pieces(Script):
        def next(self, timeout_s: float) -> Event | None:
            others = [row_of(replace(self._tasks[-1], **vars(each))) for each in self._tasks[-1].others]
            ended = super().next(timeout_s)
            assert isinstance(ended, Ended)
            return replace(ended, others=tuple(others)) if ended.row else ended

    watch = Record()
    rows = sweep(made, Pieces(outcome, capacity=1), at_once, watch)
    pieces = [[task.name, *(each.name for each in task.others)] for task in tasks]
    assert sorted(map(len, pieces)) == [2, 3, 3, 3, 3]  # the unlucky piece twice
    assert pieces.count([name for name in pieces[1] if name]) == 2 and pieces[1][0] == unlucky
    assert len(watch.rows) == 11 and {row.name for row in watch.rows} == {run.name for run in made.runs[1:]}
    assert sorted(row.name for row in rows if row.status == "failed") == sorted(pieces[1])


def test_what_diverged_is_a_result(plan, options: Options) -> None:
    diverged = Script(lambda task, tries: row_of(task, status="diverged", rel_mae=None, message="the loss is nan"))
    assert {row.status for row in sweep(plan(), diverged, options, Mock())} == {"diverged"}
    nothing = Script(lambda task, tries: "not to be run")
    sweep(plan(), nothing, options, Mock())
    assert nothing.started == []
    assert is_finished(row_of(Task("a", "ours", {}, "a"))) and not is_finished(None)


def test_what_kills_its_workers_is_not_tried_again(plan, options: Options) -> None:
    class Deadly(Script):
        def next(self, timeout_s: float) -> Event | None:
            return Ended(self._tasks.pop().name, None, "its worker died 4 times", final=True)

    workers = Deadly(lambda task, tries: "")
    assert {row.status for row in sweep(plan(), workers, options, Mock())} == {"failed"}
    assert len(workers.started) == len(plan().runs)


def test_a_row_that_another_machine_added_meanwhile_is_not_done_again(plan, options: Options) -> None:
    made = plan()
    last = made.runs[-1]

    def outcome(task: Task, tries: int) -> Row:
        add_rows(options.results, [row_of(options.task(made, last), rel_mae=0.25)])
        return row_of(task)

    workers = Script(outcome, capacity=1)
    rows = sweep(made, workers, options, Mock())
    assert last.name not in workers.started
    assert rows[-1].rel_mae == 0.25


def test_a_results_file_that_cannot_be_written_ends_the_sweep_before_the_work(plan, options: Options) -> None:
    workers = Script(lambda task, tries: row_of(task))
    folder = options.results
    folder.mkdir()
    with pytest.raises(SchemaError, match="not an ordinary file"):
        sweep(plan(), workers, options, Mock())
    folder.rmdir()
    folder.write_text("something else\n", encoding="utf-8")
    with pytest.raises(SchemaError, match="not a results file"):
        sweep(plan(), workers, options, Mock())
    assert workers.started == []


def test_trials_are_kept_apart(plan, tmp_path: Path) -> None:
    trial = plan()
    real = replace(trial, trial=False)
    assert results_of(real, tmp_path) == RESULTS
    assert results_of(trial, tmp_path) == tmp_path / "trial" / "results.csv"
    options = Options(runs=tmp_path)
    assert (options.task(trial, trial.runs[0]).group, options.task(real, real.runs[0]).group) == ("trial", "")


# --- whole sweeps


class Inline(Script):
    """One worker, which is this process."""

    def __init__(self) -> None:
        super().__init__(lambda task, tries: "", capacity=1)

    def next(self, timeout_s: float) -> Event | None:
        task = self._tasks.pop()
        return end_of(task.name, perform(write(task), lambda reported: None))


@pytest.fixture
def alone(options: Options, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Options:
    """Another place for the same runs, in this process."""
    return replace(options, results=tmp_path / "alone.csv", runs=tmp_path / "alone")


def wait_until(reached: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not reached():
        assert time.monotonic() < end


class Killer(Record):
    """Kills the process that is the first to tell of its progress, some epochs into its run."""

    def __init__(self, runs: Path) -> None:
        super().__init__()
        self._runs = runs
        self.victim = ""
        self.resumed_at = 0  # the first epoch that is reported after that
        self._pid = 0

    def progressed(self, event: Progressed) -> None:
        if not self.victim:
            self.victim, self._pid = event.name, event.pid
            log = self._runs / event.name / "log.csv"
            wait_until(lambda: log.read_text(encoding="utf-8").count("\n") > 3)
            psutil.Process(event.pid).kill()
        elif event.name == self.victim and event.pid != self._pid and not self.resumed_at:
            self.resumed_at = event.progress.epoch


def measured(file: Path) -> list[list[Any]]:
    return [[getattr(row, name) for name in MEASURED] for row in read_results(file)]


def here(count: int) -> Layout:
    return replace(fitted(count, device="cpu", workers=count), threads=1)


@pytest.mark.parametrize("seeds_at_once", [False, True])
def test_a_sweep_whose_worker_is_killed_is_that_of_one_left_alone(
    plan, options: Options, alone: Options, seeds_at_once: bool
) -> None:
    """Two models on two data sets from two seeds: on two processes with a kill, and one after another here."""
    made = plan(epochs=15)
    sweep(made, Inline(), alone, Mock())
    options = replace(options, seeds_at_once=seeds_at_once)

    killer = Killer(options.runs / made.name)
    with local_workers(here(2)) as workers:
        rows = sweep(made, workers, options, killer)
    assert [(row.name, row.status) for row in rows] == [(run.name, "done") for run in made.runs]
    assert len(rows) == 8
    assert [note.name for note in killer.notes if note.text.endswith("died")] == [killer.victim]
    assert measured(options.results) == measured(alone.results)
    assert killer.resumed_at > 1  # from its checkpoint
    log = options.runs / made.name / killer.victim / "log.csv"
    assert [line.split(",")[0] for line in log.read_text(encoding="utf-8").split()[1:]] == [
        str(epoch) for epoch in range(1, 16)
    ]

    # the same plan again: nothing to do, nothing changed
    before = options.results.read_bytes()
    nobody = Script(lambda task, tries: "not to be run")
    assert [(r.name, r.status) for r in sweep(made, nobody, options, Mock())] == [(r.name, r.status) for r in rows]
    assert nobody.started == []
    assert options.results.read_bytes() == before

    # the results file is lost: the rows come back from the runs' folders
    options.results.unlink()
    sweep(made, Inline(), options, Mock())
    assert options.results.read_bytes() == before


def test_the_workers_of_a_dask_cluster_do_the_same(plan, options: Options, alone: Options) -> None:
    from distributed import LocalCluster

    made = plan(seeds="0")
    made = replace(made, runs=made.runs[:1])
    sweep(made, Inline(), alone, Mock())
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        cluster_workers(cluster.scheduler_address) as workers,
    ):
        assert "the Dask cluster inproc://" in workers.description
        sweep(made, workers, options, Mock())
    assert measured(options.results) == measured(alone.results)


def test_a_sweep_here_listens_to_nobody(plan, options: Options) -> None:
    """What listens, even on the loopback, can be reached by every account of the computer."""
    made = plan(seeds="0")
    made = replace(made, runs=made.runs[:1])
    seen: list[Any] = []

    class Look(Record):
        def progressed(self, event: Progressed) -> None:
            for one in [psutil.Process(), *psutil.Process().children(recursive=True)]:
                with suppress(psutil.NoSuchProcess):  # `git`, which a worker asks for its commit, ends by itself
                    seen.append([port for port in one.net_connections("inet") if port.status == "LISTEN"])

    with local_workers(here(1)) as workers:
        sweep(made, workers, options, Look())
    assert seen and not any(seen)
