"""The tables as tidy CSV, to be computed with: a line a cell."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

from training.results import Row
from training.tables.paper import COLUMNS, METRICS, DatasetColumn, mark
from training.tables.sections import NOT_RUN, Section, TableEntry, TableLine, sections


def as_csv(rows: Sequence[Row], recipe: str = "all") -> str:
    """All tables as tidy data: a line for every cell, run or not, with our figures and the paper's."""
    records = [
        _record(section, model, line, column)
        for section in sections(rows, recipe)
        for model in section.models
        for line in _lines(section, model)
        for column in COLUMNS
    ]
    file = io.StringIO()
    writer = csv.DictWriter(file, records[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return file.getvalue()


def _lines(section: Section, model: str) -> Sequence[TableLine | None]:
    """The lines of a model; a single None where nothing was run."""
    return [line for line in section.lines if line.model == model] or [None]


def _record(section: Section, model: str, line: TableLine | None, column: DatasetColumn) -> dict[str, Any]:
    """The columns of a cell by name; None, which is empty, for what is not there.

    trained: see `TableLine`. seeds: runs behind the figures; 0 where none was run. mse_mark …: of validation
    against the paper's; test_… of the test split's. runs: their names, separated by spaces, with those that diverged
    or failed. rel_mse_std …: over seeds; rel_mse_se …: over the trajectories of the split; see `MeanFigure`.
    """
    entry = (section.lines[line].get(column) if line else None) or TableEntry(None, None)
    marks: dict[str, Any] = {}
    figures: dict[str, Any] = {}
    for prefix, errors in (("", entry), ("test_", entry.test)):
        for metric in METRICS:
            ours = errors.figure(metric)
            paper = section.paper(model, column, metric)
            name = f"{prefix}{metric}"
            figures[name], figures[f"{name}_std"], figures[f"{name}_se"] = ours or (None, None, None)
            against = mark(ours, paper) if ours and paper else "" if entry.rows else NOT_RUN
            marks[name.replace("rel_", "") + "_mark"] = against
    for metric in METRICS:
        paper = section.paper(model, column, metric)
        figures |= {f"paper_{metric}": paper and paper.mean, f"paper_{metric}_std": paper and paper.deviation}
    of_line = ("recipe", "initialisation", "structured", "trained")
    return {
        "string": section.string,
        "horizon": section.horizon,
        "model": model,
        **{name: getattr(line, name, None) for name in of_line},
        "initial": column.initial,
        "rate_hz": column.rate_hz,
        "seeds": len(entry.done),
        "diverged": len(entry.diverged),
        "failed": len(entry.failed),
        **marks,
        "runs": " ".join(row.name for row in entry.rows),
        **figures,
    }
