"""Our figures in the paper's tables: rows of the results file, gathered by string, horizon, model and data set."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from statistics import fmean, stdev

from engine.schema import SchemaError
from training.cell import HORIZON, load
from training.configuration import TrainingConfiguration
from training.results import SHORT_HORIZON, Row
from training.tables.paper import (
    COLUMNS,
    HORIZONS,
    METRICS,
    MODEL_ORDER,
    STRINGS,
    DatasetColumn,
    MeanFigure,
    PaperErrors,
    paper_errors,
)

NOT_RUN = "not run"  # what is said in place of a figure
NO_ERRORS = PaperErrors(None, None)


@dataclass(frozen=True)
class TableLine:
    """A row of a table: a model, and what its runs have in common.

    Attributes:
        initialisation: "" where it is no choice (DMD is fitted).
        structured: whether it started from prior knowledge of the string; see `Row.structured`.
        trained: frames that its runs were trained on; more than the table's where their first frames are measured.
        hints: of its runs, see `TrainingConfiguration.hints`.
    """

    model: str
    recipe: str
    initialisation: str
    structured: bool
    trained: int
    hints: str


@dataclass(frozen=True)
class TableEntry(PaperErrors):
    """A cell of ours, with the runs behind its figures.

    Attributes:
        test: the same of the test split; the figures themselves are of validation.
    """

    test: PaperErrors = NO_ERRORS
    done: tuple[Row, ...] = ()
    diverged: tuple[Row, ...] = ()
    failed: tuple[Row, ...] = ()

    @property
    def rows(self) -> tuple[Row, ...]:
        return (*self.done, *self.diverged, *self.failed)


@dataclass(frozen=True)
class Section:
    """A table: one kind of string and one horizon. A line without an entry in a column was not run there."""

    string: str
    horizon: int
    lines: dict[TableLine, dict[DatasetColumn, TableEntry]]

    @property
    def models(self) -> list[str]:
        """The models with a line of ours or of the paper, in the paper's order."""
        ours = {line.model for line in self.lines}
        place = self.string, self.horizon
        theirs = {model for string, horizon, model, *_ in paper_errors() if (string, horizon) == place}
        # the integrated phase is the question: it stands there even where nothing was run
        return [model for model in MODEL_ORDER if model in ours | theirs | {"koopman_integrated"}]

    def paper(self, model: str, column: DatasetColumn, metric: str) -> MeanFigure | None:
        """The paper's figure there; None where it has nothing."""
        errors = paper_errors().get((self.string, self.horizon, model, column))
        return errors.figure(metric) if errors else None


def sections(rows: Iterable[Row], recipe: str = "all") -> list[Section]:
    """The tables of the rows that belong to them, by string and horizon.

    A row counts as long as its name means the configuration that it was made with: rows of a trial, and of a recipe
    that has changed since, are another thing.
    """
    chosen = [row for row in rows if recipe in ("all", row.recipe) and configuration_of(row) is not None]
    return [_section(chosen, string, horizon) for string in STRINGS for horizon in HORIZONS]


def rows_of(all_sections: Iterable[Section]) -> list[Row]:
    """Every row behind the figures of these tables, once, by name."""
    entries = (entry for s in all_sections for columns in s.lines.values() for entry in columns.values())
    return sorted({row for entry in entries for row in entry.rows}, key=lambda row: (row.name, row.digest))


def configuration_of(row: Row) -> TrainingConfiguration | None:
    """The configuration of a row's run, by its name; None where the name means another one by now, or none."""
    try:
        configuration = load(row.name)
    except SchemaError:
        return None
    return configuration if configuration.digest == row.digest else None


def _section(rows: Sequence[Row], string: str, horizon: int) -> Section:
    """The table of one kind of string ("linear" or "nonlinear") and horizon in frames, from all rows."""
    gathered: dict[TableLine, dict[DatasetColumn, dict[int, Row]]] = {}  # last by seed
    for row in rows:
        column = DatasetColumn(row.initial, row.rate_hz)
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
    """Return True if a row has a place in a horizon's table: trained on it, or on the long one, for the short."""
    of_longer = (row.horizon, horizon) == (HORIZON, SHORT_HORIZON)
    return row.horizon == horizon or (of_longer and (row.status != "done" or row.rel_mse_400 is not None))


def _line(row: Row) -> TableLine:
    how = "" if row.model == "dmd" else row.initialisation  # fitted: an initialisation is asked of it by nobody
    return TableLine(row.model, row.recipe, how, row.structured, row.horizon, load(row.name).hints)


def _entry(rows: Sequence[Row], horizon: int) -> TableEntry:
    """The entry of a cell from the rows of its seeds, over the table's horizon."""
    rows = sorted(rows, key=lambda row: row.seed)
    done, diverged, failed = (
        tuple(row for row in rows if row.status == status) for status in ("done", "diverged", "failed")
    )
    mse, mae = (_figure(done, metric, horizon) for metric in METRICS)
    test = PaperErrors(*(_figure(done, f"test_{metric}", horizon) for metric in METRICS))
    return TableEntry(mse, mae, test, done, diverged, failed)


def _figure(rows: Sequence[Row], metric: str, horizon: int) -> MeanFigure | None:
    """The mean of a metric over seeds that are done; None where a seed has none, or there are no seeds."""
    name = metric if all(row.horizon == horizon for row in rows) else f"{metric}_{SHORT_HORIZON}"
    values, errors = _known(rows, name), _known(rows, f"{name}_se")
    if not values or len(values) < len(rows):  # of a split on which a seed runs away there is no mean
        return None
    # of the seeds' mean: they are measured on the same trajectories, whose draw moves them all alike
    split = math.sqrt(fmean(error**2 for error in errors)) if errors else None
    return MeanFigure(fmean(values), stdev(values) if len(values) > 1 else None, split)


def _known(rows: Sequence[Row], name: str) -> list[float]:
    """The values of a column, without those that are None."""
    return [value for row in rows if (value := getattr(row, name)) is not None]
