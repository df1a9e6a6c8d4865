"""The menu beside Record: takes, count-in and metronome."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from typing import NamedTuple

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

from app.instrument.events import Meter
from app.shared.typed_number import typed_number
from app.views.dialogs.question import ask_text

COUNT_INS = ("No count-in", "1 bar", "2 bars")
TEMPOS_BPM, BEATS = range(30, 301), range(1, 13)
OF_TAKE = {
    "play": "Play",
    "rename": "Rename …",
    "export": "Export …",
    "folder": "Show in folder",
    "delete": "Delete …",
}


class TakeRow(NamedTuple):
    """A take as it is listed."""

    text: str
    saved: bool
    being_saved: bool


class TakesMenu(QMenu):
    """Gestures emit signals; setters show what became of them."""

    asked = Signal(str, int)  # one of OF_TAKE, and the take's number from 0
    change_asked = Signal(str, object)  # a field of `Meter` and its new value

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Takes", parent)
        self._takes: list[QAction] = []
        self._tempo_bpm = 0
        self._below = self.addSeparator()
        self._metronome = self.addAction("Metronome", self._toggle)
        self._metronome.setCheckable(True)
        self._count_ins = self._add_choices("Count-in", "count_in_bars", enumerate(COUNT_INS))
        self._tempo = self.addAction("", self._ask_tempo)
        self._beats = self._add_choices("Beats in a bar", "beats", ((beats, str(beats)) for beats in BEATS))
        self.show_takes(())
        self.show_choices(Meter())

    def show_takes(self, rows: Sequence[TakeRow]) -> None:
        """Show the takes, the latest first."""
        for action in self._takes:
            if (menu := action.menu()) is not None:
                menu.deleteLater()
            self.removeAction(action)
        self._takes = []
        for number, row in reversed(list(enumerate(rows))):
            menu = QMenu(row.text.replace("&", "&&"), self)
            for what, text in OF_TAKE.items():
                action = menu.addAction("Save …" if what == "export" and not row.saved else text)
                action.triggered.connect(partial(self.asked.emit, what, number))
                action.setEnabled(what == "play" or not (row.being_saved or (what == "folder" and not row.saved)))
            self._takes.append(menu.menuAction())
        if not rows:
            self._takes.append(QAction("No takes yet", self, enabled=False))
        self.insertActions(self._below, self._takes)

    def show_choices(self, choices: Meter) -> None:
        self._tempo_bpm = choices.tempo_bpm
        self._metronome.setChecked(choices.metronome)
        self._tempo.setText(f"Tempo: {choices.tempo_bpm} beats a minute …")
        for actions, chosen in ((self._count_ins, choices.count_in_bars), (self._beats, choices.beats)):
            for value, action in actions.items():
                action.setChecked(value == chosen)

    def _add_choices(self, title: str, field: str, entries: Iterable[tuple[int, str]]) -> dict[int, QAction]:
        menu, actions = self.addMenu(title), {}
        for value, text in entries:
            action = actions[value] = menu.addAction(text)
            action.setCheckable(True)
            action.triggered.connect(partial(self.change_asked.emit, field, value))
        return actions

    def _toggle(self) -> None:
        self.change_asked.emit("metronome", self._metronome.isChecked())

    def _ask_tempo(self) -> None:
        ask_text(self.parentWidget(), "Tempo", "Beats a minute:", str(self._tempo_bpm), self._set_tempo)

    def _set_tempo(self, text: str) -> None:
        tempo_bpm = typed_number(text)
        if tempo_bpm is None or tempo_bpm not in TEMPOS_BPM:
            raise ValueError(f"it must be a whole number of {TEMPOS_BPM[0]} … {TEMPOS_BPM[-1]}")
        self.change_asked.emit("tempo_bpm", round(tempo_bpm))
