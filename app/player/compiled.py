"""An instrument that is played by compiled code: events and tables for `engine.voices.CompiledPlayer`."""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from app.instruments.drums import Drums
from app.instruments.instrument import Instrument, StringSet
from app.player import events
from app.player.drum_keys import DrumKeys
from app.player.events import (
    Bend,
    ControlChange,
    Event,
    InstrumentTurned,
    NoteOff,
    NoteOn,
    PluckAt,
    bend_range,
    parameter_set,
)
from app.player.strings import StringKeys
from app.player.table import programs_of, table_of, wheel_goal, wheeled
from app.shared.value import Value
from engine.kernels import constants as of
from engine.kernels import midi
from engine.kernels.midi import COARSE_TUNING, FINE_TUNING
from engine.parameters import PLAYED
from engine.presets import Preset
from engine.values.ear import Ear
from engine.voices import CompiledPlayer
from engine.voices.player import Ringing, Table

STOP_S = 0.03  # the fade of notes that are stopped or released by number
FOLLOWED = PLAYED[: of.VALUE.pickup_points_0]  # values of an instrument that strings follow by an event each
BESIDE_STRINGS = ("macros", "amp", "room")  # parts of an instrument that are not in the player's table


class InstrumentPlayer:
    """A player of one instrument. Events count with the mixer's next quantum, which reports the notes that began.

    Every public method may be called from any thread. Strings that ring follow an instrument that is taken.
    A mixer of another rate needs another player: see `again`.

    Args:
        preset: a preset of many strings.
        rate_hz: of the mixer that it is given to.
        gains: by source, "model" (what was learned) or "truth" (the solver), the factor of all its notes.
        ear: where strings are heard; None: at the instrument's own points.
        most_notes: that ring at once; the oldest makes room.
        varied: whether plucks vary from stroke to stroke, as the instrument says; the same strokes vary alike.
        keys: of this instrument and ear, where they are prepared already; None: they are prepared here.

    Attributes:
        keys: what is played: strings or drums of an instrument, and where they are heard.
        of_drums: it can hold drums; else it holds strings.
        table: `keys` as the kernels read them.
        compiled: plays events in the mixer's thread.

    Raises:
        ValueError: the preset learned one string only, or the tuning is impossible.
    """

    def __init__(
        self,
        instrument: Instrument,
        preset: Preset,
        rate_hz: int,
        gains: Mapping[str, float],
        ear: Ear | None = None,
        most_notes: int = 40,
        varied: bool = True,
        keys: StringKeys | DrumKeys | None = None,
    ) -> None:
        if not preset.info.of_many_strings:
            raise ValueError(
                f"{preset.path}: its model learned one string only; choose a preset of many, as studio_any_string"
            )
        self.preset = preset
        self.rate_hz = rate_hz
        self.grid_points = preset.info.grid_points
        self.most_notes = most_notes
        self._sources = tuple(gains)  # their order gives the kernels' numbers of them
        self.of_drums = isinstance(instrument.strings, Drums)
        self._programs = programs_of(preset, rate_hz, self._sources, self.of_drums)  # one a source
        self._lock, self._varied = threading.Lock(), varied
        self._serial = self._instrument = 0  # counts of tables, and of changes of instrument, so far
        self._wheel = 0, 0  # the modulation wheel as events have left it, and the channel that moved it
        self.table: Table | None = None
        modes = of.MOST_DRUM_MODES if self.of_drums else min(of.MOST_MODES, self.grid_points - 2)
        self.compiled = CompiledPlayer(rate_hz, modes, most_notes)
        self.set_gains(gains)
        self.keys = self.keys_of(instrument, ear) if keys is None else keys
        self.take(self.keys)

    def again(self, rate_hz: int) -> InstrumentPlayer:
        """A player of the same instrument for another mixer, with wheels and pedals as they stand here.

        It takes over the prepared keys. Notes that ring stay in this player.
        """
        gains = {source: self.compiled.source_gain(place) for place, source in enumerate(self._sources)}
        player = InstrumentPlayer(
            self.instrument, self.preset, rate_hz, gains, self.ear, self.most_notes, self._varied, self.keys
        )
        for event in self.at_hand:
            player.handle(event)
        return player

    # What is played

    @property
    def instrument(self) -> Instrument:
        return self.keys.instrument

    @property
    def ear(self) -> Ear:
        """The listening points and the pick-up of strings that are struck from now on."""
        return self.keys.ear

    @property
    def heard_through(self) -> Instrument:
        """The instrument with body and room as the modulation wheel turns them."""
        return wheeled(self.instrument, self._wheel[0], "body.", "room.")

    @property
    def at_hand(self) -> list[Event]:
        """The events that set wheels, pedals and tuning of a new player as they stand here; none for any at rest."""
        state_events: list[Event] = []
        for number in range(of.CHANNELS):
            channel = self.compiled.channel(number)
            if channel.range_semitones is not None:
                state_events += bend_range(channel.range_semitones, number)
            if channel.fine_tuning:
                steps = channel.fine_tuning + of.TUNING_STEPS
                state_events += parameter_set(FINE_TUNING, steps // 128, steps % 128, number)
            if channel.coarse_tuning:
                state_events += parameter_set(COARSE_TUNING, channel.coarse_tuning + 64, 0, number)
            if channel.bend:
                state_events.append(Bend(channel.bend, number))
            for controller, value, at_rest in (
                (midi.VOLUME, channel.volume, of.USUAL_VOLUME),
                (midi.EXPRESSION, channel.expression, 127),
                (midi.SUSTAIN, 127 * channel.pedal, 0),
                (midi.SOFT, channel.mute, 0),
                (midi.LEGATO, 127 * channel.legato, 0),
                (midi.PORTAMENTO, 127 * channel.slides, 0),
                (midi.SLIDE_TIME, channel.slide_time, 0),
                (midi.HARMONICS, 127 * channel.harmonics, 0),
                (midi.TREMOLO, 127 * channel.tremolo, 0),
                (midi.STRUM, 127 * channel.strums, 0),
                (midi.SLIDE, channel.slide, None),
            ):
                if value is not None and value != at_rest:
                    state_events.append(ControlChange(controller, value, number))
        wheel, moved_by = self._wheel
        if wheel:
            state_events.append(ControlChange(midi.MOD_WHEEL, wheel, moved_by))
        return state_events

    def set_gains(self, gains: Mapping[str, float], compared: bool = True) -> None:
        """Set the factor of each of its sources; notes that ring fade to it.

        Args:
            compared: whether notes that begin have a voice of each source, to switch while they ring.
        """
        self.compiled.set_source_gains(gains[source] for source in self._sources)
        self.compiled.set_spares(not compared)

    def keys_of(self, instrument: Instrument, ear: Ear | None = None, nearly: bool = False) -> StringKeys | DrumKeys:
        """Prepare the keys of an instrument.

        Another body takes milliseconds, in which keys are played.

        Args:
            nearly: whether keys may be as loud as through the body of the present instrument, which takes no time.

        Raises:
            ValueError: the tuning is impossible, or the instrument has drums for a player of strings, or the reverse.
        """
        ear = ear or instrument.pickup.ear
        near = self.keys if nearly else None
        if not isinstance(instrument.strings, Drums):
            if self.of_drums:
                raise ValueError(f"{instrument.name} has strings, and this player plays drums")
            return StringKeys(instrument, ear, self.preset.info, near if isinstance(near, StringKeys) else None)
        if not self.of_drums:
            raise ValueError(f"{instrument.name} has drums, of which this player of strings cannot hold the modes")
        return DrumKeys(instrument, ear, near if isinstance(near, DrumKeys) else None)

    def table_of(self, keys: StringKeys | DrumKeys) -> Table:
        """The table that the kernels read of keys, which takes milliseconds, of drums more."""
        return table_of(keys, self.grid_points, self._sources, self._programs, self._varied)

    def take(self, keys: StringKeys | DrumKeys, table: Table | None = None, frame: int = 0) -> None:
        """Play these keys, at once or from a frame on; strings that ring glide to them.

        Another instrument begins with its wheels at rest, for they may turn something else now; pedals stay.

        Args:
            table: of these keys, where it is there already; None: it is made here.
            frame: of the mixer; 0: at once.
        """
        table = table or self.table_of(keys)
        with self._lock:
            if self.table is None or is_another(keys.instrument, self.instrument):
                self._instrument += 1
                self._wheel = 0, 0
            self._serial += 1
            record = table.record
            record["serial"], record["instrument"] = self._serial, self._instrument
            self.keys, self.table = keys, table
            self.compiled.take(table, frame)

    def turn(self, keys: StringKeys | DrumKeys, frame: int = 0) -> bool:
        """Change to keys of the same instrument with turned knobs, by one event for each turned value.

        Return False, with nothing changed, where they need another table: see `take`.

        Args:
            frame: of the mixer, from which on they count; 0: at once.
        """
        with self._lock:
            values = (
                None if self.of_drums or keys.ear != self.ear else turned_values(keys.instrument, self.instrument)
            )
            if values is None:
                return False
            self.keys = keys
            for id, value in values.items():
                self.compiled.give(of.PARAMETER, key=FOLLOWED.index(id), value=value, frame=frame)
            return True

    # Events

    def silent(self, key: int) -> bool:
        """Return True if a key has nothing that sounds. Raises ValueError: it has an impossible string."""
        keys = self.keys
        return (keys.of_key(key) if isinstance(keys, DrumKeys) else keys.pitch_hz(key)) is None

    def handle(self, event: Event, frame: int = 0, struck_s: float = 0.0) -> int:
        """Hand an event over, and return its number, which the reports of a note carry.

        The number is 0 for a turned instrument, and for a pluck at a place, which no key plays.

        Args:
            frame: of the mixer, at which it counts: a note begins with it, all else within a quantum after it. 0: at
                once.
            struck_s: the device clock's time of the gesture.

        Raises:
            ValueError: a key has no possible string.
        """
        if isinstance(event, InstrumentTurned):
            keys = self.keys_of(event.instrument)
            if not self.turn(keys, frame):
                self.take(keys, frame=frame)
            return 0
        if isinstance(event, PluckAt):
            return 0
        blow = None
        if isinstance(event, NoteOn) and event.velocity > 0:
            self._check(event)
            blow = self._struck(event)
        give = partial(self.compiled.give, channel=event.channel, frame=frame)
        if isinstance(event, NoteOn):
            return give(
                of.NOTE_ON,
                key=event.key,
                value=event.velocity,
                by_hand=None if self.of_drums else event.pluck,
                struck_s=struck_s,
                struck=blow,
                string=event.string,
            )
        if isinstance(event, NoteOff):
            return give(of.NOTE_OFF, key=event.key, string=event.string)
        if isinstance(event, Bend):
            return give(of.BEND, value=event.value)
        self._follow_wheel(event)
        return give(of.CONTROLLER, key=event.number, value=event.value)

    def _check(self, event: NoteOn) -> None:
        """Raise ValueError if none of the strings on which a note may play its key is possible."""
        string = event.channel if event.string is None else event.string  # its own, or that of its channel, if any
        if event.string is not None or string < _strings_by_channel(self.instrument):
            with contextlib.suppress(ValueError):
                self.keys.of_key(event.key, string)
                return
        self.keys.of_key(event.key)

    def _struck(self, event: NoteOn) -> NDArray[np.float64] | None:
        """The speeds (modes,) that a blow of 1 N s at the note's own place gives to a drum's modes.

        None: the drum is struck at its usual place, or there is no drum.
        """
        if event.place is None or not isinstance(self.keys, DrumKeys):
            return None
        drum_key = self.keys.of_key(event.key)
        return None if drum_key is None else drum_key.struck(event.place)

    def _follow_wheel(self, event: ControlChange) -> None:
        """Keep the modulation wheel's position and channel, for `heard_through`; a reset puts it to rest.

        The reset counts on the channel that moved the wheel, and in MPE on the master channel too.
        """
        moved_by = self._wheel[1]
        if event.number == midi.MOD_WHEEL:
            self._wheel = event.value, event.channel
        elif event.number == midi.RESET:
            master = self.instrument.mode == "mpe" and event.channel == of.FIRST and moved_by != events.KEYS
            if event.channel == moved_by or master:
                self._wheel = 0, moved_by

    def cancel(self, note: int = 0) -> None:
        """Forget the events whose frames are still to come; `note`: of one note alone, by its number; 0: of all."""
        self.compiled.give(of.CANCEL, note=note)

    def stop(self, seconds: float = STOP_S) -> None:
        """Let all strings fade out."""
        self.compiled.give(of.STOP, value=seconds)

    def release(self, note: int, seconds: float = STOP_S, frame: int = 0) -> None:
        """Let one note fade out, by its number, from a frame on."""
        self.compiled.give(of.CHOKE, of.ANY, of.ANY, seconds, frame, note=note)

    def slid(self, note: Ringing) -> float:
        """The semitones above its key where a note's string is stopped now, as while it slides; 0 for a drum."""
        keys = self.keys
        if note.length_m is None or isinstance(keys, DrumKeys):
            return 0.0
        with contextlib.suppress(ValueError):  # reported when it is struck
            key_string = keys.of_key(note.key, note.string if note.string >= 0 else None)
            return 0.0 if key_string is None else 12 * math.log2(key_string.parameters.length_m / note.length_m)
        return 0.0


def turned_values(instrument: Instrument, than: Instrument) -> dict[str, float] | None:
    """The new values, by parameter id, in which an instrument differs from another, for one event each.

    None: it differs also in what no event can change, or in the value at the modulation wheel's end. BESIDE_STRINGS
    are left out.
    """
    values: dict[str, float] = {}
    for name in Instrument.model_fields:
        part, other = getattr(instrument, name), getattr(than, name)
        if part == other or name in BESIDE_STRINGS:
            continue
        fields = vars(part) if isinstance(part, Value) and type(part) is type(other) else {}
        ids = [f"{name}.{field}" for field, value in fields.items() if value != getattr(other, field)] or [name]
        if not set(ids) <= set(FOLLOWED):
            return None
        if instrument.mod_wheel.partition(".")[0] == name and wheel_goal(instrument) != wheel_goal(than):
            return None
        values |= {id: instrument.value(id) for id in ids}
    return values


def is_another(instrument: Instrument, than: Instrument) -> bool:
    """Return True if an instrument is another one. The same with a knob turned, or under a new name, is not."""
    return instrument.name != than.name and instrument.model_copy(update={"name": than.name}) != than


def _strings_by_channel(instrument: Instrument) -> int:
    """The number of strings that MIDI channels may choose, one each; 0 where the instrument is not in guitar mode."""
    by_channel = instrument.mode == "guitar" and isinstance(instrument.strings, StringSet)
    return min(of.GUITAR_STRINGS, len(instrument.strings.strings)) if by_channel else 0  # type: ignore[union-attr]
