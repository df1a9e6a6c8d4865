"""A table of presets on one pluck, and which of them are in it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QToolButton, QWidget

from app.analysis.comparison import ComparedRow
from app.presets.library import PresetEntry
from app.views.controls.parts import tool_button, words_label
from app.views.controls.progress_strip import ProgressStrip
from app.views.plots.figures_table import Column, FiguresTable, TableRow, lay_out_table


def percent(value: float) -> str:
    """A relative error; ∞: the model ran away."""
    if math.isinf(value):
        return "ran away"
    return f"{100 * value:.3g} %" if value < 10 else "> 1000 %"


def scientific(value: float) -> str:
    return "ran away" if math.isinf(value) else f"{value:.2e}"


def decibels(value: float) -> str:
    """A null depth in dB."""
    return "+∞" if math.isinf(value) else f"{value:.1f}".replace("-", "−")


def times(value: float) -> str:
    """A speed, as a multiple of real time."""
    return f"{value:.0f} ×" if value >= 10 else f"{value:.2g} ×"


COLUMNS = (
    Column("Preset", "Double-click or Enter loads the preset"),
    Column("MAE", "Relative mean absolute error over the trained time and the whole string", percent),
    Column("MAE past", "Relative mean absolute error from the end of training to the end of the pluck", percent),
    Column(
        "Null, dB",
        "Null depth: level of model − truth relative to the truth, at the listening point, over the whole pluck",
        decibels,
    ),
    Column(
        "Speed", "Seconds of sound that are rendered in a second on one core; above 1 is faster than real time", times
    ),
    Column("Parameters", "Trainable parameters", lambda n: f"{n:,}"),
    Column("MSE", "Relative mean squared error over the trained time and the whole string", scientific),
    Column("MSE past", "Relative mean squared error from the end of training to the end of the pluck", scientific),
    Column("Rate", "Sample rate of the model", lambda hz: f"{hz / 1000:g} kHz"),
    Column("Model", "Model architecture"),
    Column("Note", "Why there are no figures"),
)


class CompareView(QWidget):
    """Presets are known by their names."""

    preset_toggled = Signal(str, bool)  # by its checkbox: in the table or not
    same_string_asked = Signal()
    all_asked = Signal()
    stop_asked = Signal()
    preset_opened = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Compare")
        self.setMinimumHeight(84)
        self._menu = QMenu(self)
        self._actions: dict[str, QAction] = {}
        presets = tool_button("Presets ▾", "Presets to compare", "Select the presets to compare")
        presets.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        presets.setMenu(self._menu)
        self._words = words_label()
        self._stop = tool_button("Stop")
        self._stop.clicked.connect(self.stop_asked)
        self.table = FiguresTable("Presets compared on this pluck", COLUMNS)
        self.table.setToolTip("Double-click or Enter loads a preset; Delete removes it. Ctrl+C copies the table")
        self.table.row_double_clicked.connect(lambda name: self.preset_opened.emit(name))
        self.table.row_entered.connect(lambda name: self.preset_opened.emit(name))
        self.table.row_deleted.connect(lambda name: self.preset_toggled.emit(name, False))
        self.progress = ProgressStrip("Progress of the comparison")
        lay_out_table(self, (presets,), self._words, (self._stop,), self.progress, self.table)

    def set_presets(self, entries: Sequence[PresetEntry]) -> None:
        """What can be compared."""
        menu = self._menu
        menu.clear()
        for text, signal in (("Presets of this string", self.same_string_asked), ("All presets", self.all_asked)):
            menu.addAction(text).triggered.connect(signal)
        menu.addSeparator()
        self._actions = {}
        for entry in entries:
            action = menu.addAction(entry.title)
            action.setCheckable(True)
            action.toggled.connect(lambda on, name=entry.name: self.preset_toggled.emit(name, on))
            self._actions[entry.name] = action

    def set_chosen(self, names: Sequence[str]) -> None:
        """Which of them are in the table."""
        for name, action in self._actions.items():
            with QSignalBlocker(action):
                action.setChecked(name in names)

    def set_words(self, text: str) -> None:
        self._words.setText(text)

    def set_computing(self, share: float | None) -> None:
        """The share of the table that is done, 0 … 1; None: nothing is being computed."""
        self.progress.show_share(share)
        stops = share is not None
        self._stop.setText("Stop" if stops else "Compute again")
        self._stop.setAccessibleName("Stop comparing" if stops else "Compare again")
        self._stop.setToolTip(
            "Stop computing" if stops else "Compute the missing rows; where none is missing, all rows"
        )

    def show_rows(self, rows: Sequence[tuple[ComparedRow, bool]], present: str) -> None:
        """Rows, and whether each is of the present pluck; `present`: the preset whose row is bold."""
        self.table.show_rows([self._row(row, fresh, row.name == present) for row, fresh in rows])

    @staticmethod
    def _row(row: ComparedRow, fresh: bool, present: bool) -> TableRow:
        values = (
            row.title,
            row.mae,
            row.past_mae,
            row.null_db,
            row.real_time,
            row.parameters,
            row.mse,
            row.past_mse,
            row.rate_hz,
            row.model,
            row.note,
        )
        tip = "\n".join(line for line in (row.title, row.file, row.note) if line)
        return TableRow(row.name, values, grey=not fresh, bold=present, tip=tip)
