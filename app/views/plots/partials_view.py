"""A table of the string's partials, model against truth."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from app.analysis.take_partials import WINDOWS, PartialRow
from app.views.controls.parts import combo_box, words_label
from app.views.controls.progress_strip import ProgressStrip
from app.views.plots.figures_table import Column, FiguresTable, TableRow, lay_out_table
from engine.partials import LEAST_DECAY_DB


def hertz(value: float) -> str:
    return f"{value:.1f}"


def seconds(value: float) -> str:
    """A T60 in s; ∞: the partial grows."""
    return "grows" if math.isinf(value) else f"{value:.3g}"


def signed(value: float, digits: int = 1) -> str:
    """With its sign, and so many digits after the point."""
    if math.isinf(value):
        return "+∞" if value > 0 else "−∞"
    rounded = round(value, digits) or 0.0  # no minus before a zero
    return f"{rounded:+.{digits}f}".replace("-", "−")


_NO_T60 = f"none where it falls by less than {LEAST_DECAY_DB:g} dB in the window"
COLUMNS = (
    Column("Mode", "Mode number: the number of half waves along the string", lambda n: f"{n}"),
    Column("Truth, Hz", "Frequency of the truth in Hz, its mean over the window", hertz, "truth"),
    Column("Model, Hz", "Frequency of the model in Hz", hertz, "model"),
    Column(
        "Cents",
        "Frequency of the model relative to the truth, in cents (hundredths of a semitone)",
        lambda v: signed(v, 2),
    ),
    Column("Level, dB", "Level of the model relative to the truth, in dB", lambda v: signed(v, 2)),
    Column("T60, %", "Error of the model's decay time T60, in %", signed),
    Column("Truth T60", f"Time in s in which the truth decays by 60 dB; {_NO_T60}", seconds, "truth"),
    Column("Model T60", f"Time in s in which the model decays by 60 dB; {_NO_T60}", seconds, "model"),
    Column("Note", "Why a row is grey"),
)


class PartialsView(QWidget):
    """Rows are known by their mode numbers."""

    window_chosen = Signal(str)  # a key of `WINDOWS`
    mode_chosen = Signal(int)
    solo_ended = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Partials")
        self.setMinimumHeight(84)
        self._window = combo_box("Window of time", [(text.capitalize(), key) for key, text in WINDOWS.items()])
        self._window.setToolTip("The part of the pluck that is measured")
        self._window.activated.connect(lambda _: self.window_chosen.emit(self.window_key))
        self._words = words_label()
        self.table = FiguresTable("Partials of this pluck", COLUMNS)
        self.table.setToolTip("Click or Enter: hear this mode alone, again for all. Ctrl+C copies the table")
        self.table.row_clicked.connect(lambda mode: self.mode_chosen.emit(mode))
        self.table.row_entered.connect(lambda mode: self.mode_chosen.emit(mode))
        self.table.escaped.connect(self.solo_ended)
        self.progress = ProgressStrip("Progress of the partials")
        lay_out_table(self, (self._window,), self._words, (), self.progress, self.table)

    @property
    def window_key(self) -> str:
        return str(self._window.currentData())

    def set_words(self, text: str) -> None:
        """The line above the table."""
        self._words.setText(text)

    def show_partials(self, rows: Sequence[PartialRow]) -> None:
        self.table.set_dimmed(False)
        self.table.show_rows([self._row(row) for row in rows])

    def dim(self) -> None:
        """The figures are of an earlier pluck."""
        self.table.set_dimmed(True)

    def show_solo(self, mode: int) -> None:
        """Marks the soloed mode; 0: none."""
        self.table.choose(mode or None)

    @staticmethod
    def _row(row: PartialRow) -> TableRow:
        values = (
            row.mode,
            row.truth_hz,
            row.model_hz,
            row.cents,
            row.level_db,
            row.t60_error_percent,
            row.truth_t60_s,
            row.model_t60_s,
            row.note,
        )
        return TableRow(row.mode, values, grey=bool(row.note), tip=row.note)
