from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import pytest

from training.cell import Cell, configuration_of
from training.results import Row, add_rows


@pytest.fixture
def results(tmp_path: Path) -> Path:
    path = tmp_path / "results.csv"
    facts: dict[str, Any] = {"model": "s5", "string": "linear", "initial": "noise", "rate_hz": 4000, "horizon": 4000}
    rows = []
    for seed in (1, 2):
        cell = Cell("s5", False, "noise", 4000, recipe="paper", seed=seed)
        figures = {"rel_mse": 0.001, "rel_mae": 0.01 * seed, "initialisation": "paper"}
        digest = configuration_of(cell).digest
        rows.append(Row(digest, cell.name, "done", **facts, recipe="paper", seed=seed, **figures))
    add_rows(path, rows)
    return path


def test_the_tables_are_printed_or_written(run, results: Path, folder: Path) -> None:
    printed = run("table", "--results", results, "--metric", "mae")
    assert (printed.status, printed.err) == (0, "")
    assert "**0.015 (0.1023) ×0.15**" in printed.out
    assert printed.out.count("### 400 frames, relative MAE") == 1
    path = folder / "tables.md"
    assert run("table", "--results", results, "--metric", "mae", "--output", path).out == f"{path}\n"
    assert path.read_text(encoding="utf-8") == printed.out
    assert list(folder.iterdir()) == [path]


def test_the_tables_of_a_document_are_made_again_in_place(run, results: Path, folder: Path) -> None:
    document = folder / "RESULTS.md"
    document.write_text("# Results\n\nWords.\n\n<!-- tables -->\nan older table\n", encoding="utf-8")
    words = ["table", "--results", results]
    assert run(*words, "--into", document).out == f"{document}\n"
    made = document.read_text(encoding="utf-8")
    assert made == f"# Results\n\nWords.\n\n<!-- tables -->\n\n{run(*words).out}"
    assert run(*words, "--into", document).status == 0
    assert document.read_text(encoding="utf-8") == made
    document.write_text("# Results\n", encoding="utf-8")
    assert (
        "has no line <!-- tables -->; put it where the tables are to begin" in run(*words, "--into", document).failure
    )
    assert document.read_text(encoding="utf-8") == "# Results\n"
    assert "--into" in run(*words, "--into", document, "--output", folder / "other.md").usage


def test_a_recipe_is_chosen(run, results: Path) -> None:
    assert (
        "2 of 2 rows of the results file are not shown" in run("table", "--results", results, "--recipe", "ours").out
    )


def test_csv_is_read_back(run, results: Path) -> None:
    lines = list(csv.DictReader(io.StringIO(run("table", "--results", results, "--format", "csv").out)))
    assert [entry["runs"] for entry in lines if entry["seeds"] == "2"] == [
        "nylon_linear_noise_4k_s5_paper_seed1 nylon_linear_noise_4k_s5_paper_seed2"
    ]
    assert "--into" in run("table", "--results", results, "--format", "csv", "--into", results).usage


def test_no_results_are_reported_and_the_papers_tables_are_there(run, folder: Path) -> None:
    found = run("table", "--results", folder / "none.csv")
    assert "none.csv has no rows" in found.err
    assert "not run (0.0113)" in found.out


def test_a_file_that_is_no_results_file_is_reported(run, folder: Path) -> None:
    (folder / "other.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    assert "not a results file" in run("table", "--results", folder / "other.csv").failure


@pytest.mark.parametrize("group", ["family", "drums"])
def test_a_list_of_commands_cuts_no_summary(run, group: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    listed = run(group, "--help").out.partition("Commands:")[2].strip().splitlines()
    assert len(listed) >= 2
    assert all(line.endswith(".") and not line.endswith("...") for line in listed)
