"""The notes that ring: begun by events, switched between sources, heard from other points, and ended.

All that plays is an event: a key, a message of MIDI or of a file, a pluck at a place. `Notes.handle` turns it into a
note in the thread it comes in, and hands it to the mixer at once, before anything is drawn. Keys of an instrument go
to the compiled player as numbers. A pluck of a single string has voices that are made here, for models of every kind.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TypeVar

from app.audio.sound import Sound, SoundStatus
from app.instruments.instrument import Instrument
from app.player.events import Event, NoteOn, PluckAt
from app.playing.ahead import STOLEN_S, Ahead
from app.playing.ahead_samples import AheadSamples
from app.playing.key_note import SOURCES, KeyNote, drop
from app.playing.keyboard import PluckRange
from app.playing.keys import Keys
from app.playing.levels import level_match
from app.playing.note import PluckVoices
from app.playing.playback import Due
from app.playing.sources import Sources
from app.presets.library import PresetEntry
from app.rendering import NoteSound
from app.rendering.subject import Subject, path_of
from app.session.monitor import Monitor
from app.shared.log import faultless
from app.shared.thread_priority import Rank, lower_priority
from app.shared.vocabulary import DIFFERENCE, OTHER
from engine.effects import Effects
from engine.levels import MATCHED_S
from engine.pluck import Pluck
from engine.values.ear import Ear
from engine.voices import Mixer, Voice

MOST_NOTES = 40  # that ring at once; the oldest makes room
STOP_S = 0.012  # the fade of `stop`
REPLACED_S = 0.02  # the fade of notes that another replaces
BUSY = 0.75  # load of the device: above it the oldest notes end, so that the others have no gaps
LOOKS = 10  # looks at the load in a row that must be above BUSY, 0.5 s or more: bursts of others are shorter
LEAST_RELIEF = 2  # notes that end at once where the load is above BUSY, at least
MOST_CARRIED = 4  # notes that ring on, at most, when the device changes its rate
KEPT_MATCHES = 256
MOST_MATCHING = 8  # level matches that wait to be computed
LOOP_AHEAD_S = 0.5  # lead of the next turn of a loop when it is handed to the mixer

Report = Callable[[str, str], None]  # a message and its details
Made = TypeVar("Made")
MadeNote = TypeVar("MadeNote", PluckVoices, KeyNote, PluckVoices | KeyNote)


class Notes:
    """Notes that ring, and how they are heard.

    All public methods but `poll` and `close`, which are the window's, may be called from any thread.

    Args:
        find: a preset by its name; None where there is none.
        report: is called with a message and its details where something cannot be played; in any thread.
        set_effects: sets body and room of all that is heard; called in a background thread.

    Attributes:
        sound: the output, whose mixer's frames are the time of events.
        keys: what the keys of an instrument sound with.
        latest: the note that an event began last.
    """

    def __init__(
        self,
        sound: Sound,
        sources: Sources,
        find: Callable[[str], PresetEntry | None],
        report: Report,
        set_effects: Callable[[Effects | None], None] = lambda effects: None,
    ) -> None:
        self.sound = sound
        self._sources = sources
        self._find = find
        self._report = report = faultless(report, "while a note was reported")
        self._lock = threading.RLock()
        self._notes: list[PluckVoices | KeyNote] = []  # the oldest first
        self._monitor = Monitor()
        self._ear: Ear | None = None  # None: not set yet
        self.latest: PluckVoices | KeyNote | None = None
        self._chosen: NoteSound | None = None  # the pluck that loops and seeks repeat; None: none
        self._reach: PluckRange | None = None  # of a single string, which is played; None: an instrument is
        self._blind_test = False  # a blind test is open
        self._ahead = Ahead(self._hand_over, self._drop)
        self._latencies_s: deque[float] = deque(maxlen=100)  # from gestures to their sound, the latest last
        self._loads: deque[float] = deque(maxlen=LOOKS)  # share of the device's time, at the latest looks
        self._frames_looked = 0  # of the mixer, when its load was looked at
        self._helper = ThreadPoolExecutor(1, "notes-helper", lower_priority, (Rank.BACKGROUND,))
        self._matches: dict[tuple[object, ...], Mapping[str, float]] = {}  # by `matching_key`
        self._matching: set[tuple[object, ...]] = set()  # keys of those that are being computed
        self._closed = False
        self.keys = Keys(sources, find, lambda: sound.mixer, self.in_background, report, set_effects)
        self._set_gains_of_keys()
        sound.watch(self._bound_load)

    # What is played

    def set_instrument(self, instrument: Instrument | None, ear: Ear, single: str | None = None) -> None:
        """Set what events play from now on, and where all notes are heard.

        Args:
            single: the preset whose string is played by itself: notes of the instrument fade out. It is loaded all
                the same, so that its keys sound at once when it is played.
        """
        entry = None if single is None else self._find(single)
        reach = None if single is None else PluckRange.of(entry.info if entry is not None else None)
        with self._lock:
            plucked_before = self._reach is not None
            self._reach = reach
            self._ear = ear
            request = self._chosen
            if request is not None and entry is not None and path_of(request.preset) != entry.path:
                self._chosen = replace(request, preset=entry.path)
        if single is not None and not plucked_before:
            self.keys.stop(REPLACED_S)
        self.keys.set_instrument(instrument, ear)
        self._hear_effects()

    def listen(self, ear: Ear) -> None:
        """Set where all notes are heard; those that ring are cross-faded, but keep their kind of pick-up."""
        with self._lock:
            self._ear = ear
            if self._chosen is not None:
                self._chosen = replace(self._chosen, ear=ear)
        self.keys.listen(ear)

    def choose(self, request: NoteSound | None) -> None:
        """Choose the pluck that loops, seeks and the next pluck at a place start from."""
        with self._lock:
            self._chosen = request

    def set_monitor(self, monitor: Monitor, compared: bool = True) -> None:
        """Set the sources of all notes; those that ring are cross-faded.

        Args:
            compared: whether keys that are struck from now on can be switched to another source while they ring.
        """
        with self._lock:
            self._monitor = monitor
            self._do_for_each(self._plucks(), self._apply_monitor)
        self._set_gains_of_keys(compared)
        self._hear_effects()

    def set_blind_test(self, is_open: bool) -> None:
        """Begin or end a blind test, beside which no note begins."""
        self._blind_test = is_open
        self._hear_effects()

    def _hear_effects(self) -> None:
        """Leave out body and room in a blind test, while the difference is heard, and of a single string."""
        compares = self._blind_test or self._monitor.source_heard == DIFFERENCE
        self.keys.hear_dry(compares or self._reach is not None)

    # Events

    def handle(self, event: Event, due: Due | None = None) -> PluckVoices | KeyNote | None:
        """Play an event, at once or when it is due; the note that it began, or None, as in a blind test.

        Keys of a single string are places along it. Its note sounds with the next quantum of the device, unless
        presets must be loaded or a model is rendered ahead. An event that fails costs itself alone, and is reported.
        """
        try:
            return self._handle(event, due)
        except Exception as error:
            self._drop(None, error)
            return None

    def _handle(self, event: Event, due: Due | None) -> PluckVoices | KeyNote | None:
        """Do what `handle` says; errors are raised."""
        if self._blind_test and isinstance(event, NoteOn | PluckAt):
            return None  # all else is heard: a pedal that is lifted meanwhile is up afterwards
        struck_s = self.sound.now_s() if due is None else 0.0  # only gestures are timed
        placed = self._as_pluck(event)
        if not isinstance(placed, PluckAt):
            begun = self.keys.handle(placed, due, struck_s, self._keep_key_note)
            self.latest = begun or self.latest
            return begun
        with self._lock:
            if self._chosen is not None:
                self._chosen = replace(self._chosen, pluck=placed.pluck)
            note = self._chosen_note(begin_frame=0 if due is None else due.frame_in(self.sound.mixer))
        if note is not None:
            note.struck_s, note.ahead_of_event = struck_s, due is not None
            self.latest = self._ring(note)
        return note

    def _as_pluck(self, event: Event) -> Event:
        """The pluck at a place for a key that is struck while a single string is played; any other event as it is."""
        reach, chosen = self._reach, self._chosen
        if reach is None or not isinstance(event, NoteOn) or event.velocity <= 0:
            return event
        if event.pluck is not None:  # by hand, before another thread chose a single string
            return PluckAt(event.pluck)
        return PluckAt(reach.pluck(event.key, event.velocity, Pluck() if chosen is None else chosen.pluck))

    def ring(self, from_s: float = 0.0, begin_frame: int = 0, alone: bool = False) -> PluckVoices | None:
        """Begin a note of the chosen pluck, while others ring on; None where nothing is chosen.

        Args:
            from_s: where in its motion it begins.
            begin_frame: the frame of the mixer at which it begins; 0: at once.
            alone: whether the other notes fade out.
        """
        if alone:
            self.stop(REPLACED_S)
        note = self._chosen_note(from_s, begin_frame)
        return None if note is None else self._ring(note)

    def _ring(self, note: PluckVoices) -> PluckVoices:
        """Begin the note of a pluck; in the background where something is to be loaded, or it begins late."""
        loaded = self._is_loaded(note)
        if note.begin_frame:
            note.mixer = self.sound.mixer  # whose frame it is
        with self._lock:
            self._notes.append(note)
        begin = self._do if loaded and not note.from_s else self.in_background
        begin(partial(self._begin, note), note)
        return note

    def turn(
        self, note: PluckVoices | KeyNote, seconds: float, event: NoteOn | PluckAt
    ) -> PluckVoices | KeyNote | None:
        """Begin the next turn of a loop: a note that replaces `note` once that has lasted `seconds`.

        None: nothing is chosen, or that is more than LOOP_AHEAD_S from now, and nothing was done.

        Args:
            event: the chosen pluck, as a note of its instrument or of the string alone.
        """
        mixer, frame = self.sound.mixer, note.frame_at(seconds)
        early = frame - mixer.frames
        if self._chosen is None or early > LOOP_AHEAD_S * mixer.rate_hz:
            return None
        note.release_at(frame)
        if isinstance(event, PluckAt):
            return self.ring(begin_frame=frame)
        due = Due(mixer, frame, time.monotonic() + early / mixer.rate_hz)
        return self.keys.handle(event, due, 0.0, self._keep_key_note)

    def cancel(self) -> None:
        """Cancel the events that were handed over and are not due yet."""
        self.keys.cancel()
        with self._lock:
            for note in self._plucks():
                if note.ahead_of_event and not note.began:
                    note.release(0.0)

    def stop(self, seconds: float = STOP_S) -> None:
        """Let all notes fade out; those that wait will not sound."""
        with self._lock:
            self._do_for_each(self._notes, lambda note: note.release(seconds))
        self.keys.stop(seconds)

    # Ahead of events

    def in_background(self, work: Callable[[], None], note: PluckVoices | None = None) -> None:
        """Do `work` in the helper's thread, after what waits there. Its errors are reported, and cut the note."""
        if not self._closed:
            self._helper.submit(self._do, work, note)

    @property
    def at_hand(self) -> bool:
        """Return True if the chosen pluck would sound at once: nothing needs to be loaded for it."""
        note = self._chosen_note()
        return note is not None and self._is_loaded(note)

    def prepare(self, *subjects: Subject) -> None:
        """Load presets in the background, so that a pluck need not wait."""
        rate_hz = self.sound.rate_hz
        for subject in subjects:
            if not self._sources.has(subject, rate_hz):
                self.in_background(partial(self._sources.prepare, subject, rate_hz))

    def compute(self, work: Callable[[int], Made], rate_hz: int) -> Future[Made]:
        """Compute what `work` makes at a rate, in the helper's thread, after what waits there."""
        return self._helper.submit(work, rate_hz)

    # What there is

    @property
    def match(self) -> Mapping[str, float] | None:
        """The factor by source that brings the chosen pluck to the level of the truth. None: not known yet."""
        note = self._chosen_note()
        return None if note is None else self._matches.get(note.matching_key)

    @property
    def ringing(self) -> int:
        """The number of notes that were neither released nor have ended; those that wait are counted."""
        with self._lock:
            return sum(not note.over and not note.released for note in self._notes)

    @property
    def latencies_s(self) -> tuple[float, ...]:
        """Times from gestures to the callbacks that gave their first samples to the device, the latest last."""
        return tuple(self._latencies_s)

    def forget_latencies(self) -> None:
        """Forget the measured latencies, which do not hold for another device or buffer."""
        self._latencies_s.clear()

    def poll(self) -> None:
        """Forget notes that ended, and move listening points. The window calls it at each frame."""
        self.look()
        with self._lock:
            self._move_to_new_mixer()
            self._notes = [note for note in self._notes if not note.over]
            self._do_for_each(self._notes, self._take_latency)
            self._do_for_each(self._plucks(), self._follow)

    def close(self) -> None:
        """End the threads; may be called again."""
        self._closed = True
        self._helper.shutdown(wait=True, cancel_futures=True)
        self._ahead.close()

    # How it is done

    def _do(self, work: Callable[[], None], note: PluckVoices | KeyNote | None = None) -> None:
        """Do `work`; a note with which it fails is dropped, and what went wrong is reported."""
        try:
            work()
        except Exception as error:
            self._drop(note, error)

    def _do_for_each(self, notes: Sequence[MadeNote], work: Callable[[MadeNote], None]) -> None:
        """Do `work` with each note, as `_do`."""
        for note in notes:
            self._do(partial(work, note), note)

    def _drop(self, note: PluckVoices | KeyNote | None, error: Exception) -> None:
        drop(note, error, self._report)

    def _take_latency(self, note: PluckVoices | KeyNote) -> None:
        """Add the latency of a note, once it is known, to the recent ones; notes rendered ahead have none."""
        ahead = isinstance(note, PluckVoices) and note.ahead
        if not note.timed and not ahead and (latency_s := note.latency_s) is not None:
            note.timed = True
            self._latencies_s.append(latency_s)

    def _follow(self, note: PluckVoices) -> None:
        """Let a note be heard where all are, and as loud as the truth once that is known."""
        self._take_match(note)
        if self._ear is not None:
            for voice in note.voices.values():
                voice.listen(self._ear)

    def _set_gains_of_keys(self, compared: bool = True) -> None:
        """Set which sources of keys are heard; both are of one string, whose levels match as they are."""
        self.keys.set_gains({source: self._monitor.gain(source, SOURCES, None) for source in SOURCES}, compared)

    def _plucks(self) -> list[PluckVoices]:
        """The notes whose voices are made here."""
        return [note for note in self._notes if isinstance(note, PluckVoices)]

    def look(self) -> None:
        """Follow what the player reports of notes of keys: the latest that began is the string that is shown.

        One that is reported after a single string was chosen, which its instrument is not, changes nothing.
        """
        for note in self.keys.look():
            with self._lock:
                request, chosen_request = note.request, self._chosen
                if request is None or chosen_request is None or note is not self.latest or self._reach is not None:
                    continue
                self._chosen = replace(chosen_request, preset=request.preset, pluck=request.pluck)

    def _chosen_note(self, from_s: float = 0.0, begin_frame: int = 0) -> PluckVoices | None:
        """A new note of the chosen pluck, which has not begun; None: nothing is chosen.

        Its sources are those of the monitor, without presets that the chosen pluck does not have.
        """
        if (chosen := self._chosen) is None:
            return None
        available = {*SOURCES, *(f"{OTHER}{path.stem}" for path in chosen.others)}
        sources = tuple(source for source in self._monitor.voices if source in available) or ("model",)
        return PluckVoices(chosen, sources, from_s, begin_frame)

    def _is_loaded(self, note: PluckVoices) -> bool:
        """Return True if nothing needs to be loaded for it."""
        rate_hz = self.sound.rate_hz
        return all(self._sources.has(note.subject(source), rate_hz) for source in note.sources)

    def _move_to_new_mixer(self) -> None:
        """Let the latest plucks ring on in the new mixer of a device that has changed its rate. Keys' notes end."""
        mixer = self.sound.mixer
        left = [note for note in self._notes if note.mixer not in (None, mixer) and not note.over]
        plucks = [note for note in left if isinstance(note, PluckVoices) and note.seconds and not note.released]
        for note in left:
            if isinstance(note, PluckVoices) and note in plucks[-MOST_CARRIED:]:
                note.from_s, note.struck_s = note.seconds, 0.0
                self._begin_again(note)
            else:
                note.end()

    def _keep_key_note(self, note: KeyNote) -> None:
        """Keep the note of a key, which was handed to the player; the oldest notes make room."""
        with self._lock:
            self._notes.append(note)
            self._make_room(MOST_NOTES)

    def _begin(self, note: PluckVoices) -> None:
        """Make the voices and hand them over, at once or when those that are rendered ahead are far enough."""
        request, rate_hz = note.request, self.sound.mixer.rate_hz
        voices, ahead = dict[str, Voice](), list[AheadSamples]()
        for source in note.sources:
            subject = note.subject(source)
            try:
                loaded = self._sources.load(subject)
                voice = loaded.voice(source, request.pluck, request.ear, rate_hz, request.seconds, gain=0.0)
            except ValueError:
                if source in SOURCES:
                    raise
                continue  # another preset that cannot be used; the render worker reports why
            voices[source] = voice
            voice.set_struck(note.struck_s)
            voice.begin_at(note.begin_frame)
            if voice.program.rendered:
                voice.fade_out_by(request.seconds)  # behind it there are no samples
                key = subject, request.pluck, request.ear, request.seconds
                ahead.append(AheadSamples(voice, loaded.motion(request.pluck, request.seconds), key, note.from_s))
        note.voices, note.ahead = voices, ahead
        if ahead:
            self._ahead.render(note)
        else:
            self._hand_over(note)

    def _hand_over(self, note: PluckVoices) -> None:
        """Hand a note over to the mixer; begin it again where the device has one of another rate or frame by now."""
        if note.from_s > 0:
            for voice in note.voices.values():
                Mixer(voice.program.rate_hz).skip(voice, note.from_s)
        with self._lock:
            mixer = self.sound.mixer
            if note.over:
                return
            note.match = self._matches.get(note.matching_key)
            self._apply_monitor(note, at_once=note.from_s == 0)
            rates_hz = {voice.program.rate_hz for voice in note.voices.values()}
            if rates_hz - {mixer.rate_hz} or note.mixer not in (None, mixer):
                self._begin_again(note)
                return
            mixer.add(*note.voices.values())
            note.mixer, note.pending = mixer, False
            self._make_room(MOST_NOTES)

    def _begin_again(self, note: PluckVoices) -> None:
        """Begin a note in another mixer, which counts its own frames."""
        note.pending, note.ahead = True, []
        note.begin_frame, note.mixer = 0, None
        self.in_background(partial(self._begin, note), note)

    def _bound_load(self, status: SoundStatus) -> None:
        """End the oldest notes where the device has no time for all. In the caretaker's thread of the sound.

        Bursts of other programs raise the load as well: what they cost is their own length, and no note ends.
        It looks at the keys' notes too, so that their ends are reported while the window is busy.
        """
        self.look()
        frames, before = self.sound.mixer.frames, self._frames_looked
        if frames == before:  # the load is that of the look before
            return
        self._frames_looked = frames
        self._loads.append(status.load)
        load = min(self._loads) if len(self._loads) == LOOKS else 0.0
        if load > BUSY:
            self._loads.clear()
            with self._lock:
                ringing = self.ringing
                self._make_room(max(1, min(ringing - LEAST_RELIEF, int(ringing * BUSY / load))))

    def _make_room(self, most: int) -> None:
        """Release the oldest notes where more than `most` ring."""
        ringing = [note for note in self._notes if not note.over and not note.released]
        self._do_for_each(ringing[: max(0, len(ringing) - most)], lambda note: note.release(STOLEN_S))

    def _apply_monitor(self, note: PluckVoices, at_once: bool = False) -> None:
        """Fade the voices of a note to the monitor's gains; `at_once`: they begin with these."""
        for source, voice in note.voices.items():
            gain = self._monitor.gain(source, note.voices.keys(), note.match)
            voice.set_gain(gain)
            if at_once:
                voice.start_with_gain(gain)

    def _take_match(self, note: PluckVoices) -> None:
        """Let a note be as loud as the truth once that is known; compute it where nobody has asked for it yet."""
        if not self._monitor.level_match or note.match is not None or note.pending:
            return
        key = note.matching_key
        note.match = self._matches.get(key)
        if note.match is not None:
            self._apply_monitor(note)
        elif key not in self._matching and len(self._matching) < MOST_MATCHING and _enough_for_match(note):
            self._matching.add(key)
            self.in_background(partial(self._match, note))

    def _match(self, note: PluckVoices) -> None:
        """Compute the level match of a note, for all of the same pluck and ear."""
        key = note.matching_key
        try:
            self._matches[key] = level_match(self._sources, note, self.sound.rate_hz)
            if len(self._matches) > KEPT_MATCHES:
                del self._matches[next(iter(self._matches))]
        finally:
            self._matching.discard(key)


def _enough_for_match(note: PluckVoices) -> bool:
    """Return True if the first MATCHED_S of all voices are rendered, or all there is of them."""
    return all(samples.finished or samples.rendered_s >= MATCHED_S for samples in note.ahead)
