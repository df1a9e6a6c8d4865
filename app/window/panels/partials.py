"""The partials of the present take, measured once it is complete; until then those of the last one are grey."""

from __future__ import annotations

import math

from app.analysis.take_partials import WINDOWS, PartialRow, take_partials
from app.presets.library import Library
from app.rendering import BlowTake, Take
from app.stage.session import Session
from app.views.controls.parts import combo_box
from app.views.plots.figures_table import FigureColumn, FiguresTable, TableRow, lay_out_table, values_of
from app.window.panels.base import ComputedPanel
from engine.compare.partials import LEAST_DECAY_DB


def hertz(value: float) -> str:
    return f"{value:.1f}"


def seconds(value: float) -> str:
    """A T60 in s; ∞: the partial grows."""
    return "grows" if math.isinf(value) else f"{value:.3g}"


def signed(value: float, digits: int = 1) -> str:
    """Format a value with its sign, and so many digits after the point."""
    if math.isinf(value):
        return "+∞" if value > 0 else "−∞"
    rounded = round(value, digits) or 0.0  # no minus before a zero
    return f"{rounded:+.{digits}f}".replace("-", "−")


def hundredths(value: float) -> str:
    return signed(value, 2)


_OF_MODEL = "of the model relative to the truth"
_NO_T60 = f"none where it falls by less than {LEAST_DECAY_DB:g} dB in the window"
COLUMNS = (
    FigureColumn("mode", "Mode", "Mode number: the number of half waves along the string", lambda n: f"{n}"),
    FigureColumn("truth_hz", "Truth, Hz", "Frequency of the truth in Hz, its mean over the window", hertz, "truth"),
    FigureColumn("model_hz", "Model, Hz", "Frequency of the model in Hz", hertz, "model"),
    FigureColumn("cents", "Cents", f"Frequency {_OF_MODEL}, in cents (hundredths of a semitone)", hundredths),
    FigureColumn("level_db", "Level, dB", f"Level {_OF_MODEL}, in dB", hundredths),
    FigureColumn("t60_error_percent", "T60, %", "Error of the model's decay time T60, in %", signed),
    FigureColumn(
        "truth_t60_s", "Truth T60", f"Time in s in which the truth decays by 60 dB; {_NO_T60}", seconds, "truth"
    ),
    FigureColumn(
        "model_t60_s", "Model T60", f"Time in s in which the model decays by 60 dB; {_NO_T60}", seconds, "model"
    ),
    FigureColumn("note", "Note", "Why a row is grey"),
)


class PartialsPanel(ComputedPanel):
    """Rows are known by their mode numbers."""

    key = "partials"
    title = "Partials"
    help = (
        "Every mode of the string: frequency, decay and level, model against truth. A click on a row solos its mode, "
        "Esc plays all modes."
    )

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library, "The partials of this pluck could not be measured")
        windows, tip = (
            [(text.capitalize(), key) for key, text in WINDOWS.items()],
            "The part of the pluck that is measured",
        )
        self._window = combo_box("Window of time", windows, tip=tip, picked=lambda _: self._show())
        self.table = FiguresTable("Partials of this pluck", COLUMNS)
        self.table.setToolTip("Click or Enter: hear this mode alone, again for all. Ctrl+C copies the table")
        self.table.row_clicked.connect(self._choose)
        self.table.row_entered.connect(self._choose)
        self.table.escaped.connect(lambda: self.solo(0))
        self._complete: Take | None = None  # the present take, once all of it is rendered
        self._rows: dict[str, list[PartialRow]] | None = None  # by window of time, of WINDOWS; None: not measured yet
        self.background.progressed.connect(self.progress.show_share)
        self.background.finished.connect(self._show_measured)
        lay_out_table(self, (self._window,), self._words, (), self.progress, self.table)

    def choices_changed(self, names: frozenset[str]) -> None:
        if "solo" in names:
            self._show_solo()

    def take_started(self, take: Take | BlowTake) -> None:
        super().take_started(take)
        self._complete = self._rows = None
        self._ask()
        self.table.set_dimmed(True)
        self._say("The partials of the new pluck follow when it is rendered")

    def take_finished(self, take: Take) -> None:
        self._complete = take

    def _wanted(self) -> Take | None:
        return self._complete

    def _begin(self) -> None:
        take = self._complete
        if take is not None:
            self._say("Measuring the partials of this pluck …", 0.0)
            self.compute(lambda job: take_partials(take, job))

    def _choose(self, mode: int) -> None:
        self.solo(mode)
        self._show_solo()

    def _show_measured(self, rows: dict[str, list[PartialRow]]) -> None:
        self.progress.show_share(None)
        self._rows = rows
        self._show()

    def _show(self) -> None:
        """Show the rows of the chosen window of time; grey rows could not be measured, and say why."""
        if self._rows is None:
            return
        window = str(self._window.currentData())
        rows = self._rows.get(window, [])
        self.table.set_dimmed(False)
        self.table.show_rows(
            [TableRow(row.mode, values_of(row, COLUMNS), grey=bool(row.note), tip=row.note) for row in rows]
        )
        self._show_solo()
        short = f"{WINDOWS[window].capitalize()}: too short to measure; increase the duration"
        self._words.rest("" if rows else short)

    def _show_solo(self) -> None:
        self.table.choose(self.session.choices.solo or None)
