"""The paper's tables: what stands where in them, their figures, and how one of ours compares.

`paper_tables.csv` has the figures as printed: Diaz, De La Vega Martin, Sandler, "Towards Efficient Modelling of
String Dynamics", DAFx24, Table 3a (nonlinear) and 3b (linear): means and standard deviations over 5 seeds on the
validation set, for DMD deviations over its trajectories.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple

from training.cell import HORIZON
from training.results import SHORT_HORIZON

PAPER = Path(__file__).parent / "paper_tables.csv"
PRINTED = 5e-5  # the paper prints four decimals: no figure of it is known better
STRINGS = ("linear", "nonlinear")
HORIZONS = (HORIZON, SHORT_HORIZON)
METRICS = ("rel_mse", "rel_mae")
MODEL_ORDER = ("dmd", "koopman", "koopman_var", "lru", "s5", "fgru", "frnn", "koopman_integrated")

Mark = Literal["better", "worse", "equal"]


class DatasetColumn(NamedTuple):
    """A data set of the tables."""

    initial: str
    rate_hz: int

    def __str__(self) -> str:
        return f"{self.initial.capitalize()} {self.rate_hz // 1000} kHz"


COLUMNS = tuple(DatasetColumn(initial, rate_hz) for initial in ("gaussian", "noise") for rate_hz in (4000, 16000))


class MeanFigure(NamedTuple):
    """A mean and what it may be off by.

    Attributes:
        deviation: standard deviation over seeds, None where a single run has none; of the paper's as printed.
        split: standard error over the trajectories of the split, None where it was not measured.
    """

    mean: float
    deviation: float | None = None
    split: float | None = None

    @property
    def total(self) -> float | None:
        """The sum of both, as the root of the sum of their squares; None where neither is known."""
        known = [part for part in (self.deviation, self.split) if part is not None]
        return math.hypot(*known) if known else None


@dataclass(frozen=True)
class PaperErrors:
    """A cell of the tables: a figure of each metric, None where there is none."""

    rel_mse: MeanFigure | None
    rel_mae: MeanFigure | None

    def figure(self, metric: str) -> MeanFigure | None:
        return self.rel_mse if metric == "rel_mse" else self.rel_mae


@cache
def paper_errors() -> dict[tuple[str, int, str, DatasetColumn], PaperErrors]:
    """The paper's errors, by string, horizon, model and column."""
    errors = {}
    with PAPER.open(newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            mse, mae = (MeanFigure(float(line[metric]), float(line[f"{metric}_std"])) for metric in METRICS)
            column = DatasetColumn(line["initial"], int(line["rate_hz"]))
            errors[line["string"], int(line["horizon"]), line["model"], column] = PaperErrors(mse, mae)
    return errors


def mark(ours: MeanFigure, paper: MeanFigure) -> Mark:
    """The mark of ours against the paper's.

    Equal: within one standard deviation of their difference, and never finer than the paper prints.
    """
    tolerance = max(math.hypot(ours.total or 0.0, paper.total or 0.0), PRINTED) * (1 + 1e-9)
    if abs(ours.mean - paper.mean) <= tolerance:
        return "equal"
    return "better" if ours.mean < paper.mean else "worse"


def factor(ours: MeanFigure, paper: MeanFigure) -> str:
    """Our mean as a multiple of the paper's, "×0.0005"; "> ×0.1" where the paper's is printed as 0.0000."""
    times = ours.mean / (paper.mean or PRINTED)
    text = f"{times:.2g}" if times < 100 else f"{times:.0f}"
    return f"×{text}" if paper.mean > 0 else f"> ×{text}"
