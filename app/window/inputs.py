"""The computer's keys and MIDI, connected to the sound, the session and the window."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from PySide6.QtCore import QObject, Signal

from app.player.events import KEYS, Event, NoteOff, NoteOn, PluckAt
from app.playing.keyboard import LOWEST_C, LOWEST_PLACE, KeyPress, PluckRange, place_of, semitone_of, turn
from app.playing.midi import MidiChoices
from app.playing.playback import Due
from app.presets.library import Library
from app.stage.session import Session
from app.stage.stage import Begun
from app.views.controls.playing_keys import PlayingKeys
from app.window.main_window import MainWindow
from app.window.midi_control import MidiControl
from app.window.performance import Performance

HIGHEST_KEY = 127  # of MIDI


class Inputs(QObject):
    """The player of events, at once in the thread of each; session and window follow later."""

    begun = Signal()  # a note; emitted in any thread
    _chosen = Signal(dict)  # values of `Choices` that a note of MIDI brings; emitted in the input's thread

    def __init__(
        self,
        window: MainWindow,
        session: Session,
        library: Library,
        midi: MidiChoices,
        performance: Performance,
    ) -> None:
        super().__init__(window)
        self._session = session
        self._library = library
        self._performance, self._notes = performance, performance.notes
        self._down: dict[KeyPress, int] = {}  # the computer's keys that are held, and the MIDI keys that they play
        self.begun.connect(self.look)  # at once, or from another thread in the window's
        self._chosen.connect(self._take_values)
        self._keys = PlayingKeys(window)
        self._keys.pressed.connect(self._press)
        self._keys.released.connect(self._release)
        self.midi = MidiControl(midi, self.play, self._play_note, self)
        self.midi.performed.connect(lambda changes: session.update(**changes))
        self.midi.reported.connect(window.notices.report)
        self.midi.informed.connect(window.notices.inform)

    def close(self) -> None:
        self.midi.close()

    @property
    def reach(self) -> PluckRange:
        """The positions and amplitudes that keys pluck with: what the preset was trained on."""
        entry = self._library.find(self._session.choices.preset)
        return PluckRange.of(entry.info if entry else None)

    def choices_changed(self, names: frozenset[str]) -> None:
        self._keys.piano = self._session.choices.plays_instrument
        self.midi.show_instrument(self._session.choices.instrument)

    def play(self, event: Event, due: Due | None = None) -> None:
        """Play an event, at once or when it is due. Any thread."""
        if self._notes.handle(event, due) is not None:
            self.begun.emit()

    def look(self) -> None:
        """Tell the session of the latest note, and of its string and pluck, which are reported within a quantum."""
        note, stage = self._notes.latest, self._session.stage
        if note is not None and not (note is stage.note and stage.known):
            self._notes.look()
            self._session.send(Begun(note))

    def pluck(self) -> None:
        """Pluck the string that is shown as it is chosen."""
        self.play(self._session.stage.by_hand())

    def strike(self, x: float, y: float, velocity: float) -> None:
        """Strike the drum that is shown at a place, from its centre in half-lengths; velocity: 1 … 127."""
        if (key := self._session.stage.drum_key) is not None:
            self.play(NoteOn(key, round(min(max(velocity, 1.0), 127.0)), KEYS, (x, y)))
            self.play(NoteOff(key, KEYS))

    def _play_note(self, event: NoteOn, mode: str) -> None:
        """Pluck a single string by a note of MIDI; called in the input's thread.

        Args:
            mode: "position": the key sets the place along the string; otherwise it selects the preset.
        """
        pluck, reach = self._session.choices.pluck, self.reach
        if mode == "position":
            pluck = reach.pluck(event.key, event.velocity, pluck)
            self._chosen.emit({"pluck": pluck})
        elif names := self._library.names:
            name = names[(event.key - LOWEST_PLACE) % len(names)]
            self._performance.play_preset(name)
            self._chosen.emit({"single": name})
            self.play(PluckAt(replace(pluck, amplitude_mm=reach.amplitude_of(event.velocity))))
            return
        self.play(self._session.stage.by_hand(pluck))

    def _take_values(self, values: dict[str, Any]) -> None:
        self._session.play(**values)

    def _press(self, press: KeyPress) -> None:
        """Play the instrument by a key of the computer; else pluck at one of ten places, or change the amplitude."""
        choices = self._session.choices
        if choices.plays_instrument:
            self._press_piano(press)
            return
        if (place := place_of(press)) is not None:
            self.play(PluckAt(replace(choices.pluck, position=self.reach.row[place])))
        elif (amplitude_mm := self.reach.turned(press, choices.pluck.amplitude_mm)) is not None:
            self._session.update(amplitude_mm=amplitude_mm)

    def _press_piano(self, press: KeyPress) -> None:
        """Take a key of the computer as a key of a piano; other keys change octave and velocity."""
        choices, semitone = self._session.choices, semitone_of(press)
        if semitone is not None:
            key = LOWEST_C + 12 * choices.octave + semitone
            if 0 <= key <= HIGHEST_KEY:
                self._down[press] = key
                self.play(NoteOn(key, choices.velocity, KEYS))
        elif (step := turn(press, choices.octave, choices.velocity)) is not None:
            self._session.update(octave=step[0], velocity=step[1])

    def _release(self, press: KeyPress) -> None:
        key = self._down.pop(press, None)
        if key is not None:
            self.play(NoteOff(key, KEYS))
