"""The computer's keys and MIDI, connected to the sound, the session and the window."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal

from app.instrument.events import KEYS, Event, NoteOff, NoteOn
from app.instrument.player import Struck
from app.patches.patch import Patch, PhysicalString
from app.playing.due import Due
from app.playing.keyboard import LOWEST_C, KeyPress, Reach, play, semitone_of, turn
from app.playing.midi import MidiChoices
from app.presets.library import Library
from app.session.choices import Choices, Session
from app.views.controls.playing_keys import PlayingKeys
from app.window.main_window import MainWindow
from app.window.midi_control import MidiControl

HIGHEST_KEY = 127


class Instruments(QObject):
    """Plays gestures at once, in the thread of each; the session, and with it the window, learns of them later.

    Args:
        strike: plucks the string as `Choices` say; called in the gesture's thread.
        handle: plays an event through the patch and returns what it struck; called in the gesture's thread.

    Attributes:
        latest: the note that was struck last and the patch that played it; None: a pluck at a place, or none yet.
        latest_key: the key that was struck last through a patch, and on which string of its set, as in `Struck`;
            None before the first.
    """

    played = Signal()  # a note was struck, and the session knows it
    told = Signal(str)  # an error, for the user

    _struck = Signal(dict)  # emitted in any thread

    def __init__(
        self,
        window: MainWindow,
        session: Session,
        library: Library,
        midi: MidiChoices,
        strike: Callable[[Choices], object],
        handle: Callable[[Event, Due | None], Struck | None],
    ) -> None:
        super().__init__(window)
        self._session = session
        self._library = library
        self._strike, self._handle = strike, handle
        self.latest_key: tuple[int, int | None] | None = None
        self._lock = threading.Lock()
        self._told: dict[str, Any] = {}  # values of `Choices` of struck notes, not in the session yet
        self.latest: tuple[Patch, Struck] | None = None
        self._down: dict[KeyPress, int] = {}  # the computer's keys, and what they play
        self._struck.connect(self._tell_session, Qt.ConnectionType.QueuedConnection)
        self._keys = PlayingKeys(window)
        self._keys.pressed.connect(self._press)
        self._keys.released.connect(self._release)
        self.midi = MidiControl(
            midi,
            lambda: self.reach,
            lambda: library.names,
            lambda changes: self.perform(changes, True),
            self.play,
            self,
        )
        self.midi.performed.connect(lambda changes: self.perform(changes, False))
        self.midi.patch_turned.connect(self._turn_patch)
        self.midi.told.connect(self.told)
        window.midi_asked.connect(lambda: self.midi.show_dialog(window))

    def start(self) -> None:
        """Opens the remembered MIDI input, if any."""
        self.midi.start()

    def close(self) -> None:
        self.midi.close()

    @property
    def reach(self) -> Reach:
        """The positions and amplitudes that keys pluck with: what the preset was trained on."""
        entry = self._library.find(self._session.choices.preset)
        return Reach.of(entry.info if entry else None)

    @property
    def plays_pitches(self) -> bool:
        """As `Choices.plays_pitches`: what the computer's keys are."""
        return self._session.choices.plays_pitches

    def choices_changed(self) -> None:
        self._keys.piano = self.plays_pitches
        self.midi.show_patch(self._session.choices.patch)

    def play(self, event: Event, due: Due | None = None) -> bool:
        """Plays an event through the patch, at once or when it is due. Any thread. False where no patch is chosen."""
        if self._session.choices.patch is None:
            return False
        struck = self._handle(event, due)
        if struck is not None:
            self.latest = struck.key.patch, struck
            self.latest_key = struck.event.key, struck.string
            changes = {
                "preset": struck.key.patch.preset,
                "string": PhysicalString(**asdict(struck.key.string.parameters)),
                "position": struck.pluck.position,
                "amplitude_mm": struck.pluck.amplitude_mm,
                "shape": struck.pluck.shape,
                "width": struck.pluck.width,
            }
            self._note(changes)
            self._struck.emit(changes)
        return True

    def perform(self, changes: dict[str, Any], plucks: bool) -> None:
        """Applies new values of `Choices`, and plucks with them. Without `plucks` in the window's thread alone."""
        if plucks:
            self.latest = None
            self._strike(self._note(changes))
            self._struck.emit(changes)
        else:
            self._session.update(**changes)

    def _note(self, changes: dict[str, Any]) -> Choices:
        """Keeps the values of a struck note for the session; the choices with them and all notes before it."""
        with self._lock:
            after = self._session.choices.changed(self._told).changed(changes)
            self._told = {name: getattr(after, name) for name in {*self._told, *changes, "string"}}
        return after

    def _turn_patch(self, field: str, value: object) -> None:
        patch = self._session.choices.patch
        if patch is not None:
            self._session.update(patch=Patch.model_validate({**dict(patch), field: value}))

    def _tell_session(self, changes: dict[str, Any]) -> None:
        """Updates the session, once for all notes that were struck meanwhile."""
        with self._lock:
            told = self._told
        if told:
            self._session.play(**told)
            with self._lock:  # a note that was struck meanwhile has a message of its own
                self._told = {name: value for name, value in self._told.items() if told.get(name, told) != value}
            self.played.emit()

    def _press(self, press: KeyPress) -> None:
        if self.plays_pitches:
            self._press_piano(press)
            return
        played = play(press, self.reach, self._session.choices.amplitude_mm)
        if played is not None:
            self.perform(dict(played.changes), played.plucks)

    def _press_piano(self, press: KeyPress) -> None:
        choices, semitone = self._session.choices, semitone_of(press)
        if semitone is not None:
            key = LOWEST_C + 12 * choices.octave + semitone
            if 0 <= key <= HIGHEST_KEY:
                self._down[press] = key
                self.play(NoteOn(key, choices.velocity, KEYS))
        elif (turned := turn(press, choices.octave, choices.velocity)) is not None:
            self._session.update(octave=turned[0], velocity=turned[1])

    def _release(self, press: KeyPress) -> None:
        key = self._down.pop(press, None)
        if key is not None:
            self.play(NoteOff(key, KEYS))
