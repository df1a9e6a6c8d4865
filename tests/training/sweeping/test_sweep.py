import multiprocessing
import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import psutil
import pytest
from filelock import FileLock

from engine.schema import SchemaError, read, write
from tests.training.sweeping.conftest import plan_in, row_of
from training.configuration import Run
from training.fitting.fit import FitProgress
from training.results import Row, add_rows, read_results
from training.sweeping.plan import Plan
from training.sweeping.processes import Layout, fitted, process_workers
from training.sweeping.sweep import Options, Watch, is_finished, sweep, unfinished
from training.sweeping.task import Task, Workers, WorkersError, perform

MEASURED = [name for name in Row.__dataclass_fields__ if name not in ("seconds", "finished", "commit")]


class Script:
    """`Workers` that train nothing: the runs of each task end as `outcome` says."""

    description = "a script"

    def __init__(
        self, outcome: Callable[[Run, int], Row | str], capacity: int = 3, wrong: dict[str, Any] | None = None
    ) -> None:
        self._outcome = outcome
        self._wrong = wrong or {}  # values of every row
        self._pool = ThreadPoolExecutor(10)
        self.capacity = lambda: capacity
        self.pieces: list[list[str]] = []  # names of the runs of each task
        self._futures: list[Future[dict[str, Any]]] = []
        self.most = 0  # under way at once

    def submit(self, plain: Any) -> Future[dict[str, Any]]:
        task = read(Task, plain, "task")
        self.pieces.append([run.name for run in task.runs])
        self.most = max(self.most, 1 + sum(not future.done() for future in self._futures))
        self._futures.append(self._pool.submit(self._end, task, self.started.count(task.runs[0].name)))
        return self._futures[-1]

    @property
    def started(self) -> list[str]:
        return [first for first, *_ in self.pieces]

    def _end(self, task: Task, tries: int) -> dict[str, Any]:
        found = [self._outcome(run, tries) for run in task.runs]
        errors = [each for each in found if isinstance(each, str)]
        return {"rows": [] if errors else [write(row) | self._wrong for row in found], "error": "".join(errors[:1])}


def done(run: Run, tries: int) -> Row:
    return row_of(run)


NOBODY = Workers("nobody", lambda task: pytest.fail("begun"), lambda: 1)


def names(runs: Any) -> list[str]:
    return [run.name for run in runs]


def test_a_sweep_that_ends_in_time_leaves_the_rest_to_the_same_call(plan, options):
    """A run that is under way then has no row: it continues from its checkpoint."""
    made, begun, over = plan(), time.monotonic(), threading.Event()

    def outcome(run: Run, tries: int) -> Row:
        if run.name == made.runs[1].name:
            over.wait()
        return row_of(run)

    first = sweep(made, Script(outcome, capacity=1), replace(options, ends_s=begun + 0.2), Mock())
    over.set()
    assert names(first) == names(made.runs[:1])
    workers = Script(done)
    rows = sweep(made, workers, options, Mock())
    assert workers.started == names(made.runs[1:]) and names(rows) == names(made.runs)
    assert sweep(made, NOBODY, replace(options, ends_s=begun), Mock()) == rows


def test_runs_begin_in_the_plans_order_and_no_more_than_there_are_workers(plan, options):
    made, together, watch = plan(), threading.Barrier(3), Mock()

    def outcome(run: Run, tries: int) -> Row:
        if run.name in names(made.runs[:3]):
            together.wait(timeout=60)
        return row_of(run)

    workers = Script(outcome, capacity=3)
    rows = sweep(made, workers, options, watch)
    assert workers.started == names(call.args[0] for call in watch.started.call_args_list) == names(made.runs)
    assert workers.most == 3 and names(rows) == workers.started
    assert read_results(options.results) == sorted(rows, key=lambda row: row.name)


def test_what_failed_is_tried_again_then_recorded_and_tried_by_the_next_sweep(plan, options):
    made, watch = plan(), Mock()
    worst, unlucky = made.runs[0].name, made.runs[2].name

    def outcome(run: Run, tries: int) -> Row | str:
        if run.name == worst or (run.name == unlucky and tries == 1):
            return f"OSError: try {tries}"
        return row_of(run)

    workers = Script(outcome)
    rows = sweep(made, workers, options, watch)
    assert (workers.started.count(worst), workers.started.count(unlucky)) == (2, 2)
    failed = {(row.name, row.status, row.message) for row in rows if row.status != "done"}
    assert failed == {(worst, "failed", "OSError: try 2")}
    failures = [(call.args[0].name, call.args[1]) for call in watch.failed.call_args_list]
    assert sorted(failures) == sorted([(unlucky, "OSError: try 1"), (worst, "OSError: try 1")])
    assert rows[0].finished.endswith("Z")  # as other rows say it, for the later to replace the earlier

    assert names(unfinished(made, read_results(options.results))) == [worst]
    again = Script(lambda run, tries: row_of(run, finished="2100-01-01T00:00:00Z"))
    assert {row.status for row in sweep(made, again, options, Mock())} == {"done"}
    assert again.started == [worst]


def test_the_seeds_of_a_cell_are_one_piece_where_they_are_trained_at_once(plan, options):
    made, watch = plan(seeds="0, 1, 2"), Mock()
    unlucky = made.runs[1].name
    add_rows(options.results, [row_of(made.runs[0])])  # seed 0 of the first cell

    def outcome(run: Run, tries: int) -> Row | str:
        return f"OSError: try {tries}" if run.name == unlucky else row_of(run)

    workers = Script(outcome, capacity=1)
    rows = sweep(made, workers, replace(options, seeds_at_once=True), watch)
    assert sorted(map(len, workers.pieces)) == [2, 3, 3, 3, 3]  # the unlucky piece twice
    assert workers.pieces[0] == workers.pieces[1] and workers.started[0] == unlucky
    assert sorted(names(call.args[0] for call in watch.finished.call_args_list)) == sorted(names(made.runs[1:]))
    assert sorted(row.name for row in rows if row.status == "failed") == sorted(workers.pieces[1])


def test_what_diverged_is_a_result_and_a_row_that_makes_no_sense_is_a_failure(plan, options):
    for wrong in ({"rel_mae": "much"}, {"status": "perhaps"}, {"horizon": "400"}):
        rows = sweep(plan(), Script(done, wrong=wrong), options, Mock())
        assert {row.status for row in rows} == {"failed"} and "makes no sense" in rows[0].message
    later = {"status": "diverged", "rel_mae": None, "finished": "2100-01-01T00:00:00Z"}
    diverged = Script(lambda run, tries: row_of(run, **later))
    assert {row.status for row in sweep(plan(), diverged, options, Mock())} == {"diverged"}
    sweep(plan(), NOBODY, options, Mock())
    assert is_finished(row_of(plan().runs[0])) and not is_finished(None)


def test_a_row_that_another_machine_added_meanwhile_is_not_done_again(plan, options):
    made = plan()
    last = made.runs[-1]

    def outcome(run: Run, tries: int) -> Row:
        add_rows(options.results, [row_of(last, rel_mae=0.25)])
        return row_of(run)

    workers = Script(outcome, capacity=1)
    rows = sweep(made, workers, options, Mock())
    assert last.name not in workers.started and rows[-1].rel_mae == 0.25


def test_workers_that_are_gone_and_a_file_that_cannot_be_written_end_the_sweep(plan, options):
    left: Future[dict[str, Any]] = Future()
    left.cancel()
    left.set_running_or_notify_cancel()
    with pytest.raises(WorkersError, match="The same command continues"):
        sweep(plan(), Workers("none", lambda task: left, lambda: 1), options, Mock())
    options.results.unlink()
    options.results.mkdir()
    with pytest.raises(SchemaError, match="not an ordinary file"):
        sweep(plan(), NOBODY, options, Mock())  # before the work


# Whole sweeps


def alone_rows(plan: Plan, options: Options) -> list[list[Any]]:
    """What a plan's runs measure in this process, one after another."""
    for run in plan.runs:
        outcome = perform(write(options.task(plan, run)))
        add_rows(options.results, [read(Row, row, "row") for row in outcome["rows"]])
    return measured(options.results)


def measured(file: Path) -> list[list[Any]]:
    return [[getattr(row, name) for name in MEASURED] for row in read_results(file)]


class Killer(Watch):
    """Kills the process of the first run that is found some epochs into its training."""

    def __init__(self, runs: Path) -> None:
        self._runs = runs
        self.victim = ""
        self.failures: list[str] = []
        self.listening: list[Any] = []  # what listens can be reached by every account of the computer
        self.kept: list[str] = []  # lines of the victim's log whose epochs its checkpoint had

    def failed(self, run: Any, error: str) -> None:
        self.failures.append(error)

    def progressed(self, run: Any, progress: FitProgress) -> None:
        if self.victim:
            return
        for one in [psutil.Process(), *psutil.Process().children(recursive=True)]:
            with suppress(psutil.NoSuchProcess):  # `git`, which a worker asks for its commit, ends by itself
                self.listening += [port for port in one.net_connections("inet") if port.status == "LISTEN"]
        end = time.monotonic() + 60
        while len(self.lines_of(run.name)) <= 2:
            assert time.monotonic() < end
        for process in map(psutil.Process, (child.pid for child in multiprocessing.active_children())):
            process.suspend()  # or it could end its run meanwhile
            *lines, _ = self.lines_of(run.name)
            holds = any(Path(file.path).parts[-2:] == (run.name, "run.lock") for file in process.open_files())
            if holds and len(lines) < progress.epochs:
                self.victim, self.kept = run.name, lines
                process.kill()
                return
            process.resume()

    def lines_of(self, name: str) -> list[str]:
        log = self._runs / name / "log.csv"
        return log.read_text(encoding="utf-8").splitlines() if log.exists() else []


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> list[list[Any]]:
    """The rows of ten epochs, measured one after another in this process."""
    folder = tmp_path_factory.mktemp("alone")
    made = plan_in(folder, epochs=10)
    return alone_rows(made, Options(folder / "alone.csv", folder / "alone", folder / "cache", "cpu", 1))


def here(count: int) -> Layout:
    return replace(fitted(count, device="cpu", workers=count), threads=1)


def test_a_sweep_whose_worker_is_killed_is_that_of_one_left_alone(plan, options, expected, monkeypatch):
    """Two models on two data sets from two seeds: on two processes with a kill, and one after another here."""
    made = plan(epochs=10)
    options = replace(options, seeds_at_once=True)

    monkeypatch.setattr("training.sweeping.sweep.POLL_S", 0.02)
    killer = Killer(options.runs / made.name)
    with process_workers(here(2)) as workers:
        rows = sweep(made, workers, options, killer)
    assert not multiprocessing.active_children() and killer.listening == []
    assert names(rows) == names(made.runs) and {row.status for row in rows} == {"done"}
    assert len(rows) == 8
    (error,) = killer.failures
    assert error.startswith("its worker died") and "BrokenProcessPool" in error
    assert measured(options.results) == expected
    log = killer.lines_of(killer.victim)
    assert log[: len(killer.kept)] == killer.kept  # continued from its checkpoint: their seconds would be others
    assert [line.split(",")[0] for line in log[1:]] == [str(epoch) for epoch in range(1, 11)]

    # the same plan again: nothing to do, nothing changed
    before = options.results.read_bytes()
    assert names(sweep(made, NOBODY, options, Mock())) == names(rows)
    assert options.results.read_bytes() == before

    # the results file is lost: the rows come back from the runs' folders
    options.results.unlink()
    alone_rows(made, options)
    assert options.results.read_bytes() == before


def test_a_process_that_died_between_two_tasks_is_replaced_and_a_task_under_way_ends_with_its_workers(task):
    wrong = {"runs": [], "digests": [], "threads": "two"}
    folder = task.folder_of(task.runs[0].name)
    folder.mkdir(parents=True)
    with FileLock(folder / "run.lock"), process_workers(here(1)) as workers:  # a task would wait for ever
        assert "task.threads" in workers.submit(wrong).result()["error"]
        (process,) = multiprocessing.active_children()
        process.kill()
        process.join()
        with suppress(BrokenExecutor):  # where the pool has not noticed it yet
            workers.submit(wrong).result()
        assert "task.threads" in workers.submit(wrong).result()["error"]
        left = workers.submit(write(task))
    assert isinstance(left.exception(), BrokenExecutor)
    assert not multiprocessing.active_children()
