"""Columns of numbers and words as CSV: headings, every digit, a row for each frame."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = Sequence[Any] | NDArray[Any]
MOST_VALUES = 1_500_000  # some 20 MB of text, which takes a second
FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet would take such words for a formula


@dataclass(frozen=True)
class Columns:
    """Columns of one length, by heading. NaN in an array and None are empty cells."""

    values: Mapping[str, Values]

    @property
    def rows(self) -> int:
        """The number of rows that are written."""
        return min(self._all_rows, MOST_VALUES // max(len(self.values), 1))

    @property
    def _all_rows(self) -> int:
        return min(map(len, self.values.values()), default=0)

    @property
    def words(self) -> str:
        """The rows that are left out, in words; "": none are."""
        is_whole = self.rows == self._all_rows
        return "" if is_whole else f" The first {self.rows:,} of {self._all_rows:,} rows; zoom in for others."

    @property
    def text(self) -> str:
        """The headings in a line, and a line for each row."""
        file = StringIO()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(map(_cell, self.values))
        writer.writerows(zip(*(_cells(column[: self.rows]) for column in self.values.values()), strict=True))
        return file.getvalue()


def aligned(heading: str, curves: Mapping[str, tuple[NDArray[Any], NDArray[Any]]]) -> Columns:
    """Columns of curves, with a row for each place that any of them has; empty where a curve has no value.

    Args:
        heading: of the column of places, the first.
        curves: places, ascending, and values, (n,) each, by the heading of the curve.
    """
    rows = np.unique(np.concatenate([np.empty(0), *(places for places, _ in curves.values())]))
    columns: dict[str, Values] = {heading: rows}
    for name, (places, values) in curves.items():
        columns[name] = column = np.full(len(rows), np.nan, values.dtype)
        column[np.searchsorted(rows, places)] = values
    return Columns(columns)


def _cells(column: Values) -> list[Any]:
    if isinstance(column, np.ndarray):
        return ["" if text == "nan" else text for text in column.astype(str).tolist()]
    return [_cell(value) for value in column]


def _cell(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA_SIGNS) else value
