from __future__ import annotations

import errno
import json
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from engine.compare.relative import RelativeError
from engine.result_file import REMEDIES
from engine.schema import read, write
from tests.app.commands.conftest import FullDisk
from training.cli import console
from training.cli.sweep import Shown
from training.fitting.fit import Progress
from training.results import Row, add_rows, read_results
from training.sweeping.plan import load_plan
from training.sweeping.processes import Layout
from training.sweeping.task import Task, Workers

PLAN = """
description = "Two runs."
[data]
count = 10
steps = 60
[[block]]
models = ["koopman_var", "koopman"]
strings = ["linear"]
initials = ["noise"]
rates_hz = [4000]
horizons = [60]
"""
NAMES = ["nylon_linear_noise_4k_koopman_var_60", "nylon_linear_noise_4k_koopman_60"]


def row_of(name: str, digest: str = "", **changes: Any) -> Row:
    fields = {"status": "done", "model": "koopman", "string": "linear", "initial": "noise", "rate_hz": 4000}
    fields |= {"horizon": 60, "recipe": "ours", "seed": 0, "rel_mae": 0.5, "seconds": 8.0}
    return Row(digest or name, name, **({**fields, "finished": "2026-01-01T00:00:00Z"} | changes))


def named(name: str) -> Any:
    return SimpleNamespace(name=name)


def progress_of(seconds: float, seconds_left: float, validation: RelativeError | None = None) -> Progress:
    return Progress(2, 8, 1, 4, 60, 1e-3, 0.5, validation, seconds, seconds_left)


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "trial.toml"
    path.write_text(PLAN, encoding="utf-8")
    return path


@pytest.fixture
def words(plan: Path, tmp_path: Path) -> list[Any]:
    return ["sweep", plan, "--runs", tmp_path / "runs", "--device", "cpu"]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Layout]]:
    """Makes workers that train nothing: a task ends as a function of its name says."""

    def make(outcome: Callable[[str], Row | str]) -> list[Layout]:
        layouts: list[Layout] = []

        def submit(plain: Any) -> Future[dict[str, Any]]:
            task = read(Task, plain, "task")
            (run,) = task.runs
            future: Future[dict[str, Any]] = Future()
            found = outcome(run.name)
            failed = isinstance(found, str)
            rows = [] if failed else [write(found) | {"digest": run.digest}]
            future.set_result({"rows": rows, "error": found if failed else ""})
            return future

        @contextmanager
        def process_workers(layout: Layout) -> Iterator[Workers]:
            layouts.append(layout)
            yield Workers("a script", submit, lambda: 1)

        monkeypatch.setattr("training.sweeping.processes.process_workers", process_workers)
        return layouts

    return make


def test_a_sweep_ends_with_its_rows(run, words: list[Any], tmp_path: Path, script) -> None:
    layouts = script(row_of)
    found = run(*words, "--workers", "3", "--threads", "2")
    assert found.status == 0
    assert (len(layouts[0].environments), layouts[0].threads) == (2, 2)  # not more than runs
    file = tmp_path / "runs" / "trial" / "results.csv"  # a trial's own
    assert [row.name for row in read_results(file)] == sorted(NAMES)
    lines = found.err.splitlines()
    assert lines[0] == f"learned-strings: trial: 2 of 2 runs to do; rows go to {file}"
    assert lines[1] == "learned-strings: on a script"
    assert f"{NAMES[0]}: done, rel. MAE 0.5, 8 s (1 done, 0 running, 1 waiting; about 8 s left)" in lines[2]
    assert [name in found.out for name in NAMES] == [True, True]

    again = run(*words, "--json")
    assert [row["name"] for row in json.loads(again.out)] == sorted(NAMES)
    assert again.err == f"learned-strings: trial: 0 of 2 runs to do; rows go to {file}\n"


def test_failed_runs_are_the_commands_failure_after_all_else_is_done(run, words: list[Any], script) -> None:
    script(lambda name: "OSError: no space" if name == NAMES[0] else row_of(name))
    found = run(*words, "--retries", "0")
    assert found.status == 1
    assert found.err.splitlines()[-1] == (
        f"learned-strings: 1 of 2 runs failed: {NAMES[0]}; their rows say why, and the same command tries them again"
    )
    assert f"{NAMES[0]}: failed, OSError: no space" in found.err
    assert "done" in found.out


def test_an_interrupted_sweep_goes_on(run, words: list[Any], tmp_path: Path, script) -> None:
    def interrupted(name: str) -> Row:
        if name == NAMES[1]:
            raise KeyboardInterrupt
        return row_of(name)

    script(interrupted)
    found = run(*words)
    assert found.status == 130
    assert "stopped; the same command continues" in found.err
    begun = []
    script(lambda name: begun.append(name) or row_of(name))
    assert run(*words).status == 0
    assert begun == NAMES[1:]


def test_a_dry_run_lists_the_order_and_what_is_finished(run, words: list[Any], tmp_path: Path, plan: Path) -> None:
    file = tmp_path / "results.csv"
    add_rows(file, [row_of(NAMES[1], load_plan(str(plan)).runs[1].digest)])
    before = sorted(tmp_path.rglob("*"))
    found = run(*words, "--dry-run", "--results", file)
    assert found.status == 0
    assert found.out.index(NAMES[0]) < found.out.index(NAMES[1])
    assert "1 of 2 runs were never done" in found.out
    facts = json.loads(run(*words, "--dry-run", "--results", file, "--json").out)
    assert facts == [
        {"name": NAMES[0], "status": "", "rel_mae": None},
        {"name": NAMES[1], "status": "done", "rel_mae": 0.5},
    ]
    assert sorted(tmp_path.rglob("*")) == before


def test_a_plan_that_is_not_there_is_reported(run) -> None:
    assert (
        "no plan 'nothing'; give a .toml file or one of: published, tables, tiny" in run("sweep", "nothing").failure
    )


def test_an_unknown_name_in_a_plan_is_reported(run, words: list[Any], plan: Path) -> None:
    plan.write_text(PLAN.replace('"koopman"', '"koopmann"'), encoding="utf-8")
    assert f"{plan}.block[0]: model 'koopmann' is not one of" in run(*words).failure


def test_a_results_file_that_is_none_is_reported(run, words: list[Any], plan: Path) -> None:
    assert "not a results file" in run(*words, "--results", plan).failure


def test_a_cluster_without_its_extra_is_one_line_with_the_remedy(
    run, words: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    found = run(*words, "--scheduler", "tls://127.0.0.1:9")
    assert found.status == 1
    _, reported = found.err.splitlines()
    assert reported.startswith("learned-strings: tls://127.0.0.1:9: a cluster needs Dask")
    assert "install the extra learned-strings[cluster] as docs/install.md says" in reported


@pytest.mark.parametrize(("scheme", "warned"), [("tcp", True), ("tls", False)])
def test_a_scheduler_that_anybody_can_reach_is_warned_of(
    run, words: list[Any], monkeypatch: pytest.MonkeyPatch, scheme: str, warned: bool
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    found = run(*words, "--scheduler", f"{scheme}://127.0.0.1:9")
    assert ("can run code on its workers" in found.err) == warned


@pytest.mark.parametrize("option", ["--workers", "--threads", "--per-device"])
def test_no_workers_are_bad_usage(run, words: list[Any], option: str) -> None:
    assert option in run(*words, option, "0").usage


def test_files_of_other_machines_are_merged(run, tmp_path: Path) -> None:
    here, there, elsewhere = (tmp_path / f"{name}.csv" for name in ("here", "there", "elsewhere"))
    add_rows(here, [row_of("a")])
    add_rows(there, [row_of("a", rel_mae=0.25, finished="2026-01-02T00:00:00Z"), row_of("b")])
    add_rows(elsewhere, [row_of("a", status="failed", rel_mae=None, finished="2026-01-03T00:00:00Z"), row_of("c")])
    found = run("results", "merge", there, elsewhere, "--results", here)
    assert (found.status, found.out) == (0, f"{here}: 3 rows, 2 of them new\n")
    assert [(row.name, row.rel_mae) for row in read_results(here)] == [("a", 0.25), ("b", 0.5), ("c", 0.5)]

    before = here.read_bytes()
    there.write_text("something else\n", encoding="utf-8")
    assert f"{there}: not a results file" in run("results", "merge", elsewhere, there, "--results", here).failure
    assert "does not exist" in run("results", "merge", tmp_path / "no.csv", "--results", here).usage
    assert here.read_bytes() == before


@pytest.mark.parametrize("bytes_left", [0, 700])
def test_a_full_disk_leaves_the_rows_as_they_were(run, tmp_path: Path, bytes_left: int, full_disk: FullDisk) -> None:
    here, there = tmp_path / "here.csv", tmp_path / "there.csv"
    add_rows(here, [row_of("a")])
    add_rows(there, [row_of("b")])
    before = here.read_bytes()
    with full_disk(bytes_left):
        reported = run("results", "merge", there, "--results", here).failure
    assert reported == f"learned-strings: {here}: cannot be written (File too large); {REMEDIES[errno.EFBIG]}"
    assert here.read_bytes() == before
    assert not list(tmp_path.glob("*.unfinished"))


def test_the_time_left_follows_what_is_known() -> None:
    ended: list[str] = []

    def begin(what: str) -> Any:
        return lambda share, *reported: ended.append(what) if share == 1 else None

    shown = Shown(begin, 5, 2)
    assert shown.summary() == "0 done, 0 running, 5 waiting"
    for name in ("a", "b"):
        shown.started(named(name))
    assert shown.seconds_left() is None
    shown.progressed(named("a"), progress_of(10, 30))
    assert shown.seconds_left() == (30 + 4 * 40) / 2
    shown.finished(row_of("a", seconds=20.0))
    assert shown.seconds_left() == 4 * 20 / 2
    shown.finished(row_of("b", status="diverged", seconds=None))
    assert shown.summary() == "1 done, 1 diverged, 0 running, 3 waiting; about 30 s left"
    assert ended == ["a", "b"]


def test_a_terminal_shows_each_run_that_is_under_way(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "150")
    with console.bars() as begin:
        shown = Shown(begin, 3, 2)
        for name in ("first", "second"):
            shown.started(named(name))
        shown.progressed(named("second"), progress_of(10, 30, RelativeError(0.25, 0.125)))
        shown.progressed(named("second"), progress_of(20, 20))
    reported = capsys.readouterr().err
    assert "first" in reported
    assert "20 s left step 2, epoch 1/4, horizon 60, loss 0.5, val. MAE 0.125" in reported


def test_a_log_reports_of_a_long_run_now_and_then(capsys) -> None:
    for every_s in (60.0, 0.0):
        with console.bars(every_s) as begin:
            shown = Shown(begin, 1, 1)
            shown.started(SimpleNamespace(name="a"))
            shown.progressed(named("a"), progress_of(1, 3, RelativeError(0.25, 0.125)))
    reported = "learned-strings: a: 25%, 3 s left step 2, epoch 1/4, horizon 60, loss 0.5, val. MAE 0.125\n"
    assert capsys.readouterr().err == reported
