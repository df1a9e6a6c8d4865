"""The menu beside Record: takes, count-in and metronome."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

from app.player.events import Meter
from app.shared.typed_number import typed_number
from app.views.dialogs.question import ask_text

CHOICES = (
    ("Count-in", "count_in_bars", {0: "No count-in", 1: "1 bar", 2: "2 bars"}),
    ("Beats in a bar", "beats", {beats: str(beats) for beats in range(1, 13)}),
)
TakeRow = tuple[str, Mapping[str, Callable[[], object]]]  # a take's words; what can be done with it, by its words


class TakesMenu(QMenu):
    """A menu with a row for each take; `meter` has what is chosen for the next one."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Takes", parent)
        self.meter = Meter()
        self._takes: list[QMenu] = []  # a submenu for each take
        self._below = self.addSeparator()  # under the takes, before which they are inserted
        self._metronome = self.addAction("Metronome")
        self._metronome.setCheckable(True)
        self._metronome.triggered.connect(lambda on: self.choose({"metronome": on}))
        self._tempo = self.addAction("", self._ask_tempo)
        self._choices: dict[tuple[str, int], QAction] = {}  # field of `Meter` and its value -> the entry for it
        for title, field, entries in CHOICES:
            menu = self.addMenu(title)
            for value, text in entries.items():
                action = self._choices[field, value] = menu.addAction(text)
                action.setCheckable(True)
                action.triggered.connect(partial(self.choose, {field: value}))
        self.show_takes(())
        self.choose({})

    def show_takes(self, rows: Sequence[TakeRow]) -> None:
        """Show a submenu for each take, in this order; one that is disabled where there are none."""
        for menu in self._takes:
            self.removeAction(menu.menuAction())
            menu.deleteLater()
        self._takes = []
        for text, deeds in rows or [("No takes yet", {})]:
            menu = QMenu(text.replace("&", "&&"), self)
            menu.setEnabled(bool(deeds))
            for words, do in deeds.items():
                menu.addAction(words).triggered.connect(do)
            self.insertMenu(self._below, menu)
            self._takes.append(menu)

    def choose(self, changes: Mapping[str, object]) -> None:
        """Change fields of `meter`, by their names, and check the entries of its values."""
        self.meter = Meter.model_validate({**dict(self.meter), **changes})
        self._metronome.setChecked(self.meter.metronome)
        self._tempo.setText(f"Tempo: {self.meter.tempo_bpm} beats a minute …")
        for (field, value), action in self._choices.items():
            action.setChecked(getattr(self.meter, field) == value)

    def _ask_tempo(self) -> None:
        bar, tempo = self.parentWidget(), str(self.meter.tempo_bpm)
        ask_text(bar, "Tempo", "Beats a minute:", tempo, lambda text: self.choose({"tempo_bpm": typed_number(text)}))
