"""The tables as tidy CSV, to be computed with: a line a cell."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from engine.table import columns_of, texts_of
from training.results import Row
from training.tables.paper import COLUMNS, METRICS, Column, mark
from training.tables.sections import NOT_RUN, Entry, Line, RecipeChoice, Section, sections


@dataclass(frozen=True)
class Record:
    """A line of the CSV: a line's or the paper's cell, both metrics. What is not there is None, and empty.

    Attributes:
        trained: see `Line`.
        seeds: runs behind the figures; 0 where nothing was run.
        mse_mark …: of the validation figure against the paper's; test_… of the test split's.
        rel_mse_std …: over seeds; rel_mse_se …: by which trajectories are in the split; see `Figure`.
        runs: their names, separated by spaces, with those that diverged or failed.
    """

    string: str
    horizon: int
    model: str
    recipe: str
    initialisation: str
    structured: bool | None
    trained: int | None
    initial: str
    rate_hz: int
    seeds: int
    diverged: int
    failed: int
    mse_mark: str
    mae_mark: str
    test_mse_mark: str
    test_mae_mark: str
    runs: str
    rel_mse: float | None = None
    rel_mse_std: float | None = None
    rel_mse_se: float | None = None
    rel_mae: float | None = None
    rel_mae_std: float | None = None
    rel_mae_se: float | None = None
    test_rel_mse: float | None = None
    test_rel_mse_std: float | None = None
    test_rel_mse_se: float | None = None
    test_rel_mae: float | None = None
    test_rel_mae_std: float | None = None
    test_rel_mae_se: float | None = None
    paper_rel_mse: float | None = None
    paper_rel_mse_std: float | None = None
    paper_rel_mae: float | None = None
    paper_rel_mae_std: float | None = None


def as_csv(rows: Sequence[Row], recipe: RecipeChoice = "all") -> str:
    """All tables as tidy data: a line for every cell, run or not; see `Record`."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(columns_of(Record))
    for section in sections(rows, recipe):
        for model in section.models:
            lines: list[Line | None] = [line for line in section.lines if line.model == model]
            for line in lines or [None]:
                for column in COLUMNS:
                    writer.writerow(texts_of(_record(section, model, line, column)))
    return file.getvalue()


def _record(section: Section, model: str, line: Line | None, column: Column) -> Record:
    entry = section.lines[line].get(column) if line else None
    found = entry or Entry(None, None)
    figures: dict[str, Any] = {}
    for metric in METRICS:
        paper = section.paper(model, column, metric)
        figures |= {f"paper_{metric}": paper.mean, f"paper_{metric}_std": paper.deviation} if paper else {}
        for prefix, errors in (("", found), ("test_", found.test)):
            ours, name = errors.figure(metric), f"{prefix}{metric}"
            if ours:
                figures |= {name: ours.mean, f"{name}_std": ours.deviation, f"{name}_se": ours.split}
            against = mark(ours, paper) if ours and paper else "" if found.rows else NOT_RUN
            figures[name.replace("rel_", "") + "_mark"] = against
    return Record(
        string=section.string,
        horizon=section.horizon,
        model=model,
        recipe=line.recipe if line else "",
        initialisation=line.initialisation if line else "",
        structured=line.structured if line else None,
        trained=line.trained if line else None,
        initial=column.initial,
        rate_hz=column.rate_hz,
        seeds=len(found.done),
        diverged=len(found.diverged),
        failed=len(found.failed),
        runs=" ".join(row.name for row in found.rows),
        **figures,
    )
