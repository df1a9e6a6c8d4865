"""The computer's keys and MIDI, connected to the sound, the session and the window."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal

from app.instrument.events import KEYS, Event, NoteOff, NoteOn, PluckAt
from app.patches.instrument import SingleString
from app.patches.patch import PhysicalString
from app.playing.due import Due
from app.playing.keyboard import LOWEST_C, LOWEST_PLACE, KeyPress, Reach, place_of, semitone_of, turn
from app.playing.midi import MidiChoices
from app.playing.note import Note
from app.presets.library import Library
from app.rendering.subject import string_of
from app.session.choices import Session
from app.views.controls.playing_keys import PlayingKeys
from app.window.main_window import MainWindow
from app.window.midi_control import MidiControl

HIGHEST_KEY = 127


class Instruments(QObject):
    """Plays events at once, in the thread of each; the session, and with it the window, follows later.

    Args:
        handle: plays an event and returns the note that it began; called in the event's thread.
        play_preset: lets events pluck the string of a preset, by its name; called in the event's thread.

    Attributes:
        latest: the note that was begun last; None before the first.
        latest_key: the key of a patch that was struck last, and on which string of its set, as in `Struck`; None
            before the first.
    """

    played = Signal()  # a note has begun, and the session has its values
    told = Signal(str)  # an error, for the user

    _begun = Signal()  # emitted in any thread

    def __init__(
        self,
        window: MainWindow,
        session: Session,
        library: Library,
        midi: MidiChoices,
        handle: Callable[[Event, Due | None], Note | None],
        play_preset: Callable[[str], None],
    ) -> None:
        super().__init__(window)
        self._session = session
        self._library = library
        self._handle, self._play_preset = handle, play_preset
        self.latest_key: tuple[int, int | None] | None = None
        self._lock = threading.Lock()
        self._told: dict[str, Any] = {}  # values of `Choices` of notes, not in the session yet
        self.latest: Note | None = None
        self._down: dict[KeyPress, int] = {}  # the computer's keys, and what they play
        self._begun.connect(self._tell_session, Qt.ConnectionType.QueuedConnection)
        self._keys = PlayingKeys(window)
        self._keys.pressed.connect(self._press)
        self._keys.released.connect(self._release)
        self.midi = MidiControl(midi, self.play, self._play_note, self)
        self.midi.performed.connect(lambda changes: session.update(**changes))
        self.midi.told.connect(self.told)

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

    def choices_changed(self) -> None:
        self._keys.piano = self._session.choices.plays_patch
        self.midi.show_patch(self._session.choices.patch)

    def play(self, event: Event, due: Due | None = None) -> None:
        """Plays an event, at once or when it is due. Any thread."""
        note = self._handle(event, due)
        if note is None:
            return
        self.latest = note
        if note.struck is not None:
            self.latest_key = note.struck.event.key, note.struck.string
        string = string_of(note.request.preset)
        shown = {"string": None if string is None else PhysicalString(**asdict(string)), **asdict(note.request.pluck)}
        with self._lock:
            self._told |= shown
        self._begun.emit()

    def _play_note(self, event: NoteOn, mode: str) -> None:
        """Plays a note of MIDI that says where the string is plucked, or which preset. In the input's thread."""
        pluck, reach = self._session.choices.pluck, self.reach
        if mode == "position":
            pluck = reach.pluck(event.key, event.velocity, pluck)
        elif names := self._library.names:
            name = names[(event.key - LOWEST_PLACE) % len(names)]
            pluck = replace(pluck, amplitude_mm=reach.amplitude_of(event.velocity))
            self._play_preset(name)
            with self._lock:
                self._told |= {"instrument": SingleString(preset=name)}
        self.play(PluckAt(pluck))

    def _tell_session(self) -> None:
        """Updates the session, once for all notes that have begun meanwhile."""
        with self._lock:
            told = self._told
            self._told = {}
        if told:
            self._session.play(**told)
            self.played.emit()

    def _press(self, press: KeyPress) -> None:
        choices = self._session.choices
        if choices.plays_patch:
            self._press_piano(press)
            return
        if (place := place_of(press)) is not None:
            self.play(PluckAt(replace(choices.pluck, position=self.reach.row[place])))
        elif (amplitude_mm := self.reach.turned(press, choices.amplitude_mm)) is not None:
            self._session.update(amplitude_mm=amplitude_mm)

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
