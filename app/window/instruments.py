"""What plays the string besides the mouse: the computer's keys and MIDI, connected to session and window."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal

from app.playing.keyboard import KeyPress, Reach, play
from app.playing.midi import MidiChoices
from app.presets.library import Library
from app.session.choices import Choices, Session
from app.views.controls.playing_keys import PlayingKeys
from app.window.main_window import MainWindow
from app.window.midi_control import MidiControl


class Instruments(QObject):
    """`played` after a note was struck and the session knows it; `told` is for the user.

    A note goes straight to `strike`, in the thread of its gesture; the session, and with it the window, is told when
    the window has time.
    """

    played = Signal()
    told = Signal(str)

    _struck = Signal(dict)  # from any thread

    def __init__(
        self,
        window: MainWindow,
        session: Session,
        library: Library,
        midi: MidiChoices,
        strike: Callable[[Choices], object],
    ) -> None:
        super().__init__(window)
        self._session = session
        self._library = library
        self._strike = strike
        self._lock = threading.Lock()
        self._told: dict[str, Any] = {}  # of notes, and not in the session yet
        self._struck.connect(self._tell_session, Qt.ConnectionType.QueuedConnection)
        self._keys = PlayingKeys(window)
        self._keys.pressed.connect(self._press)
        self.midi = MidiControl(
            midi, lambda: self.reach, lambda: library.names, lambda changes: self.perform(changes, True), self
        )
        self.midi.performed.connect(lambda changes: self.perform(changes, False))
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
        """New values of `Choices`, and a pluck. Any thread."""
        if plucks:
            with self._lock:
                self._told = {**self._told, **changes}
                choices = self._session.choices.model_copy(update=self._told)
            self._strike(choices)
            self._struck.emit(changes)
        else:
            self._session.update(**changes)

    def _tell_session(self, changes: dict[str, Any]) -> None:
        """Once for all notes that were struck meanwhile."""
        with self._lock:
            told, self._told = self._told, {}
        if told:
            self._session.play(**told)
            self.played.emit()

    def _press(self, press: KeyPress) -> None:
        played = play(press, self.reach, self._session.choices.amplitude_mm)
        if played is not None:
            self.perform(dict(played.changes), played.plucks)
