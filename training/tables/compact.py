"""The table of each horizon as Markdown: our error, the paper's, their ratio, and where training starts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from training.cell import MODEL_NAMES
from training.results import Row
from training.tables.paper import COLUMNS, HORIZONS, DatasetColumn, MeanFigure, factor, mark
from training.tables.sections import NOT_RUN, Section, TableLine, rows_of, sections

NONE = "—"
METRIC_NAMES = {"rel_mse": "MSE", "rel_mae": "MAE"}
LEGEND = """\
Each cell is our relative {metric} on the validation split, the paper's in brackets, and their ratio. The paper's are
means of five seeds (its Table 3). **Bold** is better and *italic* worse than the paper, by more than both deviations
together; the others are equal. {none}: the paper has no such model."""
STARTS = {"physics": "linear string", "matching pursuit": "modes of the string", "averaging": "averaged equations"}
RECIPE_WORDS = {"paper": ", paper's recipe", "published": ", authors' script"}


def as_compact(rows: Sequence[Row], recipe: str = "all", metric: str = "rel_mse") -> str:
    """The tables of one metric, a line per model and recipe that was trained on the table's own horizon."""
    all_sections = sections(rows, recipe)
    parts = [LEGEND.format(metric=METRIC_NAMES[metric], none=NONE)]
    for horizon in HORIZONS:
        shown = [section for section in all_sections if section.horizon == horizon]
        parts.append(f"### {horizon} frames, relative {METRIC_NAMES[metric]}")
        head = ["string", "model", "training starts from", "seeds", *map(str, COLUMNS)]
        parts.append(markdown_table(head, [line for section in shown for line in _lines(section, metric)]))
    parts.append("### Missing cells\n\n" + _missing(all_sections))
    if out := len(rows) - len(rows_of(all_sections)):
        parts.append(
            f"{out} of {len(rows)} rows of the results file are not shown: other data, another horizon or recipe, "
            "a trial, or a recipe that has changed since."
        )
    return "\n\n".join(parts) + "\n"


def given(line: TableLine) -> str:
    """The knowledge of the string that a line's runs started from, in words."""
    if line.model == "dmd":
        return "fitted"
    words = STARTS.get(line.initialisation, line.initialisation) if line.structured else "displacement only"
    if line.initialisation == "paper":
        words = "random weights"
    words += RECIPE_WORDS.get(line.recipe, "")
    return f"{words}, hinted" if line.hints else words


def own_lines(section: Section) -> list[TableLine]:
    """The lines of a section that were trained on its own horizon, by model."""
    same_horizon = [line for line in section.lines if line.trained == section.horizon]
    return [line for model in section.models for line in same_horizon if line.model == model]


def _lines(section: Section, metric: str) -> list[list[str]]:
    """The rows of a section as text: string, model, start, seeds, then a cell for each of `COLUMNS`."""
    table = []
    for model in section.models:
        lines: list[TableLine | None] = [line for line in own_lines(section) if line.model == model]
        for line in lines or [None]:
            head = [section.string, MODEL_NAMES[model], given(line) if line else NONE, _seeds(section, line)]
            table.append([*head, *(_cell(section, model, line, column, metric) for column in COLUMNS)])
    return table


def _seeds(section: Section, line: TableLine | None) -> str:
    """The number of seeds that are done, or "1 to 5" where cells differ; None: nothing was run."""
    counts = sorted({len(entry.done) for entry in section.lines[line].values()}) if line else [0]
    return str(counts[0]) if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"


def _cell(section: Section, model: str, line: TableLine | None, column: DatasetColumn, metric: str) -> str:
    """The text of a cell: ours, the paper's and their ratio, and runs that ended without errors; None: not run."""
    paper = section.paper(model, column, metric)
    if line is None and paper is not None:
        return f"{NOT_RUN} ({paper.mean:.4f})"
    entry = section.lines[line].get(column) if line else None
    if entry is None:
        return NOT_RUN
    ours = entry.figure(metric)
    parts = [] if ours is None else [_against(ours, paper)]
    for rows, words in ((entry.diverged, "diverged"), (entry.failed, "failed")):
        if rows:
            parts.append(f"{len(rows)} {words}")
    return "; ".join(parts)


def _against(ours: MeanFigure, paper: MeanFigure | None) -> str:
    """The text of a figure of ours with the paper's, bold or italic; None: the paper has none."""
    if paper is None:
        return f"{ours.mean:.2g} ({NONE})"
    words = f"{ours.mean:.2g} ({paper.mean:.4f}) {factor(ours, paper)}"
    return {"better": f"**{words}**", "worse": f"*{words}*", "equal": words}[mark(ours, paper)]


def _missing(all_sections: Sequence[Section]) -> str:
    """The models and data sets without a run on their own horizon."""
    lines = []
    for section in all_sections:
        for model in section.models:
            of_model = [line for line in own_lines(section) if line.model == model]
            ran = {column for line in of_model for column in section.lines[line]}
            if left := [str(column) for column in COLUMNS if column not in ran]:
                where = "no cell" if not ran else "not " + ", ".join(left)
                lines.append(f"- {MODEL_NAMES[model]}, {section.string} string, {section.horizon} frames: {where}.")
    return "\n".join(lines) or "None."


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table whose cells are padded to the width of their column."""
    table = [[cell.replace("|", "\\|") for cell in row] for row in (head, *rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |" for row in table]
    lines.insert(1, "|" + "|".join("-" * (w + 2) for w in widths) + "|")
    return "\n".join(lines)
