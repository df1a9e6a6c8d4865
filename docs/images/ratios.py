"""Draw `ratios.png`: `PYTHONPATH=. .venv/bin/python docs/images/ratios.py`.

Heat map of our errors over the paper's, a row per model and a column per data set and horizon.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import style
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from training.cell import MODEL_NAMES
from training.results import RESULTS, Row, read_results
from training.tables.compact import own_lines
from training.tables.paper import COLUMNS, MODEL_ORDER, PRINTED
from training.tables.sections import Section, sections

MODELS = tuple(
    model for model in MODEL_ORDER if model not in ("dmd", "koopman_integrated")
)  # trained, and the paper's
METRIC = "rel_mae"
COLOURED = (0.03, 3.0)  # ratios; smaller and larger ones have the end's colour


def ratios(rows: Sequence[Row]) -> Figure:
    """Ratios of the tension-modulated string on a logarithmic colour scale; 1 is the paper's error.

    The lowest error of a model's recipes is drawn. Empty cells were not run, or the paper has no figure.
    """
    found = [section for section in sections(rows) if section.string == "nonlinear"]
    values = np.array([[_ratio(section, model, i) for section in found for i in range(4)] for model in MODELS])
    with style.styled():
        figure = Figure(figsize=(10, 4.2), layout="constrained")
        axes = figure.subplots()
        norm = TwoSlopeNorm(0.0, *np.log10(COLOURED))
        shown = axes.imshow(np.log10(values), cmap="RdBu_r", norm=norm, aspect="auto")
        for (y, x), value in np.ndenumerate(values):
            text = "–" if np.isnan(value) else f"{value:.2g}"
            axes.text(x, y, text, ha="center", va="center", fontsize=10)
        axes.set_xticks(range(8), [f"{str(c).replace(' ', chr(10), 1)}" for _ in found for c in COLUMNS])
        axes.set_yticks(range(len(MODELS)), [MODEL_NAMES[model] for model in MODELS])
        axes.grid(False)
        axes.axvline(3.5, color="white", linewidth=4)
        ticks = (0.03, 0.1, 0.3, 1, 3)
        bar = figure.colorbar(shown, ax=axes, ticks=list(np.log10(ticks)), label="ours / paper")
        bar.ax.set_yticklabels([f"{tick:g}" for tick in ticks])
        horizons = ", then ".join(f"{section.horizon} frames" for section in found)
        figure.suptitle(f"Relative MAE over the paper's, tension-modulated string, {horizons}")
    return figure


def _ratio(section: Section, model: str, column: int) -> float:
    """Our lowest mean over the paper's; NaN where one of them is missing."""
    paper = section.paper(model, COLUMNS[column], METRIC)
    entries = [section.lines[line].get(COLUMNS[column]) for line in own_lines(section) if line.model == model]
    means = [figure.mean for entry in entries if entry and (figure := entry.figure(METRIC))]
    return min(means) / (paper.mean or PRINTED) if paper and means else float("nan")


if __name__ == "__main__":
    style.save_figure(ratios(read_results(RESULTS)), Path(__file__).with_name("ratios.png"))
