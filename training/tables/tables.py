"""The paper's tables with our figures beside its own: who is better, what was not run, and which runs made a figure.

The paper's figures are `paper_tables.csv`, as printed: Diaz, De La Vega Martin, Sandler, "Towards Efficient Modelling
of String Dynamics", DAFx24, Table 3a (nonlinear) and 3b (linear): means and standard deviations over 5 seeds on the
validation set, for DMD deviations over its trajectories. Ours are rows of the results file.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from functools import cache, partial
from pathlib import Path
from statistics import fmean, stdev
from typing import Literal, NamedTuple

from engine.schema import SchemaError
from training.by_name import load
from training.cell import HORIZON, MODEL_NAMES
from training.configuration import TrainingConfiguration
from training.results import SHORT_HORIZON, Row

PAPER = Path(__file__).parent / "paper_tables.csv"
PRINTED = 5e-5  # the paper prints four decimals: no figure of it is known better
STRINGS = ("linear", "nonlinear")
HORIZONS = (HORIZON, SHORT_HORIZON)
METRICS = ("rel_mse", "rel_mae")
MODEL_ORDER = ("dmd", "koopman", "koopman_var", "lru", "s5", "fgru", "frnn", "koopman_integrated")
NOT_RUN = "not run"
NONE = "—"

RecipeChoice = Literal["ours", "paper", "all"]
Mark = Literal["better", "worse", "equal"]


class Column(NamedTuple):
    """A data set of the tables."""

    initial: str
    rate_hz: int

    def __str__(self) -> str:
        return f"{self.initial.capitalize()} {self.rate_hz // 1000} kHz"


COLUMNS = tuple(Column(initial, rate_hz) for initial in ("gaussian", "noise") for rate_hz in (4000, 16000))


class Figure(NamedTuple):
    """A mean and its standard deviation, None where a single run has none."""

    mean: float
    deviation: float | None = None


@dataclass(frozen=True)
class Line:
    """A row of a table: a model, and what its runs have in common.

    Attributes:
        initialisation: "" where it is no choice (DMD is fitted).
        structured: whether it started from prior knowledge of the string; see `Row.structured`.
        trained: frames that its runs were trained on; more than the table's where their first frames are measured.
    """

    model: str
    recipe: str
    initialisation: str
    structured: bool
    trained: int

    @property
    def label(self) -> str:
        """What is said of it beside the model's name."""
        words = f"{self.recipe} recipe" if self.recipe != "ours" else "our recipe"
        if self.structured:
            words += f", prior knowledge ({self.initialisation})"
        return words


@dataclass(frozen=True)
class Entry:
    """What was found in a cell: a figure of each metric, None where no run has one, and the runs behind them."""

    rel_mse: Figure | None
    rel_mae: Figure | None
    done: tuple[Row, ...] = ()
    diverged: tuple[Row, ...] = ()
    failed: tuple[Row, ...] = ()

    @property
    def rows(self) -> tuple[Row, ...]:
        return (*self.done, *self.diverged, *self.failed)

    def figure(self, metric: str) -> Figure | None:
        return self.rel_mse if metric == "rel_mse" else self.rel_mae


@dataclass(frozen=True)
class Section:
    """A table: one kind of string and one horizon. A line without an entry in a column was not run there."""

    string: str
    horizon: int
    lines: dict[Line, dict[Column, Entry]]

    @property
    def models(self) -> list[str]:
        """The models with a line of ours or of the paper, in the paper's order."""
        ours = {line.model for line in self.lines}
        theirs = {model for string, horizon, model, *_ in paper_figures() if (string, horizon) == self.place}
        # the integrated phase is the question: it stands there even where nothing was run
        return [model for model in MODEL_ORDER if model in ours | theirs | {"koopman_integrated"}]

    @property
    def place(self) -> tuple[str, int]:
        return self.string, self.horizon

    def paper(self, model: str, column: Column, metric: str) -> Figure | None:
        """What the paper has there; None where it has nothing."""
        found = paper_figures().get((self.string, self.horizon, model, column))
        return found.figure(metric) if found else None

    def paper_best(self, column: Column, metric: str) -> tuple[str, Figure]:
        """The model of the paper with the lowest mean, and its figure; the first of equals in the paper's order."""
        found = [(model, self.paper(model, column, metric)) for model in MODEL_ORDER]
        return min(((model, figure) for model, figure in found if figure), key=lambda pair: pair[1].mean)

    def best(self, column: Column, metric: str, structured: bool) -> tuple[Line, Figure] | None:
        """Our learned model (DMD is fitted) with the lowest mean, with prior knowledge or without."""
        lines = [line for line in self.lines if line.model != "dmd" and line.structured == structured]
        found = [(line, entry.figure(metric)) for line in lines if (entry := self.lines[line].get(column))]
        return min(((line, figure) for line, figure in found if figure), key=lambda pair: pair[1].mean, default=None)


@cache
def paper_figures() -> dict[tuple[str, int, str, Column], Entry]:
    """All that the paper has, by string, horizon, model and column."""
    found = {}
    with PAPER.open(newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            mse, mae = (Figure(float(line[metric]), float(line[f"{metric}_std"])) for metric in METRICS)
            column = Column(line["initial"], int(line["rate_hz"]))
            found[line["string"], int(line["horizon"]), line["model"], column] = Entry(mse, mae)
    return found


def mark(ours: Figure, paper: Figure) -> Mark:
    """Equal: within one standard deviation, the larger of the two, and never finer than the paper prints."""
    tolerance = max(ours.deviation or 0.0, paper.deviation or 0.0, PRINTED) * (1 + 1e-9)
    if abs(ours.mean - paper.mean) <= tolerance:
        return "equal"
    return "better" if ours.mean < paper.mean else "worse"


def factor(ours: Figure, paper: Figure) -> str:
    """Our mean as a multiple of the paper's, "×0.0005"; "> ×0.1" where the paper's is printed as 0.0000."""
    times = ours.mean / (paper.mean or PRINTED)
    text = f"{times:.2g}" if times < 100 else f"{times:.0f}"
    return f"×{text}" if paper.mean > 0 else f"> ×{text}"


def sections(rows: Iterable[Row], recipe: RecipeChoice = "all") -> list[Section]:
    """The tables of the rows that belong to them, by string and horizon.

    A row counts as long as its name means the configuration that it was made with: rows of a trial, and of a recipe
    that has changed since, are another thing.
    """
    chosen = [row for row in rows if recipe in ("all", row.recipe) and configuration_of(row) is not None]
    return [_section(chosen, string, horizon) for string in STRINGS for horizon in HORIZONS]


def rows_of(found: Iterable[Section]) -> list[Row]:
    """Every row behind the figures of these tables, once, by name."""
    rows = {row for s in found for entries in s.lines.values() for entry in entries.values() for row in entry.rows}
    return sorted(rows, key=lambda row: (row.name, row.digest))


def configuration_of(row: Row) -> TrainingConfiguration | None:
    """The configuration of a row's run, by its name; None where the name means another one by now, or none."""
    try:
        configuration = load(row.name)
    except SchemaError:
        return None
    return configuration if configuration.digest == row.digest else None


def _section(rows: Sequence[Row], string: str, horizon: int) -> Section:
    gathered: dict[Line, dict[Column, dict[int, Row]]] = {}
    for row in rows:
        column = Column(row.initial, row.rate_hz)
        if row.string != string or column not in COLUMNS or not _is_measured(row, horizon):
            continue
        gathered.setdefault(_line(row), {}).setdefault(column, {})[row.seed] = row
    order = sorted(gathered, key=lambda line: (MODEL_ORDER.index(line.model), line.structured, *astuple(line)))
    lines = {
        line: {c: _entry(list(seeds.values()), horizon) for c, seeds in gathered[line].items()} for line in order
    }
    # a run over the long horizon that ended without a figure says nothing of the short one
    lines = {
        line: entries
        for line, entries in lines.items()
        if line.trained == horizon or any(entry.rel_mse for entry in entries.values())
    }
    return Section(string, horizon, lines)


def _is_measured(row: Row, horizon: int) -> bool:
    if row.horizon == horizon:
        return True
    if horizon != SHORT_HORIZON or row.horizon != HORIZON:
        return False
    return row.status != "done" or row.rel_mse_400 is not None


def _line(row: Row) -> Line:
    how = "" if row.model == "dmd" else row.initialisation  # fitted: an initialisation is asked of it by nobody
    return Line(row.model, row.recipe, how, row.structured, row.horizon)


def _entry(rows: Sequence[Row], horizon: int) -> Entry:
    rows = sorted(rows, key=lambda row: row.seed)
    done, diverged, failed = (
        tuple(row for row in rows if row.status == status) for status in ("done", "diverged", "failed")
    )
    mse, mae = (_figure(done, metric, horizon) for metric in METRICS)
    return Entry(mse, mae, done, diverged, failed)


def _figure(rows: Sequence[Row], metric: str, horizon: int) -> Figure | None:
    name = metric if all(row.horizon == horizon for row in rows) else f"{metric}_{SHORT_HORIZON}"
    values: list[float] = [value for row in rows if (value := getattr(row, name)) is not None]
    if not values:
        return None
    if len(values) > 1:
        return Figure(fmean(values), stdev(values) if all(map(math.isfinite, values)) else None)
    # as the paper's for DMD, which knows no seeds
    spread = getattr(rows[0], f"{metric}_spread") if name == metric and rows[0].model == "dmd" else None
    return Figure(values[0], spread)


# ---- Markdown ----

TITLES = {"linear": "Linear string", "nonlinear": "Non-linear (tension-modulated) string"}
LEGEND = f"""\
Relative errors on the validation set, sums over all its trajectories divided by sums, as `mean (standard deviation)`:
over seeds, for DMD over the errors of the single trajectories. Lower is better. **The paper**'s lines are the figures
of its Table 3 as printed (5 seeds).

- **better**, **worse**: than the paper's figure of the same model, by more than one standard deviation (the larger of
  the two; at least {PRINTED:g}, to which the paper's figures are printed). **equal**: within it.
- **{NOT_RUN}**: there is no run of ours. **{NONE}**: the paper has no figure.
- **diverged (n of m seeds)**: these runs ended without a model; the figure beside it is of the others.
- **prior knowledge**: training started from what is known of the string (its eigenvalues, or averaged equations),
  which the paper's models do not have. Lines without these words are black boxes as in the paper.
- **our best**: the lowest error of our learned models (DMD is fitted, not learned) as a multiple of the paper's best
  in that column, of any model. `> ×` where the paper's best is printed as 0.0000, and thus below {PRINTED:g}."""
SHORT_LEGEND = """\
- **trained on 4000 frames** ‡: runs of the table above, measured over their first 400 frames. The others were trained
  on 400 frames, as the paper's."""


def as_markdown(rows: Sequence[Row], recipe: RecipeChoice = "all", listing: bool = False) -> str:
    """All tables, with what their words mean; `listing` adds the runs behind them."""
    found = sections(rows, recipe)
    parts = [LEGEND + "\n" + SHORT_LEGEND]
    for section in found:
        if section.horizon == HORIZONS[0]:
            parts.append(f"## {TITLES[section.string]}")
        parts.append(f"### {section.horizon} frames")
        parts.append(_markdown_table(*_table(section)))
    used = rows_of(found)
    if out := len(rows) - len(used):
        parts.append(
            f"{out} of {len(rows)} rows of the results file are not shown: of other data, another horizon or recipe, "
            "a trial, or made by a recipe that has changed since."
        )
    if listing:
        parts += ["## Runs", _markdown_table(*_listing(used))]
    return "\n\n".join(parts) + "\n"


def _table(section: Section) -> tuple[list[str], list[list[str]]]:
    names = {"rel_mse": "MSE", "rel_mae": "MAE"}
    head = ["model", "run", *(f"{column} {names[metric]}" for column in COLUMNS for metric in METRICS)]
    table = []
    for model in section.models:
        if any(key[:3] == (*section.place, model) for key in paper_figures()):
            table.append(_line_of(model, "**the paper**", partial(_paper_cell, section, model)))
        lines = [line for line in section.lines if line.model == model]
        if not lines:
            table.append(_line_of(model, NOT_RUN, lambda column, metric: NOT_RUN))
        for line in lines:
            label = line.label
            if line.trained != section.horizon:
                label += f", trained on {line.trained} frames ‡"
            table.append(_line_of(model, label, partial(_cell, section, line)))
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
        words = f"{figure.mean:.3g}"
        if figure.deviation is not None:
            words += f" ({figure.deviation:.2g})"
        if paper is not None:
            words += f" **{mark(figure, paper)}**"
        parts.append(f"{words}, {_seeds(len(entry.done))}")
    for rows, words in ((entry.diverged, "diverged"), (entry.failed, "failed")):
        if rows:
            parts.append(f"{words} ({len(rows)} of {_seeds(len(entry.rows))})")
    return "; ".join(parts)


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


def _listing(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    head = ["run", "seed", "status", "rel. MSE", "rel. MAE", "digest", "commit", "hardware", "seconds", "repeated by"]
    return head, [
        [
            row.name,
            str(row.seed),
            row.status,
            *(NONE if value is None else f"{value:.8g}" for value in (row.rel_mse, row.rel_mae)),
            row.digest,
            row.commit or NONE,
            row.hardware or NONE,
            NONE if row.seconds is None else f"{row.seconds:.0f}",
            f"`learned-strings train {row.name}`",
        ]
        for row in rows
    ]


def _markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Cells padded to their column's width: a table that can be read as text, too."""
    table = [[cell.replace("|", "\\|") for cell in row] for row in (head, *rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |" for row in table]
    lines.insert(1, "|" + "|".join("-" * (w + 2) for w in widths) + "|")
    return "\n".join(lines)


# ---- CSV ----


@dataclass(frozen=True)
class Record:
    """A line of the CSV: a line's or the paper's cell, both metrics. What is not there is None, and empty.

    Attributes:
        trained: see `Line`.
        seeds: runs behind the figures; 0 where nothing was run.
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
    runs: str
    rel_mse: float | None = None
    rel_mse_std: float | None = None
    rel_mae: float | None = None
    rel_mae_std: float | None = None
    paper_rel_mse: float | None = None
    paper_rel_mse_std: float | None = None
    paper_rel_mae: float | None = None
    paper_rel_mae_std: float | None = None


def as_csv(rows: Sequence[Row], recipe: RecipeChoice = "all") -> str:
    """All tables as tidy data: a line for every cell, run or not; see `Record`."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([field.name for field in fields(Record)])
    for section in sections(rows, recipe):
        for model in section.models:
            lines: list[Line | None] = [line for line in section.lines if line.model == model]
            for line in lines or [None]:
                for column in COLUMNS:
                    record = _record(section, model, line, column)
                    writer.writerow(["" if value is None else value for value in astuple(record)])
    return file.getvalue()


def _record(section: Section, model: str, line: Line | None, column: Column) -> Record:
    entry = section.lines[line].get(column) if line else None
    found = entry or Entry(None, None)
    figures: dict[str, float | None] = {}
    marks = []
    for metric in METRICS:
        ours, paper = found.figure(metric), section.paper(model, column, metric)
        for name, figure in ((metric, ours), (f"paper_{metric}", paper)):
            figures |= {name: figure.mean, f"{name}_std": figure.deviation} if figure else {}
        marks.append(mark(ours, paper) if ours and paper else "" if found.rows else NOT_RUN)
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
        mse_mark=marks[0],
        mae_mark=marks[1],
        runs=" ".join(row.name for row in found.rows),
        **figures,
    )
