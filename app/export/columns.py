"""Columns of numbers and words as CSV: headings with units, every digit, a row for each frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = Sequence[Any] | NDArray[Any]
MOST_VALUES = 1_500_000  # some 20 MB of text, which takes a second
UNITS = {"_hz": "Hz", "_db": "dB", "_s": "s", "_percent": "%"}  # by the ending of a field
FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet would take such words for a formula


@dataclass(frozen=True)
class Columns:
    """Columns of one length; what they hold never changes.

    Attributes:
        values: by heading. NaN and None are empty cells.
        left_out: rows behind them that are too many.
    """

    values: Mapping[str, Values]
    left_out: int = 0

    @property
    def rows(self) -> int:
        return min(map(len, self.values.values()), default=0)

    @property
    def words(self) -> str:
        """The rows that are left out, in words; "": none are."""
        whole = self.rows + self.left_out
        return f" The first {self.rows:,} of {whole:,} rows; zoom in for others." if self.left_out else ""

    @property
    def text(self) -> str:
        """The headings in a line, and a line for each row."""
        lines = zip(*map(_cells, self.values.values()), strict=True)
        return "".join(",".join(line) + "\n" for line in (_cells(list(self.values)), *lines))


def heading_of(field: str) -> str:
    """The heading of a field: of "truth_hz" "truth (Hz)"."""
    ending = next((end for end in UNITS if field.endswith(end)), "")
    words = field.removesuffix(ending).replace("_", " ")
    return f"{words} ({UNITS[ending]})" if ending else words


def most_rows(columns: int) -> int:
    """The number of rows that so many columns may have."""
    return MOST_VALUES // columns


def aligned(heading: str, curves: Mapping[str, tuple[NDArray[Any], NDArray[Any]]]) -> Columns:
    """Columns of curves, by heading, on all of their places; empty where a curve has no value."""
    first, *others = [places for places, _ in curves.values()] or [np.empty(0)]
    same = all(np.array_equal(places, first) for places in others)
    rows = first if same else np.unique(np.concatenate([first, *others]))
    kept = rows[: most_rows(1 + len(curves))]
    columns: dict[str, Values] = {heading: kept}
    for name, (places, values) in curves.items():
        there = places <= kept[-1] if len(kept) else np.zeros(len(places), bool)
        columns[name] = column = np.full(len(kept), np.nan, values.dtype)
        column[np.searchsorted(kept, places[there])] = values[there]
    return Columns(columns, len(rows) - len(kept))


def _cells(column: Values) -> list[str]:
    if isinstance(column, np.ndarray) and column.dtype.kind in "fiu":
        form = "{:.9g}" if column.dtype == np.float32 else "{!r}"  # neither loses a digit
        return ["" if text == "nan" else text for text in map(form.format, column.tolist())]
    return [_quoted(value) if isinstance(value, str) else "" if value is None else str(value) for value in column]


def _quoted(text: str) -> str:
    plain = f"'{text}" if text.startswith(FORMULA_SIGNS) else text
    return '"{}"'.format(plain.replace('"', '""')) if set(plain) & set(',"\r\n') else plain
