"""The sound of an instrument's keys, prepared in the background: its preset, its table, body and room.

Events go to the compiled player as numbers, which the device's next quantum takes up; its reports come back.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from app.instruments.drums import Drums
from app.instruments.instrument import Instrument
from app.player.compiled import InstrumentPlayer, is_another
from app.player.drum_keys import DrumKeys
from app.player.effects import body_problem, effects_of
from app.player.events import SWITCHES, ControlChange, Event, InstrumentTurned, NoteOff, NoteOn, moves_effects
from app.player.strings import StringKeys
from app.playing.key_note import AS_THEY_ARE, KeyNote, drop
from app.playing.playback import Due
from app.playing.recorder import EventRecorder
from app.playing.sources import Sources
from app.presets.library import PresetEntry
from engine.effects import Effects
from engine.kernels.constants import BEGAN
from engine.kernels.midi import NOTES_OFF, RESET, SOUND_OFF, SUSTAIN
from engine.values.ear import Ear
from engine.voices import Mixer

RELEASES = (SUSTAIN, SOUND_OFF, NOTES_OFF)  # controllers that may end what rings
SEEN_DB = 70.0  # below full scale: softer strings do not light their keys
STANDS_S = 0.5  # the output stands if it takes no frame for so long, which is longer than any of its buffers


@dataclass(frozen=True)
class SoundingNote:
    """A note that rings.

    Attributes:
        level: 0 at SEEN_DB below full scale, 1 at full scale.
        string: on which of a set it is played, from the highest, 0; -1: the key chooses.
        slid: how many semitones above its key the string is stopped, as by a slide.
    """

    key: int
    level: float
    string: int = -1
    slid: float = 0.0


@dataclass(frozen=True, eq=False)
class _Wanted:
    """The instrument that keys are to play, and where it is heard."""

    instrument: Instrument
    ear: Ear


class Keys:
    """The keys of an instrument, and its notes. Every public method may be called from any thread.

    The instrument that is wanted (the wish) is played by a player in the present mixer. Notes of earlier players ring
    on in theirs. A key waits for no knob. A turned instrument is played at once, as loud as through the body before.
    Another body is computed in the background. Nothing that takes milliseconds is computed under a lock.

    Args:
        find: a preset by its name; None where there is none.
        mixer: the present one.
        in_background: does work in another thread.
        report: is called with a message and its details where something cannot be played; in any thread.
        set_effects: sets body and room of all that is heard; called in a background thread.

    Attributes:
        recorder: of the events that are played, and of the instrument as it is turned.
        player: of the keys; None: no instrument, or its preset is not loaded yet.
    """

    def __init__(
        self,
        sources: Sources,
        find: Callable[[str], PresetEntry | None],
        mixer: Callable[[], Mixer],
        in_background: Callable[[Callable[[], None]], None],
        report: Callable[[str, str], None],
        set_effects: Callable[[Effects | None], None],
    ) -> None:
        self._sources = sources
        self._find = find
        self._mixer = mixer
        self._in_background = in_background
        self._report = report
        self._set_effects = set_effects
        self.recorder = EventRecorder(report)
        self._lock = threading.RLock()
        self.player: InstrumentPlayer | None = None
        self._in: Mixer | None = None  # the mixer that `player` plays in
        self._playing: list[InstrumentPlayer] = []  # `player`, and earlier ones whose notes may ring
        self._gains: Mapping[str, float] = AS_THEY_ARE  # by source
        self._compared = True  # notes that begin have a voice of each source
        self._notes: dict[tuple[InstrumentPlayer, int], KeyNote] = {}  # by player and number of the event
        self._wanted: _Wanted | None = None  # None: no instrument
        self._completed: _Wanted | None = None  # the latest wish for which all is computed, or tried
        self._path = Path()  # the file of the player's preset
        self._effects: Effects | None = None  # as they were set last
        self._dry = False  # body and room are left out
        self._switches: dict[tuple[int, int], ControlChange] = {}  # the latest by channel, which players take over
        self._frames, self._moved_s = -1, 0.0  # of the mixer when it was last seen to move, and when that was
        self._reported_body = ""  # the fault of the body that was reported last

    def set_instrument(self, instrument: Instrument | None, ear: Ear) -> None:
        """Set the instrument that keys play from now on, and where it is heard.

        Strings that ring follow, if the preset is the same.

        Another preset, and drums after strings, are loaded in the background; until then keys are silent. None: no
        instrument.
        """
        with self._lock:
            player = self.player
            if instrument is None or (player is not None and not _can_play(player, instrument)):
                self.player = None
            self._wanted = None if instrument is None else _Wanted(instrument, ear)
        self._follow_wish()

    def listen(self, ear: Ear) -> None:
        """Set the place where keys are heard from now on."""
        with self._lock:
            if self._wanted is None:
                return
            self._wanted = _Wanted(self._wanted.instrument, ear)
            if self.player is None:  # it is being loaded, or cannot be
                return
        self._follow_wish()

    def set_gains(self, gains: Mapping[str, float], compared: bool) -> None:
        """Set the factor of each source, see `InstrumentPlayer.set_gains`."""
        with self._lock:
            self._gains, self._compared = gains, compared
            for player in self._playing:
                player.set_gains(gains, compared)

    def handle(
        self, event: Event, due: Due | None, struck_s: float, begun: Callable[[KeyNote], None]
    ) -> KeyNote | None:
        """Play an event, at once or when it is due; the note of a key that is struck, or None.

        Args:
            due: None: at once.
            struck_s: the device clock's time of the gesture; 0: it is none.
            begun: is called with the note; under the lock, so that notes of a key keep their order.
        """
        with self._lock:
            if isinstance(event, ControlChange):
                self._note_switch(event)
            player, mixer = self._present(), self._mixer()
            frame = 0 if due is None else due.frame_in(mixer)
            self._release_before(event, frame)
            if player is None:
                return None
            self.recorder.take(event, None if due is None else due.time_s)
            note_on, id = event if isinstance(event, NoteOn) and event.velocity > 0 else None, 0
            try:
                if note_on is None or not player.silent(note_on.key):
                    id = player.handle(event, frame, struck_s)
            except ValueError as error:
                self._report(str(error), "")
            if isinstance(event, ControlChange) and moves_effects(event, player.instrument):
                self._in_background(self._set_present_effects)
            if note_on is None or not id:
                return None
            note = self._notes[player, id] = KeyNote(player, mixer, id, note_on, self._path, frame)
            begun(note)
            return note

    def _release_before(self, event: Event, frame: int) -> None:
        """Give a release of a key or a pedal to earlier players too, whose notes may still ring. Under the lock."""
        released = isinstance(event, NoteOff) or (isinstance(event, ControlChange) and event.number in RELEASES)
        for player in self._playing if released else []:
            if player is not self.player:
                player.handle(event, frame)

    def _note_switch(self, event: ControlChange) -> None:
        """Remember the state of one of SWITCHES for later players; a reset forgets those of its channel."""
        if event.number in SWITCHES:
            self._switches[event.number, event.channel] = event
        elif event.number == RESET:
            self._switches = {at: switch for at, switch in self._switches.items() if switch.channel != event.channel}

    def look(self) -> list[KeyNote]:
        """Take over the players' reports; return the notes that began since the last call. Any thread."""
        begun_notes = []
        with self._lock:  # a note is known before its report is read
            for player in self._playing:
                for report in player.compiled.reports():
                    note = self._notes.get((player, report.id))
                    if note is None:
                        continue
                    try:
                        note.take(report)
                    except Exception as error:
                        drop(note, error, self._report)
                    if note.over:
                        del self._notes[player, report.id]
                    elif report.kind == BEGAN:
                        begun_notes.append(note)
                ids = [id for owner, id in self._notes if owner is player]
                for id in player.compiled.missing(ids):
                    self._notes.pop((player, id)).end()
            self._notes = {key: note for key, note in self._notes.items() if not note.over}
            with_notes = {player for player, _ in self._notes}
            self._playing = [player for player in self._playing if player is self.player or player in with_notes]
        return begun_notes

    def cancel(self) -> None:
        """Cancel the events that were handed over and are not due yet."""
        with self._lock:
            if self.player is not None:
                self.player.cancel()
            self.recorder.cancel()

    def stop(self, seconds: float) -> None:
        """Let all strings fade out, also those that ring in sympathy."""
        with self._lock:
            for player in self._playing:
                player.stop(seconds)

    def sounding(self) -> dict[int, float]:
        """Key -> how loud its string rings: 0 at SEEN_DB below full scale, 1 at full scale."""
        levels: dict[int, float] = {}
        for note in self.sounding_notes():
            levels[note.key] = max(levels.get(note.key, 0.0), note.level)
        return levels

    def sounding_notes(self) -> list[SoundingNote]:
        """The notes that ring, with their strings; none while the output stands."""
        player, mixer = self.player, self._mixer()
        if player is None or self._in is not mixer or self._mixer_stands(mixer):
            return []
        return [
            SoundingNote(note.key, min(max(1 + note.level_db / SEEN_DB, 0.0), 1.0), note.string, player.slid(note))
            for note in player.compiled.ringing()
        ]

    def _mixer_stands(self, mixer: Mixer) -> bool:
        """Return True if the output has taken no frame for STANDS_S."""
        now_s, frames = time.monotonic(), mixer.frames
        if frames != self._frames:
            self._frames, self._moved_s = frames, now_s
        return now_s - self._moved_s > STANDS_S

    @property
    def heard_through(self) -> Instrument | None:
        """The instrument whose body and room are heard, as controllers have turned them."""
        if self.player is not None:
            return self.player.heard_through
        return None if self._wanted is None else self._wanted.instrument

    def begin_recording(self, beat_s: float | None = None) -> None:
        """Record events from now on, after wheels and pedals as they stand; `beat_s`: as of `EventRecorder.begin`."""
        with self._lock:
            player = self.player
            self.recorder.begin([] if player is None else [_turned_event(player), *player.at_hand], beat_s)

    def hear_dry(self, dry: bool) -> None:
        """Leave out body and room, or not, as while models are compared with the truth."""
        if dry != self._dry:
            self._dry = dry
            self._in_background(self._set_present_effects)  # an impulse response takes milliseconds

    # In the background

    def _set_present_effects(self) -> None:
        """Set body and room of what is played now, if they have changed; report once a body that cannot be used."""
        instrument = self.heard_through
        effects = None if self._dry or instrument is None else effects_of(instrument)
        if effects != self._effects:
            self._effects = effects
            self._set_effects(effects)
        problem, reported_before = body_problem(instrument) if instrument is not None else "", self._reported_body
        self._reported_body = problem
        if problem and problem != reported_before:
            self._report(problem, "")

    def _present(self) -> InstrumentPlayer | None:
        """The player in the present mixer; where that has changed, a new one with strings at rest. Under the lock."""
        player, mixer = self.player, self._mixer()
        if player is not None and mixer is not self._in:
            self._set_player(player.again(mixer.rate_hz), mixer)
        return self.player

    def _set_player(self, player: InstrumentPlayer, mixer: Mixer) -> None:
        """Let keys play a player. Under the lock."""
        player.set_gains(self._gains, self._compared)
        mixer.set_player(player.compiled)
        self.player, self._in = player, mixer
        self._playing.append(player)

    def _follow_wish(self) -> None:
        """Play what is wanted: strings at once, nearly as loud as they should be, and all else in the background."""
        wanted, player = self._wanted, self.player
        if wanted is not None and player is not None and not player.of_drums:
            self._load_wanted(player, wanted, nearly=not is_another(wanted.instrument, player.instrument))
        self._in_background(self._complete)

    def _complete(self) -> None:
        """Compute all that keys need to play what is wanted now, which may take seconds; in the background."""
        wanted, player = self._wanted, self.player
        if wanted is not None and wanted is not self._completed:
            self._completed = wanted
            if player is None:
                self._begin(wanted)
            else:
                self._load_wanted(player, wanted)
        self._set_present_effects()

    def _load_wanted(self, player: InstrumentPlayer, wanted: _Wanted, nearly: bool = False) -> None:
        """Let a player play what is wanted, unless something else is by now; report where it cannot.

        Args:
            nearly: as in `InstrumentPlayer.keys_of`.
        """
        try:
            keys = player.keys_of(wanted.instrument, wanted.ear, nearly)
            if isinstance(keys, DrumKeys) and not self._compute_drums(keys):
                return
            if nearly and self._turn(player, wanted, keys):
                return
            table = player.table_of(keys)
        except ValueError as error:
            with self._lock:
                if wanted is self._wanted:  # what is played stays
                    self._wanted = self._completed = _Wanted(player.instrument, player.ear)
            self._report(str(error), "")
            return
        with self._lock:
            if wanted is self._wanted and player is self.player:
                is_outdated = (player.instrument, player.ear) != (wanted.instrument, wanted.ear)
                player.take(keys, table)
                if is_outdated:
                    self.recorder.take(_turned_event(player))

    def _turn(self, player: InstrumentPlayer, wanted: _Wanted, keys: StringKeys | DrumKeys) -> bool:
        """Play the wanted keys by an event for each turned knob.

        Return True if this is done or no longer wanted; False: these keys need another table.
        """
        with self._lock:
            if wanted is not self._wanted or player is not self.player:
                return True
            played, completed = _Wanted(player.instrument, player.ear), self._completed
            if not player.turn(keys):
                return False
            if completed is not None and (completed.instrument, completed.ear) == (played.instrument, played.ear):
                self._completed = wanted  # nothing is left for the background
            if wanted.instrument != played.instrument:
                self.recorder.take(_turned_event(player))
            return True

    def _compute_drums(self, keys: DrumKeys) -> bool:
        """Compute an instrument's drums, which takes up to seconds; False: another instrument is wanted by now."""
        low, high = keys.instrument.range
        for key in range(low, high + 1):
            if self._wanted is None or self._wanted.instrument is not keys.instrument:
                return False
            with contextlib.suppress(ValueError):  # raised again when it is struck
                keys.of_key(key)
        return True

    def _begin(self, wanted: _Wanted) -> None:
        """Load the preset of what is wanted, and let keys play a new player with it; report where that fails."""
        instrument, entry = wanted.instrument, self._find(wanted.instrument.preset)
        if entry is None:
            self._report(f"{instrument.name} is played by the preset {instrument.preset}, which was not found.", "")
            return
        try:
            preset, rate_hz = self._sources.load(entry.path).preset, self._mixer().rate_hz
            drums = DrumKeys(instrument, wanted.ear) if isinstance(instrument.strings, Drums) else None
            if drums is not None and not self._compute_drums(drums):
                return
            player = InstrumentPlayer(instrument, preset, rate_hz, self._gains, wanted.ear, keys=drums)
        except ValueError as error:
            self._report(str(error), "")
            return
        with self._lock:
            now, mixer = self._wanted, self._mixer()
            if now is None or now.instrument is not instrument:
                return
            if mixer.rate_hz != rate_hz:  # the device has changed meanwhile
                player = player.again(mixer.rate_hz)
            for event in self._switches.values():
                player.handle(event)
            self._path = entry.path
            self._set_player(player, mixer)
            self.recorder.take(_turned_event(player))
        if now is not wanted:  # it is heard elsewhere by now
            self._load_wanted(player, now)


def _can_play(player: InstrumentPlayer, instrument: Instrument) -> bool:
    """Return True if a player can play an instrument too."""
    return player.instrument.preset == instrument.preset and player.of_drums == isinstance(instrument.strings, Drums)


def _turned_event(player: InstrumentPlayer) -> InstrumentTurned:
    """The instrument with the pick-up it is heard through. That is not its own where a single string is played."""
    instrument, ear = player.instrument, player.ear
    pickup = instrument.pickup.model_copy(update={"points": ear.points, "kind": ear.pickup})
    return InstrumentTurned(instrument.model_copy(update={"pickup": pickup}))
