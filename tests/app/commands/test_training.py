"""train, sweep, results and table: runs, their files, and how they continue."""

import csv
import io
import json
import runpy
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from engine.compare.relative import RelativeError
from engine.presets import load_preset, preset_digest
from engine.schema import read, write
from tests.app.commands.conftest import CONFIGURATION
from training.cell import Cell, configuration_of
from training.cli.sweep import Shown
from training.fitting.fit import FitProgress
from training.fitting.log import read_log
from training.heard_file import read_heard
from training.heard_words import heard_sentence
from training.results import Row, add_rows, read_results
from training.sweeping.processes import Layout
from training.sweeping.task import Task, Workers

NAMES = ["nylon_linear_noise_4k_koopman_var_60", "nylon_linear_noise_4k_koopman_60"]


def test_runs_are_trained_together_alone_or_shortened_and_never_twice(run, tmp_path, folder):
    train = f"train {{made:tiny.toml}} --runs {{folder}} --cache {tmp_path / 'cache'}"
    together = run(f"{train} --seeds 2")
    assert (together.status, together.err) == (0, "")
    paths = [folder / name / f"{name}.safetensors" for name in ("tiny", "tiny_seed1")]
    one, other = (load_preset(path) for path in paths)
    errors = [one.info.rel_mse, other.info.rel_mse]
    middle, deviation = sum(errors) / 2, abs(errors[0] - errors[1]) / 2**0.5
    assert f"2 seeds     rel. MSE {middle:.4g} ± {deviation:.4g}" in together.out
    assert other.info.title == f"{one.info.title}, seed 1"
    assert any((a != b).any() for a, b in zip(one.model.parameters(), other.model.parameters(), strict=True))

    lines = run(f"{train} --seed 0").out.splitlines()  # its own seed: the same run
    info = one.info
    assert lines[0] == str(paths[0])
    assert f"rel. MSE {info.rel_mse:.4g}, rel. MAE {info.rel_mae:.4g}" in lines[1]
    assert f"rel. MSE {info.test_rel_mse:.4g}, rel. MAE {info.test_rel_mae:.4g}" in lines[2]
    assert lines[3].startswith("untrained   rel. MSE ")
    assert lines[5] == "finished earlier, nothing was trained now"
    heard, problems = read_heard(paths[0].parent)
    assert lines[6] == f"heard       {heard_sentence(heard[preset_digest(paths[0])], 'tiny')}" and problems == []
    assert info.trained_range.position == (0.3, 0.7)

    assert run(f"{train} --seed 1 --epochs 2 --output {{out}}.safetensors").status == 0
    info = load_preset(folder / "out.safetensors").info
    assert (info.title, info.training["recipe"]["epochs"]) == ("Tiny, seed 1, 2 epochs", 2)
    for name, epochs in (("tiny", 3), ("tiny_seed1_epochs2", 2)):
        rates = [epoch.learning_rate for epoch in read_log(folder / name / "log.csv")]
        assert len(rates) == epochs and rates[-1] == 0  # the cycle ends with the run
    (tmp_path / "tiny.toml").write_text(CONFIGURATION.replace("epochs = 3", "epochs = 4"), encoding="utf-8")
    assert "was trained with other settings; delete it" in run(train).failure
    if not torch.cuda.is_available():
        assert "no CUDA device can be used here" in run(f"{train} --seed 5 --device cuda").failure


def test_a_shortened_cell_is_no_row_of_its_recipe(run, monkeypatch):
    chosen: list[tuple[str, str]] = []

    def begin(runs: Any, *_: Any, **__: Any) -> None:
        chosen.extend((one.name, one.recipe) for one in runs)
        raise KeyboardInterrupt

    monkeypatch.setattr("training.cli.training.load_data", lambda *_: None)
    monkeypatch.setattr("training.run.run_rows", begin)
    cell = "nylon_linear_noise_4k_lru_400_paper"
    for words in (cell, f"{cell} --epochs 9 --seeds 2", f"{cell}_seed1_epochs9"):  # and by its own name
        run(f"train {words}")
    assert chosen == [(cell, "paper"), (f"{cell}_epochs9", ""), *[(f"{cell}_seed1_epochs9", "")] * 2]


# Sweeps


def row_of(name: str, digest: str = "", **changes: Any) -> Row:
    fields = {"status": "done", "model": "koopman", "string": "linear", "initial": "noise", "rate_hz": 4000}
    fields |= {"horizon": 60, "recipe": "ours", "seed": 0, "rel_mae": 0.5, "seconds": 8.0}
    return Row(digest or name, name, **({**fields, "finished": "2026-01-01T00:00:00Z"} | changes))


SWEEP = "sweep {made:plan.toml} --runs {folder} --device cpu"
Script = Callable[[Callable[[str], Row | str]], list[Layout]]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Script:
    """Make workers that train nothing: a task ends as a function of its name says."""

    def make(outcome: Callable[[str], Row | str]) -> list[Layout]:
        layouts: list[Layout] = []

        def submit(plain: Any) -> Future[dict[str, Any]]:
            (run,) = read(Task, plain, "task").runs
            found = outcome(run.name)
            rows = [] if isinstance(found, str) else [write(found) | {"digest": run.digest}]
            future: Future[dict[str, Any]] = Future()
            future.set_result({"rows": rows, "error": found if isinstance(found, str) else ""})
            return future

        @contextmanager
        def process_workers(layout: Layout) -> Iterator[Workers]:
            layouts.append(layout)
            yield Workers("a script", submit, lambda: 1)

        monkeypatch.setattr("training.sweeping.processes.process_workers", process_workers)
        return layouts

    return make


def test_a_sweep_ends_with_its_rows(run, folder, script):
    layouts = script(row_of)
    found = run(f"{SWEEP} --workers 3 --threads 2")
    assert found.status == 0
    assert (len(layouts[0].environments), layouts[0].threads) == (2, 2)  # not more than runs
    file = folder / "plan" / "results.csv"  # a trial's own
    assert [row.name for row in read_results(file)] == sorted(NAMES)
    lines = found.err.splitlines()
    assert lines[0] == f"learned-strings: plan: 2 of 2 runs to do; rows go to {file}"
    assert lines[1] == "learned-strings: on a script"
    assert f"{NAMES[0]}: done, rel. MAE 0.5, 8 s (1 done, 0 running, 1 waiting; about 8 s left)" in lines[2]
    assert [name in found.out for name in NAMES] == [True, True]
    again = run(f"{SWEEP} --json")
    assert [row["name"] for row in json.loads(again.out)] == sorted(NAMES)
    assert again.err == f"learned-strings: plan: 0 of 2 runs to do; rows go to {file}\n"


@pytest.mark.parametrize(
    ("plan", "status", "words"), [("tiny", 0, "8 of 8 runs were never done"), ("none", 1, "no plan 'none'")]
)
def test_a_sweep_needs_no_app(plan, status, words, folder, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["training.cli", plan, "--dry-run", "--results", str(folder / "none.csv")])
    with pytest.raises(SystemExit, match=str(status)):
        runpy.run_module("training.cli", run_name="__main__")
    assert words in "".join(capsys.readouterr())


def test_a_sweep_that_was_interrupted_or_failed_continues_with_what_is_left(run, script, tmp_path):
    begun: list[str] = []

    def outcome(name: str) -> Row | str:
        begun.append(name)
        if len(begun) == 2:
            raise KeyboardInterrupt
        return row_of(name) if len(begun) != 3 else "OSError: no space"

    script(outcome)
    found = run(SWEEP)
    assert found.status == 130 and "stopped; the same command continues" in found.err
    before = sorted(tmp_path.rglob("*"))
    facts = json.loads(run(f"{SWEEP} --dry-run --json --minutes 60").out)
    left = [(NAMES[0], "done", 0.5), (NAMES[1], "", None)]
    assert [(each["name"], each["status"], each["rel_mae"]) for each in facts] == left
    assert sorted(tmp_path.rglob("*")) == before
    found = run(f"{SWEEP} --retries 0")
    assert found.status == 1
    assert found.err.splitlines()[-1] == (
        f"learned-strings: 1 of 2 runs failed: {NAMES[1]}; their rows say why, and the same command tries them again"
    )
    assert f"{NAMES[1]}: failed, OSError: no space" in found.err and "done" in found.out
    assert run(SWEEP).status == 0
    assert begun == [*NAMES, NAMES[1], NAMES[1]]


@pytest.mark.parametrize(("scheme", "warned"), [("tcp", True), ("tls", False)])
def test_an_open_scheduler_is_warned_of(run, monkeypatch, scheme, warned):
    monkeypatch.setitem(sys.modules, "distributed", None)
    found = run(f"{SWEEP} --scheduler {scheme}://127.0.0.1:9")
    assert found.status == 1 and ("can run code on its workers" in found.err) == warned
    assert found.err.splitlines()[-1].startswith(f"learned-strings: {scheme}://127.0.0.1:9: a cluster needs Dask")


def test_files_of_other_machines_are_merged(run, tmp_path):
    here, there, elsewhere = (tmp_path / f"{name}.csv" for name in ("here", "there", "elsewhere"))
    add_rows(here, [row_of("a")])
    add_rows(there, [row_of("a", rel_mae=0.25, finished="2026-01-02T00:00:00Z"), row_of("b")])
    add_rows(elsewhere, [row_of("a", status="failed", rel_mae=None, finished="2026-01-03T00:00:00Z"), row_of("c")])
    found = run("results merge --results", here, there, elsewhere)
    assert (found.status, found.out) == (0, f"{here}: 3 rows, 2 of them new\n")
    assert [(row.name, row.rel_mae) for row in read_results(here)] == [("a", 0.25), ("b", 0.5), ("c", 0.5)]
    before = here.read_bytes()
    there.write_text("something else\n", encoding="utf-8")
    assert f"{there}: not a results file" in run("results merge --results", here, elsewhere, there).failure
    assert here.read_bytes() == before


def test_the_time_left_follows_from_the_runs_so_far(capsys):
    shown = Shown(lambda what: lambda *_: None, 5, 2)
    one, other = (SimpleNamespace(name=name) for name in "ab")
    for each in (one, other):
        shown.started(each)
    assert shown.seconds_left() is None
    shown.progressed(one, FitProgress(2, 8, 1, 4, 60, 1e-3, 0.5, RelativeError(0.25, 0.125), 10, 30))
    assert shown.seconds_left() == (30 + 4 * 40) / 2
    shown.failed(other, "OSError: no space")
    assert capsys.readouterr().err == "learned-strings: b: failed and is tried again (OSError: no space)\n"
    shown.finished(row_of("a", seconds=20.0))
    shown.finished(row_of("b", status="diverged", seconds=None))
    assert shown.summary() == "1 done, 1 diverged, 0 running, 3 waiting; about 30 s left"


def test_tables_are_printed_written_or_made_again_in_a_document(run, folder):
    results, path, document = (folder / name for name in ("results.csv", "tables.md", "RESULTS.md"))
    facts: dict[str, Any] = {"model": "s5", "string": "linear", "initial": "noise", "rate_hz": 4000, "horizon": 4000}
    for seed in (1, 2):
        cell = Cell("s5", False, "noise", 4000, recipe="paper", seed=seed)
        figures = {"rel_mse": 0.001, "rel_mae": 0.01 * seed, "initialisation": "paper"}
        digest = configuration_of(cell).digest
        add_rows(results, [Row(digest, cell.name, "done", **facts, recipe="paper", seed=seed, **figures)])
    table = "table --metric mae --results {folder}/results.csv"
    printed = run(table)
    assert (printed.status, printed.err) == (0, "")
    assert "**0.015 (0.1023) ×0.15**" in printed.out and "not run (0.0113)" not in printed.out.partition("S5")[0]
    assert run(table, "--output", path).out == f"{path}\n"
    assert path.read_text(encoding="utf-8") == printed.out
    document.write_text("# Results\n\nWords.\n\n<!-- tables -->\nan older table\n", encoding="utf-8")
    for _ in range(2):
        assert run(table, "--into", document).out == f"{document}\n"
        made = document.read_text(encoding="utf-8")
        assert made == f"# Results\n\nWords.\n\n<!-- tables -->\n\n{printed.out}"
    document.write_text("# Results\n", encoding="utf-8")
    refused = run(table, "--into", document).failure
    assert "has no line <!-- tables -->; put it where the tables are to begin" in refused
    assert document.read_text(encoding="utf-8") == "# Results\n"
    lines = list(csv.DictReader(io.StringIO(run(f"{table} --format csv").out)))
    assert {entry["runs"].count("nylon_linear_noise_4k_s5_paper_seed") for entry in lines} == {0, 2}
    assert "2 of 2 rows of the results file are not shown" in run(f"{table} --recipe ours").out
    none = run("table --results {folder}/none.csv")
    assert "none.csv has no rows" in none.err and "not run (0.0113)" in none.out
