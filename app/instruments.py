"""What plays the string besides the mouse: the computer's keys and MIDI, connected to session and window."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QObject, Signal

from app.keyboard import KeyPress, Reach, play
from app.library import Library
from app.main_window import MainWindow
from app.midi import MidiChoices
from app.midi_control import MidiControl
from app.session import Session
from app.views.playing_keys import PlayingKeys


class Instruments(QObject):
    """`plucked` after new values are chosen; `told` is for the user."""

    plucked = Signal()
    told = Signal(str)

    def __init__(self, window: MainWindow, session: Session, library: Library, midi: MidiChoices) -> None:
        super().__init__(window)
        self._session = session
        self._library = library
        self._keys = PlayingKeys(window)
        self._keys.pressed.connect(self._press)
        self.midi = MidiControl(midi, lambda: self.reach, lambda: library.names, self)
        self.midi.performed.connect(self.perform)
        self.midi.told.connect(self.told)
        window.midi_asked.connect(lambda: self.midi.show_dialog(window))

    def start(self) -> None:
        """Opens the remembered MIDI input, if any."""
        self.midi.start()

    def close(self) -> None:
        self.midi.close()

    @property
    def reach(self) -> Reach:
        """Where and how hard instruments pluck: what the preset was trained on."""
        entry = self._library.find(self._session.choices.preset)
        return Reach.of(entry.info if entry else None)

    def perform(self, changes: dict[str, Any], plucks: bool) -> None:
        """New values of `Choices`, and a pluck."""
        (self._session.play if plucks else self._session.update)(**changes)
        if plucks:
            self.plucked.emit()

    def _press(self, press: KeyPress) -> None:
        played = play(press, self.reach, self._session.choices.amplitude_mm)
        if played is not None:
            self.perform(dict(played.changes), played.plucks)
