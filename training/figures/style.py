"""How figures look, and their files: light, legible from the back of a room, safe for the colour-blind.

No global state: figures are made and written within `styled`, and never known to pyplot.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from engine.whole_file import whole_file

# Okabe and Ito's, without the yellow, which is faint on white
COLOURS = ("#0072B2", "#D55E00")
DPI = 200
FORMATS = (".png", ".svg", ".pdf")

STYLE: dict[Any, Any] = {
    "figure.facecolor": "white",
    "axes.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.dpi": DPI,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib: the same figure on every machine
    "font.size": 11,
    "axes.titlesize": 12,
    "figure.titlesize": 14,
    "axes.labelsize": 11,
    "legend.fontsize": 10,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "xtick.color": "#333333",
    "ytick.color": "#333333",
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.6,
    "svg.hashsalt": "learned-strings",  # the same file for the same figure
    "svg.fonttype": "none",  # text stays text
    "pdf.fonttype": 42,
}


@contextmanager
def styled() -> Iterator[None]:
    """Within it, figures are made and written in this style; what was set before is set again after it."""
    with mpl.rc_context(STYLE):
        yield


def check_format(path: Path) -> None:
    """Raises ValueError where a file's suffix is of no format that is written."""
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f"{path}: a figure is written as {', '.join(FORMATS)}; choose one of these suffixes")


def figure_bytes(figure: Figure, suffix: str) -> bytes:
    """The figure as a file of this suffix; the same bytes for the same figure."""
    kind = suffix.lower().removeprefix(".")
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    file = io.BytesIO()
    with styled():
        figure.savefig(file, format=kind, dpi=DPI, metadata=undated)
    return file.getvalue()


def save_figure(figure: Figure, path: Path) -> None:
    """Writes a figure whole or not at all.

    Raises:
        ValueError: see `check_format`.
        OSError: it cannot be written.
    """
    check_format(path)
    with whole_file(path) as unfinished:
        unfinished.write_bytes(figure_bytes(figure, path.suffix))
