"""The tables in full as Markdown: means, deviations and test split, with the paper's figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial

from engine.metrics import RESAMPLES
from training.cell import MODEL_NAMES
from training.results import Row
from training.tables.paper import COLUMNS, HORIZONS, METRICS, PRINTED, Column, Figure, factor, mark, paper_errors
from training.tables.sections import NO_ERRORS, NOT_RUN, Line, RecipeChoice, Section, rows_of, sections

NONE = "—"
TEST = "… test split"
TITLES = {"linear": "Linear string", "nonlinear": "Non-linear (tension-modulated) string"}
LEGEND = f"""\
Relative errors, sums over all trajectories of a split divided by sums, as `mean (deviation)`. Lower is better. Lines
of ours are of the **validation** set, as the paper's; it chose the weights and the recipes. The line **test split**
below each is of the same models on the test set, which chose nothing. **The paper**'s lines are its Table 3 as
printed (5 seeds, validation; DMD's deviations are over the errors of single trajectories).

- **deviation**, of ours: √(s² + b²). s is the standard deviation over seeds, where there is more than one. b is the
  standard error over the strings of the split, the bootstrap over its 100 trajectories (as many drawn with
  replacement, {RESAMPLES} times; of several seeds the root of the mean square). **No brackets**: one seed, and b is
  not known, because its preset was not kept; the words beside it know the paper's deviation alone.
- **better**, **worse**: than the paper's figure of the same model, by more than √(our deviation² + the paper's²), at
  least {PRINTED:g}, to which the paper's figures are printed. **equal**: within it. The paper does not tell its b.
- **{NOT_RUN}**: there is no run of ours. **{NONE}**: there is no such figure.
- **diverged (n of m seeds)**: these runs ended without a model; the figure beside it is of the others.
- **prior knowledge**: training started from what is known of the string (its modes and eigenvalues, or averaged
  equations), which the paper's models do not have. Lines without these words are black boxes as in the paper.
- **§**: hints. Training used that a string may be mirrored and its sign turned; by the recipe `hinted` the integrated
  phase was given the number of modes, too. The recipe `blind` has neither.
- **our best**: the lowest validation error of our learned models (DMD is fitted, not learned) as a multiple of the
  paper's best in that column, of any model. `> ×` where the paper's best is printed as 0.0000, and thus below
  {PRINTED:g}."""
SHORT_LEGEND = """\
- **trained on 4000 frames** ‡: runs of the table above, measured over their first 400 frames. The others were trained
  on 400 frames, as the paper's."""


def as_markdown(rows: Sequence[Row], recipe: RecipeChoice = "all") -> str:
    """All tables with their legend."""
    found = sections(rows, recipe)
    parts = [LEGEND + "\n" + SHORT_LEGEND]
    for section in found:
        if section.horizon == HORIZONS[0]:
            parts.append(f"## {TITLES[section.string]}")
        parts.append(f"### {section.horizon} frames")
        parts.append(markdown_table(*_table(section)))
    if out := len(rows) - len(rows_of(found)):
        parts.append(
            f"{out} of {len(rows)} rows of the results file are not shown: of other data, another horizon or recipe, "
            "a trial, or made by a recipe that has changed since."
        )
    return "\n\n".join(parts) + "\n"


def _table(section: Section) -> tuple[list[str], list[list[str]]]:
    names = {"rel_mse": "MSE", "rel_mae": "MAE"}
    head = ["model", "run", *(f"{column} {names[metric]}" for column in COLUMNS for metric in METRICS)]
    table = []
    for model in section.models:
        if any(key[:3] == (*section.place, model) for key in paper_errors()):
            table.append(_line_of(model, "**the paper**", partial(_paper_cell, section, model)))
        lines = [line for line in section.lines if line.model == model]
        if not lines:
            table.append(_line_of(model, NOT_RUN, lambda column, metric: NOT_RUN))
        for line in lines:
            label = line.label
            if line.trained != section.horizon:
                label += f", trained on {line.trained} frames ‡"
            table.append(_line_of(model, label, partial(_cell, section, line)))
            if any(entry.test != NO_ERRORS for entry in section.lines[line].values()):
                table.append(_line_of(model, TEST, partial(_test_cell, section, line)))
    table.append(["**paper's best**", "", *_each(partial(_paper_best, section))])
    for structured, words in ((False, "black box"), (True, "prior knowledge")):
        table.append(["**our best**", words, *_each(partial(_best, section, structured))])
    return head, table


def _line_of(model: str, label: str, cell: Callable[[Column, str], str]) -> list[str]:
    return [MODEL_NAMES[model], label, *_each(cell)]


def _each(cell: Callable[[Column, str], str]) -> list[str]:
    return [cell(column, metric) for column in COLUMNS for metric in METRICS]


def _paper_cell(section: Section, model: str, column: Column, metric: str) -> str:
    figure = section.paper(model, column, metric)
    return f"{figure.mean:.4f} ({figure.deviation:.4f})" if figure else NONE


def _cell(section: Section, line: Line, column: Column, metric: str) -> str:
    entry = section.lines[line].get(column)
    if entry is None:
        return NOT_RUN
    parts, figure = [], entry.figure(metric)
    if figure is not None:
        paper = section.paper(line.model, column, metric)
        parts.append(f"{_words(figure, paper)}, {_seeds(len(entry.done))}")
    for rows, words in ((entry.diverged, "diverged"), (entry.failed, "failed")):
        if rows:
            parts.append(f"{words} ({len(rows)} of {_seeds(len(entry.rows))})")
    return "; ".join(parts)


def _test_cell(section: Section, line: Line, column: Column, metric: str) -> str:
    entry = section.lines[line].get(column)
    figure = entry.test.figure(metric) if entry else None
    return _words(figure, section.paper(line.model, column, metric)) if figure else NONE


def _words(figure: Figure, paper: Figure | None) -> str:
    deviation = "" if figure.total is None else f" ({figure.total:.2g})"
    against = "" if paper is None else f" **{mark(figure, paper)}**"
    return f"{figure.mean:.3g}{deviation}{against}"


def _seeds(count: int) -> str:
    return f"{count} seed" if count == 1 else f"{count} seeds"


def _paper_best(section: Section, column: Column, metric: str) -> str:
    model, figure = section.paper_best(column, metric)
    return f"{figure.mean:.4f} {MODEL_NAMES[model]}"


def _best(section: Section, structured: bool, column: Column, metric: str) -> str:
    found = section.best(column, metric, structured)
    if found is None:
        return NOT_RUN
    line, figure = found
    recipe = "" if line.recipe == "ours" else f" ({line.recipe} recipe)"
    return f"**{factor(figure, section.paper_best(column, metric)[1])}** {MODEL_NAMES[line.model]}{recipe}"


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table whose cells are padded to the width of their column."""
    table = [[cell.replace("|", "\\|") for cell in row] for row in (head, *rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |" for row in table]
    lines.insert(1, "|" + "|".join("-" * (w + 2) for w in widths) + "|")
    return "\n".join(lines)
