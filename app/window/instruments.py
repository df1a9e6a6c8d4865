"""The computer's keys and MIDI, connected to the sound, the session and the window."""

from __future__ import annotations

import contextlib
import math
import threading
from dataclasses import asdict, replace
from typing import Any

from PySide6.QtCore import QObject, Qt, QTimer, Signal

from app.instrument.compiled import is_another
from app.instrument.events import KEYS, Event, NoteOff, NoteOn, PluckAt
from app.instrument.strings import Strings, on_string
from app.patches.drums import Drums
from app.patches.patch import Patch, StringSet
from app.playing.key_note import KeyNote
from app.playing.keyboard import LOWEST_C, LOWEST_PLACE, KeyPress, PluckRange, place_of, semitone_of, turn
from app.playing.midi import MidiChoices
from app.playing.note import PluckVoices
from app.playing.playback import Due
from app.presets.library import Library
from app.rendering import RenderRequest
from app.rendering.note_sound import Struck
from app.rendering.subject import string_of
from app.session.choices import Session, ShownString
from app.session.slots import other_preset
from app.views.controls.playing_keys import PlayingKeys
from app.window.main_window import MainWindow
from app.window.midi_control import MidiControl
from app.window.performance import Performance
from engine.pluck import Pluck
from engine.values.string import StringParameters

HIGHEST_KEY = 127
OWN_MS = 60  # after another instrument, or the last turn of a knob, until its own pluck is shown


class Instruments(QObject):
    """The player of events, at once in the thread of each; session and window follow later.

    Attributes:
        latest: the note that was begun last; None before the first.
        latest_key: the key of a patch that was struck or restored last, and its string of the set, as in `KeyNote`;
            None before the first.
    """

    played = Signal()  # a note has begun, and the session has its values
    begun = Signal()  # a note; emitted in any thread

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
        self._performance = performance
        self.latest_key: tuple[int, int | None] | None = None
        self._lock = threading.Lock()
        self._reported: dict[str, Any] = {}  # values of `Choices` of notes, not in the session yet
        self.latest: PluckVoices | KeyNote | None = None
        self._shown: Patch | None = None  # the instrument whose string is shown
        self._chosen: frozenset[str] = frozenset()  # of string and pluck with an instrument that is not shown yet
        self._own_timer = QTimer(self, interval=OWN_MS, singleShot=True)
        self._own_timer.timeout.connect(self._show_own_string)
        self._unknown: KeyNote | None = None  # the latest, which the player has not reported yet
        self._drawn = False  # whether its pluck is the session's
        self._down: dict[KeyPress, int] = {}  # the computer's keys, and what they play
        self.begun.connect(self._tell_session, Qt.ConnectionType.QueuedConnection)
        self._keys = PlayingKeys(window)
        self._keys.pressed.connect(self._press)
        self._keys.released.connect(self._release)
        self.midi = MidiControl(midi, self.play, self._play_note, self)
        self.midi.performed.connect(lambda changes: session.update(**changes))
        self.midi.reported.connect(window.notices.report)
        self.midi.informed.connect(window.notices.inform)

    def close(self) -> None:
        self._own_timer.stop()
        self.midi.close()

    @property
    def reach(self) -> PluckRange:
        """The positions and amplitudes that keys pluck with: what the preset was trained on."""
        entry = self._library.find(self._session.choices.preset)
        return PluckRange.of(entry.info if entry else None)

    def choices_changed(self, names: frozenset[str]) -> None:
        self._keys.piano = self._session.choices.plays_patch
        self.midi.show_patch(self._session.choices.patch)
        if names & {"patch", "single"}:
            self._chosen |= names & ShownString.model_fields.keys()
            self._own_timer.start()

    def _show_own_string(self) -> None:
        """Show string and pluck of an instrument before it is played, and its pluck when that is turned.

        What was chosen with the instrument stays, as what undo or a file restores.
        """
        self._own_timer.stop()
        fields, self._chosen = self._chosen, frozenset()
        choices, before = self._session.choices, self._shown
        patch = choices.instrument
        self._shown = patch if isinstance(patch, Patch) else None
        if not isinstance(patch, Patch) or isinstance(patch.strings, Drums):
            return
        another = before is not None and is_another(patch, before)
        takes_string = choices.string is None or (another and "string" not in fields)
        if choices.string is not None and not takes_string and (another or before is None):
            self.latest_key = _key_of(patch, choices.string) or self.latest_key
        if not takes_string and (before is None or patch.pluck == before.pluck or (another and fields - {"string"})):
            return
        with contextlib.suppress(ValueError):  # an impossible string is reported when its key is struck
            if (key_string := Strings(patch).of_key(*self.shown_key(patch))) is not None:
                changes = asdict(on_string(key_string, patch.pluck.pluck(choices.velocity)))
                self._session.play(**changes, **({"string": key_string.parameters} if takes_string else {}))

    def play(self, event: Event, due: Due | None = None, drawn: bool = False) -> None:
        """Play an event, at once or when it is due. Any thread. `drawn`: its pluck is the one of the session."""
        note = self._performance.handle(event, due)
        if note is None:
            return
        self.latest = note
        if isinstance(note, KeyNote):
            with self._lock:
                self._unknown, self._drawn = note, drawn
            self.latest_key = note.event.key, note.event.string
        else:
            self._unknown = None
            self._show_in_session(note.request, drawn)
        self.begun.emit()

    def _show_in_session(self, request: RenderRequest, drawn: bool) -> None:
        """Show this string and its pluck in the session; the string alone where it has drawn the pluck itself."""
        string = string_of(request.preset)
        changes: dict[str, Any] = {"string": string}
        changes |= {} if drawn else asdict(request.pluck)
        with self._lock:
            self._reported |= changes

    @property
    def drum_key(self) -> int | None:
        """The key of the drum that is shown and struck: the latest, or the lowest; None: no drum is played."""
        drums, patch = self._session.choices.drums, self._session.choices.patch
        if drums is None or patch is None:
            return None
        (low, high), latest = patch.range, -1 if self.latest_key is None else self.latest_key[0]
        if low <= latest <= high and drums.of_key(latest) is not None:
            return latest
        return min(max(drums.drums[0].note, low), high)

    def shown_key(self, patch: Patch) -> tuple[int, int | None]:
        """The key whose string is shown: the one struck last, on its string, or the middle of the patch's range."""
        (low, high), latest = patch.range, self.latest_key
        return latest if latest is not None and low <= latest[0] <= high else ((low + high) // 2, None)

    def by_hand(self, pluck: Pluck | None = None) -> NoteOn | PluckAt:
        """A pluck, by default the chosen one, as a note of the key whose string is shown.

        It is of the string alone where keys do not play it so: of a single string, and beside another preset.
        """
        choices = self._session.choices
        pluck = pluck or choices.pluck
        patch, alone = choices.instrument, PluckAt(pluck)
        if not isinstance(patch, Patch) or isinstance(patch.strings, Drums) or pluck.amplitude_mm == 0:
            return alone
        if any(other_preset(voice) for voice in choices.voices):
            return alone
        key, number = self.shown_key(patch)
        try:
            string = Strings(patch).of_key(key, number)
        except ValueError:  # reported when its key is struck
            return alone
        if string is None:
            return alone
        velocity = patch.pluck.velocity_of(pluck.amplitude_mm / string.shortened)
        return NoteOn(key, velocity, KEYS, string=number, pluck=pluck)

    def pluck(self) -> None:
        """Pluck the string that is shown as it is chosen."""
        if self._own_timer.isActive():
            self._show_own_string()
        self.play(self.by_hand(), drawn=True)

    @property
    def struck(self) -> Struck | None:
        """The key of the instrument that an export and the listening test play: the latest, else the one shown.

        After a pluck by hand it is the pluck that is shown. None: a string is plucked by itself.
        """
        choices = self._session.choices
        latest = self.latest
        drum = self.drum_key
        patch = choices.instrument
        if not isinstance(patch, Patch):
            return None
        event: NoteOn | PluckAt
        if isinstance(latest, KeyNote) and latest.patch.name == patch.name and latest.event.pluck is None:
            event = latest.event
        elif drum is not None:
            event = NoteOn(drum, choices.velocity, KEYS)
        else:
            event = self.by_hand()
        return Struck(patch, event) if isinstance(event, NoteOn) else None

    def strike(self, x: float, y: float, velocity: float) -> None:
        """Strike the drum that is shown at a place, from its centre in half-lengths; velocity: 1 … 127."""
        if (key := self.drum_key) is not None:
            self.play(NoteOn(key, round(min(max(velocity, 1.0), 127.0)), KEYS, (x, y)))
            self.play(NoteOff(key, KEYS))

    def _play_note(self, event: NoteOn, mode: str) -> None:
        """Play a note of MIDI that says where the string is plucked, or which preset. In the input's thread."""
        pluck, reach = self._session.choices.pluck, self.reach
        if mode == "position":
            pluck = reach.pluck(event.key, event.velocity, pluck)
        elif names := self._library.names:
            name = names[(event.key - LOWEST_PLACE) % len(names)]
            pluck = replace(pluck, amplitude_mm=reach.amplitude_of(event.velocity))
            self._performance.play_preset(name)
            with self._lock:
                self._reported |= {"single": name}
            self.play(PluckAt(pluck))
            return
        self.play(self.by_hand(pluck))

    def look(self) -> None:
        """Take the string and the pluck of a key from the player's report, within a quantum of the device."""
        note = self._unknown
        if note is None:
            return
        self._performance.notes.look()
        if not note.known:
            return
        with self._lock:
            if self._unknown is not note:  # another was begun just now
                return
            self._unknown = None
        if note is not self.latest or not self._session.choices.plays_patch:
            return  # another pluck was begun, or a single string chosen, meanwhile
        self.latest_key = note.event.key, note.string
        if note.request is not None:
            self._show_in_session(note.request, self._drawn)
            self._tell_session()
        elif note.of_drum:
            self.played.emit()

    def _tell_session(self) -> None:
        """Update the session, once for all notes that have begun meanwhile."""
        self.look()
        with self._lock:
            changes = self._reported
            self._reported = {}
        if changes:
            self._session.play(**changes)
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
        elif (step := turn(press, choices.octave, choices.velocity)) is not None:
            self._session.update(octave=step[0], velocity=step[1])

    def _release(self, press: KeyPress) -> None:
        key = self._down.pop(press, None)
        if key is not None:
            self.play(NoteOff(key, KEYS))


def _key_of(patch: Patch, string: StringParameters) -> tuple[int, int | None] | None:
    """The key with the pitch of a string, and the string of a set on which it has its length. None: there is none."""
    strings, pitch_hz = Strings(patch), string.pitch_hz
    low, high = patch.range
    key = next((key for key in range(low, high + 1) if _nearly_equal(strings.pitch_hz(key) or 0.0, pitch_hz)), None)
    if key is None:
        return None
    for number in (None, *range(len(patch.strings.strings) if isinstance(patch.strings, StringSet) else 0)):
        with contextlib.suppress(ValueError):  # reported when it is struck
            key_string = strings.of_key(key, number)
            if key_string is not None and _nearly_equal(key_string.parameters.length_m, string.length_m):
                return key, number
    return key, None


def _nearly_equal(value: float, other: float) -> bool:
    """Return True if values are equal within rounding, for the player computes strings too."""
    return math.isclose(value, other, rel_tol=1e-6)
