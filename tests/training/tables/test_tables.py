from __future__ import annotations

import csv
import io
from dataclasses import replace
from typing import Any

import pytest

from training.cell import Cell, configuration_of
from training.results import Row
from training.start import PHASES
from training.tables.compact import as_compact
from training.tables.paper import COLUMNS, Column, Figure
from training.tables.sections import sections
from training.tables.tidy_csv import as_csv

G4 = Column("gaussian", 4000)


def row(cell: Cell | None = None, mse: float | None = 0.01, mae: float | None = 0.1, **changes: Any) -> Row:
    """A row as a run of the cell makes it."""
    cell = cell or Cell("lru", True, "gaussian", 4000)
    facts: dict[str, Any] = {
        "digest": configuration_of(cell).digest,
        "name": cell.name,
        "status": "done",
        "model": cell.model,
        "string": cell.string_kind,
        "initial": cell.initial,
        "rate_hz": cell.rate_hz,
        "horizon": cell.horizon,
        "recipe": cell.recipe,
        "seed": cell.seed,
        "initialisation": "paper",
        "rel_mse": mse,
        "rel_mae": mae,
    }
    return Row(**(facts | changes))


def seeds(count: int, **fields: Any) -> list[Cell]:
    fields = {"model": "lru", "tension_modulated": True, "initial": "gaussian", "rate_hz": 4000} | fields
    return [Cell(seed=seed, **fields) for seed in range(count)]


def records(text: str, **wanted: str) -> list[dict[str, str]]:
    lines = list(csv.DictReader(io.StringIO(text)))
    return [entry for entry in lines if all(entry[name] == value for name, value in wanted.items())]


def cell(rows: list[Row], **wanted: str) -> dict[str, str]:
    """The only line of the CSV that has these values, of the non-linear string at 4 kHz."""
    place = {"string": "nonlinear", "horizon": "4000", "model": "lru", "initial": "gaussian", "rate_hz": "4000"}
    (found,) = records(as_csv(rows), **{**place, **wanted})
    return found


def test_a_cell_is_the_mean_over_its_seeds_beside_the_paper() -> None:
    first, second = seeds(2)
    found = cell([row(first, 0.010, 0.10), row(second, 0.012, 0.16)])
    assert (found["paper_rel_mse"], found["paper_rel_mse_std"]) == ("0.026", "0.0067")
    assert float(found["rel_mse"]) == pytest.approx(0.011)
    assert float(found["rel_mae_std"]) == pytest.approx(0.03 * 2**0.5)
    assert (found["mse_mark"], found["mae_mark"], found["seeds"]) == ("better", "equal", "2")


def test_one_seed_has_no_deviation() -> None:
    found = cell([row(mse=5.123e-6, mae=1.5)])
    assert (found["rel_mse"], found["rel_mse_std"], found["seeds"]) == ("5.123e-06", "", "1")
    assert (found["mse_mark"], found["mae_mark"]) == ("better", "worse")


def test_a_seed_that_runs_away_on_the_test_split_is_not_left_out_of_its_mean() -> None:
    first, second = seeds(2)
    tame, wild = (row(name, 0.01, test_rel_mse=test) for name, test in ((first, 0.01), (second, None)))
    assert (cell([tame])["test_rel_mse"], cell([tame])["test_mse_mark"]) == ("0.01", "better")
    assert cell([tame, wild])["test_rel_mse"] == ""


def test_which_strings_are_in_the_split_counts_beside_the_seeds() -> None:
    first, second = seeds(2)
    assert cell([row(first, 0.02, rel_mse_se=0.005)])["rel_mse_se"] == "0.005"
    # deviation over seeds 0.003, of the split √((0.003² + 0.005²) / 2): the seeds share their strings
    found = cell(
        [
            row(first, 0.02 - 0.0015 * 2**0.5, rel_mse_se=0.003),
            row(second, 0.02 + 0.0015 * 2**0.5, rel_mse_se=0.005),
        ]
    )
    assert found["mse_mark"] == "equal"
    assert float(found["rel_mse_std"]) == pytest.approx(0.003)
    assert float(found["rel_mse_se"]) == pytest.approx(17e-6**0.5)


def test_the_test_split_has_marks_of_its_own() -> None:
    found = cell([row(mse=0.005, mae=0.1, test_rel_mse=0.03, test_rel_mae=0.2, test_rel_mse_se=0.002)])
    assert (found["mse_mark"], found["test_mse_mark"], found["test_mae_mark"]) == ("better", "equal", "worse")
    assert (found["test_rel_mse"], found["test_rel_mse_se"], found["test_rel_mae_se"]) == ("0.03", "0.002", "")


def test_diverged_and_failed_runs_are_counted() -> None:
    a, b, c, d = seeds(4)
    gone = {"mse": None, "mae": None}
    rows = [row(a), row(b, **gone, status="diverged"), row(c, **gone, status="diverged")]
    rows.append(row(d, **gone, status="failed"))
    found = cell(rows)
    assert (found["rel_mse"], found["seeds"], found["diverged"], found["failed"]) == ("0.01", "1", "2", "1")
    assert cell(rows[1:3])["rel_mse"] == ""


def test_prior_knowledge_and_recipes_have_lines_of_their_own() -> None:
    ours, paper = (Cell("koopman_var", True, "gaussian", 4000, recipe=recipe) for recipe in ("ours", "paper"))
    rows = [row(ours, 0.006, initialisation="physics"), row(paper, 0.020)]
    assert cell(rows, model="koopman_var", structured="True")["mse_mark"] == "equal"
    assert cell(rows, model="koopman_var", recipe="paper")["mse_mark"] == "worse"
    dmd = row(Cell("dmd", True, "gaussian", 4000), 1.0, 0.8, initialisation="least squares")
    assert cell([dmd], model="dmd")["structured"] == "False"
    for recipe in ("ours", "paper"):
        lines = records(as_csv(rows, recipe), model="koopman_var", seeds="1")  # type: ignore[arg-type]
        assert [entry["recipe"] for entry in lines] == [recipe]


def test_long_runs_measured_over_400_frames_are_apart_from_short_ones() -> None:
    long, short = Cell("lru", True, "gaussian", 4000), Cell("lru", True, "gaussian", 4000, 400)
    first_frames = {"rel_mse_400": 0.0002, "rel_mae_400": 0.01, "test_rel_mse_400": 0.0003, "rel_mse_400_se": 0.00001}
    rows = [row(long, test_rel_mse=0.9, **first_frames), row(short, 0.0008, 0.02)]
    assert cell(rows, horizon="400", trained="400")["rel_mse"] == "0.0008"
    from_long = cell(rows, horizon="400", trained="4000")
    assert (from_long["rel_mse"], from_long["rel_mse_se"], from_long["rel_mae"]) == ("0.0002", "1e-05", "0.01")
    assert (from_long["test_rel_mse"], from_long["test_rel_mae"]) == ("0.0003", "")
    assert cell([row(long)], horizon="400")["seeds"] == "0"


def test_of_two_runs_of_a_seed_the_later_counts_and_the_rest_is_said_to_be_left_out() -> None:
    other = Cell("lru", True, "gaussian", 4000, 1000)
    rows = [
        row(mse=0.3, finished="2025-02-01T00:00:00Z"),
        row(mse=0.4, finished="2025-01-01T00:00:00Z", digest="older"),
        row(other),
    ]
    (section,) = (s for s in sections(rows) if s.place == ("nonlinear", 4000))
    assert [entry[G4].rel_mse for entry in section.lines.values()] == [Figure(0.3)]
    assert "2 of 3 rows of the results file are not shown" in as_compact(rows)


def compact_lines(text: str, horizon: int, string: str, model: str) -> list[list[str]]:
    """What follows string and model in a compact table's lines of them."""
    part = text.partition(f"### {horizon} frames")[2].partition("\n\n")[2].partition("\n\n")[0]
    cells = [[cell.strip() for cell in entry.strip("|").split(" | ")] for entry in part.splitlines()]
    return [entry[2:] for entry in cells if entry[:2] == [string, model]]


def test_a_compact_line_has_start_seeds_figures_and_ratio() -> None:
    first, second = seeds(2)
    found = as_compact([row(first, 0.010, 0.10), row(second, 0.012, 0.16)])
    (ours,) = compact_lines(found, 4000, "nonlinear", "LRU")
    assert ours == ["random weights", "2", "**0.011 (0.0260) ×0.42**", *["not run"] * 3]
    by_mae = as_compact([row(first, 0.010, 0.10), row(second, 0.012, 0.16)], metric="rel_mae")
    assert compact_lines(by_mae, 4000, "nonlinear", "LRU")[0][2] == "0.13 (0.1571) ×0.83"  # equal: not bold
    assert compact_lines(as_compact([row(mse=1.5)]), 4000, "nonlinear", "LRU")[0][2] == "*1.5 (0.0260) ×58*"


def test_compact_lines_name_what_the_start_was_given() -> None:
    def given(initialisation: str, **cell: Any) -> str:
        run = row(Cell(**({"tension_modulated": True, "initial": "gaussian", "rate_hz": 4000} | cell)))
        run = replace(run, initialisation=initialisation)
        name = {"koopman_integrated": "integrated phase", "dmd": "DMD", "koopman": "Koopman"}[cell["model"]]
        ((start, *_),) = compact_lines(as_compact([run]), 4000, "nonlinear", name)
        return start

    assert given("averaging", model="koopman_integrated") == "averaged equations"
    assert given(PHASES, model="koopman_integrated", recipe="blind") == "displacement only"
    assert given(PHASES, model="koopman_integrated", recipe="hinted") == "displacement only, hinted"
    assert given("least squares", model="dmd") == "fitted"
    assert given("paper", model="koopman", recipe="paper") == "random weights, paper's recipe"


def test_compact_tables_list_what_is_missing_and_what_went_wrong() -> None:
    a, b = seeds(2)
    found = as_compact([row(a), row(b, None, None, status="diverged")])
    assert compact_lines(found, 4000, "nonlinear", "LRU")[0][2].endswith("; 1 diverged")
    assert "- LRU, nonlinear string, 4000 frames: not Gaussian 16 kHz, Noise 4 kHz, Noise 16 kHz.\n" in found
    assert "- FRNN, linear string, 400 frames: no cell.\n" in found
    assert "FRNN, linear string, 4000" not in found  # as in the paper


def test_compact_tables_leave_out_long_runs_measured_over_400_frames() -> None:
    long = row(Cell("lru", True, "gaussian", 4000), rel_mse_400=0.0002, rel_mae_400=0.01)
    assert compact_lines(as_compact([long]), 4000, "nonlinear", "LRU")
    (none,) = compact_lines(as_compact([long]), 400, "nonlinear", "LRU")
    assert none == ["—", "0", "not run (0.0008)", "not run (0.0013)", "not run (0.0008)", "not run (0.0259)"]


def test_rows_of_a_trial_or_of_an_older_recipe_are_no_figures() -> None:
    a, b = seeds(2)
    rows = [row(a, 0.010), row(a, 0.9, digest="of a trial", finished="2999"), row(b, 0.2, digest="older")]
    assert (cell(rows)["rel_mse"], cell(rows)["seeds"]) == ("0.01", "1")
    assert "2 of 3 rows of the results file are not shown" in as_compact(rows)


def test_csv_has_every_cell_and_exact_figures() -> None:
    a, b = seeds(2)
    text = as_csv([row(a, 0.010, 0.10), row(b, 0.012, 0.16)])
    lines = records(text)
    assert len(lines) == len(COLUMNS) * 2 * (6 + 8)  # models with the integrated phase
    (ours,) = records(text, string="nonlinear", horizon="4000", model="lru", initial="gaussian", rate_hz="4000")
    assert float(ours["rel_mse"]) == pytest.approx(0.011)
    assert float(ours["rel_mse_std"]) == pytest.approx(0.002 / 2**0.5)
    assert (ours["seeds"], ours["mse_mark"], ours["mae_mark"], ours["trained"]) == ("2", "better", "equal", "4000")
    assert (ours["paper_rel_mse"], ours["paper_rel_mae_std"]) == ("0.026", "0.024")
    assert ours["runs"].split() == [a.name, b.name]
    (empty,) = records(text, string="linear", horizon="400", model="frnn", initial="noise", rate_hz="16000")
    assert (empty["seeds"], empty["rel_mse"], empty["mse_mark"]) == ("0", "", "not run")


def test_csv_reports_diverged_runs_without_a_mark() -> None:
    text = as_csv([row(mse=None, mae=None, status="diverged")])
    (found,) = records(text, diverged="1")
    assert (found["seeds"], found["rel_mse"], found["mse_mark"]) == ("0", "", "")
