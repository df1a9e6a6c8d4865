import csv
import io
from typing import Any

import pytest

from training.cell import Cell, configuration_of
from training.results import Row
from training.tables.compact import as_compact
from training.tables.paper import (
    COLUMNS,
    DatasetColumn,
    MeanFigure,
    factor,
    paper_errors,
)
from training.tables.tidy_csv import as_csv


def row(cell: Cell | None = None, mse: float | None = 0.01, mae: float | None = 0.1, **changes: Any) -> Row:
    """A row as a run of the cell makes it."""
    cell = cell or Cell("lru", True, "gaussian", 4000)
    of_cell = {name: getattr(cell, name) for name in ("model", "initial", "rate_hz", "horizon", "recipe", "seed")}
    facts = {"digest": configuration_of(cell).digest, "name": cell.name, "string": cell.string_kind, **of_cell}
    facts |= {"status": "done", "initialisation": "paper", "rel_mse": mse, "rel_mae": mae}
    return Row(**(facts | changes))


def seeds(count: int, **fields: Any) -> list[Cell]:
    fields = {"model": "lru", "tension_modulated": True, "initial": "gaussian", "rate_hz": 4000} | fields
    return [Cell(seed=seed, **fields) for seed in range(count)]


def records(text: str, **wanted: str) -> list[dict[str, str]]:
    return [entry for entry in csv.DictReader(io.StringIO(text)) if wanted.items() <= entry.items()]


def cell(rows: list[Row], **wanted: str) -> dict[str, str]:
    """The only line of the CSV that has these values, of the non-linear string at 4 kHz."""
    place = {"string": "nonlinear", "horizon": "4000", "model": "lru", "initial": "gaussian", "rate_hz": "4000"}
    (found,) = records(as_csv(rows), **{**place, **wanted})
    return found


A, B, C, D = seeds(4)
LONG, SHORT = Cell("lru", True, "gaussian", 4000), Cell("lru", True, "gaussian", 4000, 400)
OURS, PAPER = (Cell("koopman_var", True, "gaussian", 4000, recipe=recipe) for recipe in ("ours", "paper"))
DMD = Cell("dmd", True, "gaussian", 4000)
GONE: dict[str, Any] = {"mse": None, "mae": None}
OF_400 = {"rel_mse_400": 0.0002, "rel_mae_400": 0.01, "test_rel_mse_400": 0.0003, "rel_mse_400_se": 0.00001}
SOFT, LOUD = 0.02 - 0.0015 * 2**0.5, 0.02 + 0.0015 * 2**0.5
ENDS = [row(A), row(B, **GONE, status="diverged"), row(C, **GONE, status="diverged"), row(D, **GONE, status="failed")]
# √((0.003² + 0.005²) / 2): the seeds share their strings
BOTH = [row(A, SOFT, rel_mse_se=0.003), row(B, LOUD, rel_mse_se=0.005)]
TWO = [row(A, 0.010, 0.10), row(B, 0.012, 0.16)]
RECIPES = [row(OURS, 0.006, initialisation="physics"), row(PAPER, 0.020)]
APART = [row(LONG, test_rel_mse=0.9, **OF_400), row(SHORT, 0.0008, 0.02)]
TEST = [row(mse=0.005, mae=0.1, test_rel_mse=0.03, test_rel_mae=0.2, test_rel_mse_se=0.002)]
TRIAL = [row(A, 0.010), row(A, 0.9, digest="of a trial", finished="2999"), row(B, 0.2, digest="older")]
FITTED = [row(DMD, 1.0, 0.8, initialisation="least squares")]
CASES = [  # rows, the cell, and what it says
    ("a mean over seeds", TWO, "", "rel_mse=.011 rel_mse_std=.00141421 rel_mae_std=.0424264 seeds=2 trained=4000"),
    ("the paper's beside it", TWO, "", "paper_rel_mse=.026 paper_rel_mse_std=.0067 paper_rel_mae_std=.024"),
    ("marks", TWO, "", "mse_mark=better mae_mark=equal"),
    ("one seed has no deviation", [row(mse=5.123e-6, mae=1.5)], "", "rel_mse=5.123e-06 rel_mse_std= seeds=1"),
    ("the paper's is lower", [row(mse=5.123e-6, mae=1.5)], "", "mse_mark=better mae_mark=worse"),
    ("the test split", [row(A, test_rel_mse=0.01)], "", "test_rel_mse=0.01 test_mse_mark=better"),
    ("a seed that runs away there counts", [row(A, test_rel_mse=0.01), row(B)], "", "test_rel_mse="),
    ("the choice of strings has an error", [row(A, 0.02, rel_mse_se=0.005)], "", "rel_mse_se=0.005"),
    ("which counts beside the seeds", BOTH, "", "mse_mark=equal rel_mse_std=.003 rel_mse_se=.00412311"),
    ("marks of the test split", TEST, "", "mse_mark=better test_mse_mark=equal test_mae_mark=worse"),
    ("figures of the test split", TEST, "", "test_rel_mse=.03 test_rel_mse_se=.002 test_rel_mae_se="),
    ("runs that ended badly are counted", ENDS, "", "rel_mse=0.01 seeds=1 diverged=2 failed=1"),
    ("and have no figure", ENDS[1:3], "", "rel_mse= seeds=0 diverged=2"),
    ("prior knowledge has a line", RECIPES, "model=koopman_var structured=True", "mse_mark=equal"),
    ("a recipe too", RECIPES, "model=koopman_var recipe=paper", "mse_mark=worse structured=False"),
    ("a fit is no prior knowledge", FITTED, "model=dmd", "structured=False"),
    ("short runs", APART, "horizon=400 trained=400", "rel_mse=.0008"),
    ("long runs over 400 frames", APART, "horizon=400 trained=4000", "rel_mse=.0002 rel_mse_se=1e-05 rel_mae=.01"),
    ("their test split", APART, "horizon=400 trained=4000", "test_rel_mse=.0003 test_rel_mae="),
    ("long runs alone", [row(LONG)], "horizon=400", "seeds=0"),
    ("a trial and an older recipe are left out", TRIAL, "", "rel_mse=.01 seeds=1"),
    ("no run", TWO, "string=linear horizon=400 model=frnn initial=noise rate_hz=16000", "seeds=0 mse_mark=not_run"),
]


def fields(text: str) -> dict[str, str]:
    return dict(pair.replace("not_run", "not run").split("=") for pair in text.split(" "))


@pytest.mark.parametrize(("rows", "place", "expected"), [each[1:] for each in CASES], ids=[each[0] for each in CASES])
def test_a_cell_reports_its_rows(rows, place, expected):
    found = cell(rows, **fields(place) if place else {})
    for name, value in fields(expected).items():
        is_number = value[:1].isdigit() or value[:1] == "."
        assert float(found[name]) == pytest.approx(float(value), rel=1e-5) if is_number else found[name] == value


def test_csv_has_every_cell_and_is_of_a_recipe_where_one_is_asked_for():
    assert len(records(as_csv(TWO))) == len(COLUMNS) * 2 * (6 + 8)  # models with the integrated phase
    assert cell(TWO)["runs"].split() == [A.name, B.name]
    for recipe in ("ours", "paper"):
        lines = records(as_csv(RECIPES, recipe), model="koopman_var", seeds="1")
        assert [entry["recipe"] for entry in lines] == [recipe]


def compact_lines(text: str, horizon: int, string: str, model: str) -> list[list[str]]:
    """What follows string and model in a compact table's lines of them."""
    part = text.partition(f"### {horizon} frames")[2].partition("\n\n")[2].partition("\n\n")[0]
    cells = [[cell.strip() for cell in entry.strip("|").split(" | ")] for entry in part.splitlines()]
    return [entry[2:] for entry in cells if entry[:2] == [string, model]]


def test_compact_tables_list_what_is_missing_and_what_went_wrong_and_leave_long_runs_out_of_short_ones():
    found = as_compact([row(A), row(B, None, None, status="diverged")])
    assert compact_lines(found, 4000, "nonlinear", "LRU")[0][2].endswith("; 1 diverged")
    assert "- LRU, nonlinear string, 4000 frames: not Gaussian 16 kHz, Noise 4 kHz, Noise 16 kHz.\n" in found
    assert "- FRNN, linear string, 400 frames: no cell.\n" in found
    assert "FRNN, linear string, 4000" not in found  # as in the paper
    assert compact_lines(found, 4000, "nonlinear", "LRU")[0][:2] == ["random weights", "1"]
    assert "2 of 3 rows of the results file are not shown" in as_compact(TRIAL)
    long = row(LONG, rel_mse_400=0.0002, rel_mae_400=0.01)
    assert compact_lines(as_compact([long]), 4000, "nonlinear", "LRU")
    (none,) = compact_lines(as_compact([long]), 400, "nonlinear", "LRU")
    assert none == ["—", "0", "not run (0.0008)", "not run (0.0013)", "not run (0.0008)", "not run (0.0259)"]


@pytest.mark.parametrize(
    ("string", "horizon", "model", "column", "mse", "mae"),
    [
        ("nonlinear", 4000, "dmd", ("noise", 16000), (1.8313, 0.2467), (1.0953, 0.087)),
        ("nonlinear", 4000, "koopman_var", ("gaussian", 4000), (0.0113, 0.0061), (0.0977, 0.0284)),
        ("nonlinear", 400, "koopman_var", ("gaussian", 16000), (0.0003, 0.0), (0.0201, 0.0006)),
        ("nonlinear", 400, "frnn", ("noise", 4000), (0.7289, 0.0653), (0.8553, 0.0495)),
        ("linear", 4000, "koopman_var", ("noise", 16000), (0.0495, 0.0973), (0.1125, 0.1785)),
        ("linear", 4000, "dmd", ("gaussian", 4000), (0.0, 0.0), (0.006, 0.0007)),
        ("linear", 400, "fgru", ("gaussian", 16000), (0.0378, 0.0162), (0.214, 0.0551)),
        ("linear", 400, "frnn", ("noise", 16000), (0.4730, 0.3205), (0.6347, 0.2836)),
    ],
)
def test_figures_of_the_paper(string, horizon, model, column, mse, mae):
    figures = paper_errors()
    assert len(figures) == 2 * 12 * 4  # strings, rows, data sets
    entry = figures[string, horizon, model, DatasetColumn(*column)]
    assert (entry.rel_mse, entry.rel_mae) == (MeanFigure(*mse), MeanFigure(*mae))


def test_a_figure_may_be_off_by_both_of_its_errors_and_its_ratio_is_one_of_printed_figures():
    assert MeanFigure(1.0).total is None
    assert MeanFigure(1.0, 0.3).total == MeanFigure(1.0, None, 0.3).total == 0.3
    assert MeanFigure(1.0, 0.3, 0.4).total == pytest.approx(0.5)
    assert factor(MeanFigure(5.65e-6), MeanFigure(0.0113)) == "×0.0005"
    assert factor(MeanFigure(1.0), MeanFigure(0.004)) == "×250"
    assert factor(MeanFigure(5e-6), MeanFigure(0.0)) == "> ×0.1"
