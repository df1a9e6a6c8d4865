"""The menu beside Record: takes, count-in and metronome."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QInputDialog, QMenu, QWidget

from app.session.record_choices import RecordChoices

COUNT_INS = ("No count-in", "1 bar", "2 bars")
TEMPOS_BPM, BEATS = (30, 300), range(1, 13)
OF_TAKE = {
    "play": "Play",
    "rename": "Rename …",
    "export": "Export …",
    "folder": "Show in folder",
    "delete": "Delete …",
}


@dataclass(frozen=True)
class TakeRow:
    """A take as it is listed.

    Attributes:
        words: when it was, and how long.
        waits: it is being saved.
    """

    name: str
    words: str
    saved: bool
    waits: bool

    @property
    def text(self) -> str:
        state = "" if self.saved else ", being saved" if self.waits else ", not saved"
        return f"{self.name}:  {self.words}{state}".replace("&", "&&")


class TakesMenu(QMenu):
    """Gestures emit signals; setters show what became of them."""

    asked = Signal(str, int)  # one of OF_TAKE, and the take's number from 0
    change_asked = Signal(str, object)  # a field of `RecordChoices` and its new value

    def __init__(self, parent: QWidget) -> None:
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
        self.show_choices(RecordChoices())

    def show_takes(self, rows: Sequence[TakeRow]) -> None:
        """Show the takes, the latest first."""
        for action in self._takes:
            if (menu := action.menu()) is not None:
                menu.deleteLater()
            self.removeAction(action)
        self._takes = []
        for number, row in reversed(list(enumerate(rows))):
            menu = QMenu(row.text, self)
            for what, text in OF_TAKE.items():
                action = menu.addAction("Save …" if what == "export" and not row.saved else text)
                action.triggered.connect(partial(self.asked.emit, what, number))
                action.setEnabled((row.saved or what != "folder") and not (row.waits and what != "play"))
            self._takes.append(menu.menuAction())
        if not rows:
            self._takes.append(QAction("No takes yet", self, enabled=False))
        self.insertActions(self._below, self._takes)

    def show_choices(self, choices: RecordChoices) -> None:
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
        tempo_bpm, chosen = QInputDialog.getInt(
            self.parentWidget(), "Tempo", "Beats a minute:", self._tempo_bpm, *TEMPOS_BPM
        )
        if chosen:
            self.change_asked.emit("tempo_bpm", tempo_bpm)
