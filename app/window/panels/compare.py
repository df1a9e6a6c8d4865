"""Several presets on the present pluck, computed one after the other while the table is visible.

The chosen preset comes first, then those in the slots, then the others. Presets are known by their names.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

from PySide6.QtCore import QSignalBlocker
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QToolButton

from app.analysis.comparison import ComparedRow, compare, same_string
from app.export.compared import ComparedModels, models_word
from app.presets import words
from app.presets.library import Library, PresetEntry
from app.rendering.note_sound import NoteSound
from app.session.slots import other_preset, sound_of
from app.stage.session import Session
from app.views.controls.parts import tool_button
from app.views.plots.figures_table import FigureColumn, FiguresTable, TableRow, lay_out_table, values_of
from app.window.panels.base import ComputedPanel, Moment
from engine.plain_text import time_left


def percent(value: float) -> str:
    """A relative error; ∞: the model ran away."""
    if math.isinf(value):
        return "ran away"
    return words.percent(value, 3) if value < 10 else "> 1000 %"


def scientific(value: float) -> str:
    return "ran away" if math.isinf(value) else f"{value:.2e}"


def decibels(value: float) -> str:
    """A null depth in dB."""
    return "+∞" if math.isinf(value) else f"{value:.1f}".replace("-", "−")


def times(value: float) -> str:
    """A speed, as a multiple of real time."""
    return f"{value:.0f} ×" if value >= 10 else f"{value:.2g} ×"


_TRAINED, _PAST = "over the trained time and the whole string", "from the end of training to the end of the pluck"
_HEARD = (
    "The worst fault that an ear finds in this pluck, through the pick-up, or how far the spectra are apart; "
    "sorted by that distance"
)
_NULL = "Null depth: level of model − truth relative to the truth, at the listening point, over the whole pluck"
_SPEED = "Seconds of sound that are rendered in a second on one core; above 1 is faster than real time"
COLUMNS = (
    FigureColumn("title", "Preset", "Click or Enter: hear the model on this pluck"),
    FigureColumn("mae", "MAE", f"Relative mean absolute error {_TRAINED}", percent),
    FigureColumn("past_mae", "MAE past", f"Relative mean absolute error {_PAST}", percent),
    FigureColumn("heard", "Heard", _HEARD),
    FigureColumn("null_db", "Null, dB", _NULL, decibels),
    FigureColumn("real_time", "Speed", _SPEED, times),
    FigureColumn("parameters", "Parameters", "Trainable parameters", lambda n: f"{n:,}"),
    FigureColumn("mse", "MSE", f"Relative mean squared error {_TRAINED}", scientific),
    FigureColumn("past_mse", "MSE past", f"Relative mean squared error {_PAST}", scientific),
    FigureColumn("rate_hz", "Rate", "Sample rate of the model", lambda hz: f"{hz / 1000:g} kHz"),
    FigureColumn("model", "Model", "Model architecture"),
    FigureColumn("note", "Note", "Why there are no figures"),
)


class ComparePanel(ComputedPanel):
    """The table, and a menu of the presets in it.

    A row is fresh if its figures are of the present pluck; figures of an earlier pluck are grey.
    """

    SETTLED_S = 0.5  # a pluck that is still being moved is not computed
    key = "compare"
    title = "Compare"
    help = (
        "All models of this string on the present pluck: errors within the training and past it, what an ear finds, "
        "null depth and speed. A click or Enter plays the model of a row; Export … saves all of them."
    )

    def __init__(self, session: Session, library: Library) -> None:
        super().__init__(session, library)
        self._names: list[str] | None = None  # chosen by the user; None: those of the present string
        self._rows: dict[str, ComparedRow] = {}  # the latest figures, by preset
        self._menu = QMenu(self)
        self._actions: dict[str, QAction] = {}  # of the menu, by preset
        presets = tool_button("Presets ▾", "Presets to compare", "Select the presets to compare")
        presets.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        presets.setMenu(self._menu)
        self._began_s, self._left = 0.0, ""  # when computing began, and the time left in words
        self._export = tool_button("Export …", "Export the models", "Save all models on this pluck, with the table")
        self._export.clicked.connect(self._ask_export)
        self._stop = tool_button("Stop")
        self._stop.clicked.connect(self._stop_or_go_on)
        self.table = FiguresTable("Presets compared on this pluck", COLUMNS)
        self.table.setToolTip("Click or Enter plays a model; Delete removes it. Ctrl+C copies the table")
        self.table.row_clicked.connect(self._hear)
        self.table.row_entered.connect(self._hear)
        self.setFocusProxy(self.table)
        self.table.row_deleted.connect(lambda name: self._toggle(name, False))
        self.progress.setAccessibleName("Progress of the comparison")
        self.background.progressed.connect(self._show_progress)
        self.background.finished.connect(lambda: self._set_computing(None))
        self.background.failed.connect(lambda: self._set_computing(None))
        library.changed.connect(self._library_changed)
        self._fill_menu()
        self._set_computing(None)
        lay_out_table(self, (presets,), self._words, (self._export, self._stop), self.progress, self.table)

    def _draw_moment(self, moment: Moment) -> None:
        super()._draw_moment(moment)
        if self._is_new(self._asked, self.session.choices.preset):
            self._show()

    def _library_changed(self) -> None:
        self._fill_menu()
        self._show()

    def _fill_menu(self) -> None:
        """All presets, each to be put in or taken out."""
        menu = self._menu
        menu.clear()
        menu.addAction("Presets of this string").triggered.connect(lambda: self._choose(None))
        menu.addAction("All presets").triggered.connect(lambda: self._choose(self.library.names))
        menu.addSeparator()
        self._actions = {}
        for entry in self.library.entries:
            action = menu.addAction(entry.title)
            action.setCheckable(True)
            action.toggled.connect(lambda on, name=entry.name: self._toggle(name, on))
            self._actions[entry.name] = action

    def _sound(self, entry: PresetEntry) -> NoteSound:
        """The present pluck of a preset's string, with all modes."""
        choices = self.session.choices
        return replace(sound_of(choices, entry.path), ear=replace(choices.ear, solo=0))

    def _hear(self, name: str) -> None:
        """Play the model of a preset on the present pluck, which stays as it is."""
        choices = self.session.choices
        slot = "b" if choices.b == "model" else "a"
        self.session.update(preset=name, pluck=choices.pluck, **{slot: "model", "heard": slot})
        self.pluck_asked.emit()

    def _ask_export(self) -> None:
        """Ask for an export of the models that are compared by now."""
        rows = [row for row, fresh in map(self._row, self._entries) if fresh and row.mae is not None]
        if rows:
            choices, sounds = self.session.choices, [row.sound for row in rows]
            lines = [(sound, row.figures) for sound, row in zip(sounds, rows, strict=True) if sound is not None]
            words = lines[0][0].words(models_word(len(lines)))
            name = (
                f"{models_word(len(lines))}, place {choices.pluck.position:.2f}, {choices.pluck.amplitude_mm:.1f} mm"
            )
            self.export_asked.emit(ComparedModels(words, name, lines))

    def _row(self, entry: PresetEntry) -> tuple[ComparedRow, bool]:
        """The row of a preset as far as it is known, and True if it is of the present pluck."""
        row = self._rows.get(entry.name) or ComparedRow.of(entry)
        return row, row.sound == self._sound(entry)

    @property
    def _entries(self) -> list[PresetEntry]:
        """The presets in the table: those that were chosen, else those of the present string."""
        if self._names is not None:
            return [entry for entry in self.library.entries if entry.name in self._names]
        present = self.library.find(self.session.choices.preset)
        if self.session.choices.string is not None:  # which no other preset has learned
            return [present] if present is not None else []
        return [e for e in self.library.entries if present is not None and same_string(e.info, present.info)]

    def _wanted(self) -> object:
        return [self._sound(entry) for entry in self._entries]

    def _clear(self) -> None:
        self._set_computing(None)

    def _begin(self) -> None:
        """Compute the rows that are not of the present pluck."""
        entries = sorted(self._entries, key=lambda entry: self._urgency(entry.name))
        missing = [(entry, self._sound(entry)) for entry in entries if not self._row(entry)[1]]
        if missing:
            self._began_s = time.monotonic()
            self._set_computing(0.0)
            self.compute(lambda job: compare(missing, job), [entry.info for entry, _ in missing])
        self._show()

    def _urgency(self, name: str) -> int:
        """The place of a preset in the order of computing: 0 the chosen one, then those in slots A and B."""
        choices = self.session.choices
        presets_in_use = [choices.preset, other_preset(choices.a), other_preset(choices.b)]
        return presets_in_use.index(name) if name in presets_in_use else len(presets_in_use)

    def _show_progress(self, share: float, _: str, row: ComparedRow | None) -> None:
        """Show the share of the table that is done, 0 … 1, and a preset's row where one is complete, else None."""
        if row is not None:
            self._rows[row.name] = row
        self._set_computing(share)
        self._show(row is not None)

    def _set_computing(self, share: float | None) -> None:
        """Set the share of the table that is done, 0 … 1; None: nothing is being computed."""
        self.progress.show_share(share)
        left = time_left(self._began_s, share or 0.0)
        self._left = left and f"; about {left}"
        stops = share is not None
        self._stop.setText("Stop" if stops else "Compute again")
        self._stop.setAccessibleName("Stop comparing" if stops else "Compare again")
        self._stop.setToolTip(
            "Stop computing" if stops else "Compute the missing rows; where none is missing, all rows"
        )

    def _stop_or_go_on(self) -> None:
        """Stop computing; or, where nothing is computed, continue with the rows that are missing.

        Where none is missing, compute all again.
        """
        if self.background.busy:
            self.background.cancel()
            self._set_computing(None)
            self._show(whole=False)
        else:
            shown_rows = [self._row(entry) for entry in self._entries]
            undone = [row for row, fresh in shown_rows if not fresh or row.mae is None]
            for row in undone or [row for row, _ in shown_rows]:
                self._rows[row.name] = replace(row, sound=None)
            self._begin()

    def _toggle(self, name: str, on: bool) -> None:
        names = [entry.name for entry in self._entries if entry.name != name]
        self._choose([*names, name] if on else names)

    def _choose(self, names: list[str] | None) -> None:
        self._names = names
        self._ask()
        self._show()

    def _show(self, whole: bool = True) -> None:
        """Show the rows and the words; not `whole`: the words alone."""
        entries = self._entries
        present = self.session.choices.preset
        names = {entry.name for entry in entries}
        for name, action in self._actions.items():
            with QSignalBlocker(action):
                action.setChecked(name in names)
        rows = [self._row(entry) for entry in entries]
        if whole:
            self.table.show_rows([_table_row(row, fresh, row.name == present) for row, fresh in rows])
        self._export.setEnabled(any(of_this and row.mae is not None for row, of_this in rows))
        count, fresh = len(entries), sum(of_this for _, of_this in rows)
        done = f"{fresh} of {count}" if fresh < count else f"{count}"
        former = any(row.mae is not None and not of_this for row, of_this in rows)
        self._words.rest(
            f"{done} preset{'s' if count != 1 else ''} on this pluck, {self.session.choices.seconds:g} s"
            + ("; grey: an earlier pluck" if former else "")
            + self._left,
            f"{done}{self._left}",
        )


def _table_row(row: ComparedRow, fresh: bool, present: bool) -> TableRow:
    """The row of the table; `fresh`: of the present pluck; `present`: of the chosen preset."""
    heard = "" if row.heard is None else row.heard.sentence
    tip = "\n".join(line for line in (row.title, row.file, heard, row.note) if line)
    return TableRow(row.name, values_of(row, COLUMNS), grey=not fresh, bold=present, tip=tip)
