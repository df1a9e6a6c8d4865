"""Who rings: notes are struck, switched between sources, listened to from elsewhere, and end.

A gesture strikes a note in its own thread: its voices are made and handed to the mixer at once, before anybody draws
anything. The voices of one note begin with the same frame, so that a switch between them stays in time.
"""

from __future__ import annotations

import math
import threading
import traceback
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.audio.sound import Sound
from app.playing.ahead import Ahead, AheadVoice
from app.playing.sources import Sources
from app.playing.stroke import Mix, Stroke
from app.precedence import Rank, step_back
from engine.kernels import layout
from engine.preset import PresetError
from engine.sources import project
from engine.voices import Ear, Mixer, Voice, render_voice

MOST_NOTES = 24  # that ring at once; the oldest makes room
STOLEN_S = 0.03  # the fade of one that makes room
STOP_S = 0.012
REPLACED_S = 0.02
BUSY = 0.75  # of the device's time: beyond, the oldest notes end, so that the others stay whole
MATCHED_S = 1.0  # so much from the pluck on is compared to match levels
LARGEST_MATCH_DB = 40.0  # beyond this a source is silent rather than soft, and stays as it is
KEPT_MATCHES = 256

Report = Callable[[str, str], None]  # a message and its details


class Note:
    """A pluck that was struck. Its voices know how far it is.

    Attributes:
        match: by source, the gain that brings its level to the truth's; None until it is known.
        pending: it is not handed over yet.
    """

    def __init__(self, stroke: Stroke) -> None:
        self.stroke = stroke
        self.voices: dict[str, Voice] = {}
        self.ahead: list[AheadVoice] = []
        self.match: Mapping[str, float] | None = None
        self.pending = True
        self.released = False
        self.timed = False  # its latency has been noted
        self.begin_frame = 0  # of the mixer, before which it waits

    @property
    def over(self) -> bool:
        return not self.pending and all(voice.over for voice in self.voices.values())

    @property
    def seconds(self) -> float:
        """How long it has been ringing, as far as the device was given it."""
        return max((voice.seconds for voice in self.voices.values()), default=0.0)

    @property
    def waits_s(self) -> float:
        """How long it will still be rendered before it sounds."""
        return max((each.waits_s for each in self.ahead), default=0.0) if self.pending else 0.0

    @property
    def ran_away(self) -> bool:
        return any(voice.ran_away for voice in self.voices.values())

    @property
    def began_frame(self) -> int:
        """Of the mixer; 0 before it began."""
        return max((voice.began_frame for voice in self.voices.values()), default=0)

    def release_at(self, frame: int) -> None:
        """Fades out from a frame of the mixer on; 0: it rings on."""
        for voice in self.voices.values():
            voice.release_at(frame)

    def release(self, seconds: float) -> None:
        self.released = True
        for voice in self.voices.values():
            voice.release(seconds)


class Notes:
    """All public methods but `poll` may be called from any thread.

    Args:
        report: hears of what cannot be played, in any thread.
    """

    def __init__(self, sound: Sound, sources: Sources, report: Report) -> None:
        self._sound, self._sources, self._report = sound, sources, report
        self._lock = threading.RLock()
        self._notes: list[Note] = []
        self._mix = Mix()
        self._ear: Ear | None = None
        self._ahead = Ahead()
        self._matches: OrderedDict[tuple[object, ...], Mapping[str, float]] = OrderedDict()
        self._matching: set[tuple[object, ...]] = set()
        self._latencies_s: deque[float] = deque(maxlen=100)
        self._helper = ThreadPoolExecutor(1, "notes-helper", step_back, (Rank.BACKGROUND,))
        self._closed = False

    # Gestures

    def strike(self, stroke: Stroke, from_s: float = 0.0, alone: bool = False, begin_frame: int = 0) -> Note:
        """Lets a string go, beside those that ring. Returns at once; it sounds with the next quantum of the device.

        Args:
            from_s: begins so much later in its motion.
            alone: those that ring fade out.
            begin_frame: waits for this frame of the mixer.
        """
        struck_s = self._sound.now_s()
        note = Note(stroke)
        note.begin_frame = begin_frame
        if alone:
            self.stop(REPLACED_S)
        if from_s > 0 or not self.have(stroke):
            self._submit(lambda: self._begin(note, struck_s, from_s))
        else:
            self._begin(note, struck_s, from_s)
        return note

    def have(self, stroke: Stroke) -> bool:
        """Whether nothing needs to be loaded for it."""
        rate_hz = self._sound.rate_hz
        return all(self._sources.has(stroke.path(source), rate_hz) for source in stroke.sources)

    def prepare(self, *paths: Path) -> None:
        """Loads presets in the background, so that a strike need not wait."""
        rate_hz = self._sound.rate_hz
        for path in paths:
            if not self._sources.has(path, rate_hz):
                self._submit(lambda path=path: self._sources.prepare(path, rate_hz))  # type: ignore[misc]

    def stop(self, seconds: float = STOP_S) -> None:
        """All fade out."""
        with self._lock:
            for note in self._notes:
                note.release(seconds)

    def set_mix(self, mix: Mix) -> None:
        """What is heard of all notes, from now on: a cross-fade where they ring."""
        with self._lock:
            self._mix = mix
            for note in self._notes:
                self._apply_mix(note)

    def listen(self, ear: Ear) -> None:
        """From where, from now on: a fade where they ring; another pick-up counts from the next pluck."""
        with self._lock:
            self._ear = ear

    def render(self, stroke: Stroke, rate_hz: int, seconds: float) -> Future[Mapping[str, NDArray[np.float32]]]:
        """Each source of a pluck as it is heard, (frames, channels), in the background; for no loudspeaker."""

        def work() -> Mapping[str, NDArray[np.float32]]:
            found = {}
            for source in stroke.sources:
                path = stroke.path(source)
                program = self._sources.program(path, "truth" if source == "truth" else "model", rate_hz)
                loaded = self._sources.load(path)
                found[source] = render_voice(
                    program, loaded.model, loaded.preset.info, stroke.pluck, stroke.ear, seconds
                )
            return found

        return self._helper.submit(work)

    # What there is

    @property
    def ringing(self) -> int:
        with self._lock:
            return sum(not note.over and not note.released for note in self._notes)

    @property
    def latencies_s(self) -> tuple[float, ...]:
        """From gestures to the callbacks that gave their first samples to the device, the latest last."""
        return tuple(self._latencies_s)

    def match_of(self, stroke: Stroke) -> Mapping[str, float] | None:
        return self._matches.get(stroke.matching_key)

    def poll(self) -> None:
        """Now and then: forgets what is over, moves listening points, keeps the load bounded."""
        with self._lock:
            self._notes = [note for note in self._notes if not note.over]
            for note in self._notes:
                if not note.timed and not note.pending and note.voices:
                    latency_s = next(iter(note.voices.values())).struck_to_began_s
                    if latency_s is not None:
                        note.timed = True
                        self._latencies_s.append(latency_s)
                if self._ear is not None:
                    for voice in note.voices.values():
                        voice.listen(self._ear)
            if self._sound.status().load > BUSY:
                self._make_room(max(1, self.ringing - 2))

    def close(self) -> None:
        """May be called again."""
        self._closed = True
        self._helper.shutdown(wait=True, cancel_futures=True)
        self._ahead.close()

    # How it is done

    def _submit(self, work: Callable[[], None]) -> None:
        def guarded() -> None:
            try:
                work()
            except (PresetError, ValueError) as error:
                self._report(str(error), "")
            except Exception as error:
                self._report(f"This pluck cannot be played: {error}", traceback.format_exc())

        if not self._closed:
            self._helper.submit(guarded)

    def _begin(self, note: Note, struck_s: float, from_s: float) -> None:
        """Makes the voices and hands them over, again where the device has changed its rate meanwhile."""
        for _ in range(3):
            mixer = self._sound.mixer
            self._make_voices(note, mixer.rate_hz)
            for voice in note.voices.values():
                voice.set_struck(0.0 if note.begin_frame else struck_s)
                voice.begin_at(note.begin_frame)
                if from_s > 0:
                    voice.skip(from_s, Mixer(mixer.rate_hz).memory)
            note.match = self._matches.get(note.stroke.matching_key)
            self._apply_mix(note, at_once=from_s == 0)
            if note.ahead:
                for each in note.ahead:
                    self._ahead.render(each)
                return
            if self._hand_over(note, mixer):
                return

    def _make_voices(self, note: Note, rate_hz: int) -> None:
        stroke, voices = note.stroke, {}
        note.ahead = []
        for source in stroke.sources:
            path = stroke.path(source)
            program = self._sources.program(path, "truth" if source == "truth" else "model", rate_hz)
            loaded = self._sources.load(path)
            info = loaded.preset.info
            initial_m = project(stroke.pluck.displacement(info.grid_points), info.modes)
            ahead = program.kind == layout.RENDERED
            voice = Voice(program, initial_m, stroke.ear, 0.0, stroke.seconds if ahead else 0.0, info.rate_hz)
            voices[source] = voice
            if ahead:
                key = (path, stroke.pluck, stroke.ear.points, stroke.ear.solo, stroke.seconds)
                note.ahead.append(
                    AheadVoice(
                        voice,
                        loaded.model,
                        initial_m,
                        stroke.ear.weights(info.grid_points),
                        key,
                        lambda: self._rendered_enough(note),
                        lambda error: self._report(f"This pluck cannot be rendered: {error}", ""),
                    )
                )
        note.voices = voices

    def _rendered_enough(self, note: Note) -> None:
        if all(each.begun for each in note.ahead):
            self._hand_over(note, self._sound.mixer)

    def _hand_over(self, note: Note, mixer: Mixer) -> bool:
        with self._lock:
            if mixer is not self._sound.mixer or note.released:
                return note.released
            self._make_room(MOST_NOTES - 1)
            try:
                mixer.add(*note.voices.values())
            except ValueError:
                return False
            note.pending = False
            self._notes.append(note)
        self._wish_match(note)
        return True

    def _make_room(self, most: int) -> None:
        """The oldest end where more ring."""
        ringing = [note for note in self._notes if not note.over and not note.released]
        for note in ringing[: max(0, len(ringing) - most)]:
            note.release(STOLEN_S)

    def _apply_mix(self, note: Note, at_once: bool = False) -> None:
        for source, voice in note.voices.items():
            gain = self._mix.gain(source, note.match)
            voice.set_gain(gain)
            if at_once:
                voice.start_with_gain(gain)

    # Levels

    def _wish_match(self, note: Note) -> None:
        key = note.stroke.matching_key
        with self._lock:
            if not self._mix.matched or note.match is not None or key in self._matching or len(self._matching) > 8:
                return
            self._matching.add(key)
        self._submit(lambda: self._match(note, key))

    def _match(self, note: Note, key: tuple[object, ...]) -> None:
        try:
            levels = {source: self._level(note.stroke, source) for source in note.stroke.sources}
            found = {source: _match_gain(level, levels.get("truth", level)) for source, level in levels.items()}
        finally:
            with self._lock:
                self._matching.discard(key)
        with self._lock:
            self._matches[key] = found
            while len(self._matches) > KEPT_MATCHES:
                self._matches.popitem(last=False)
            for each in self._notes:
                if each.stroke.matching_key == key:
                    each.match = found
                    self._apply_mix(each)

    def _level(self, stroke: Stroke, source: str) -> float:
        """Root mean square of the first second; 0 of what is rendered ahead: it is left as it is."""
        path = stroke.path(source)
        info = self._sources.load(path).preset.info
        rate_hz = min(self._sound.rate_hz, 48_000)
        program = self._sources.program(path, "truth" if source == "truth" else "model", rate_hz)
        if program.kind == layout.RENDERED:
            return 0.0
        mixer = Mixer(rate_hz)
        mixer.add(Voice(program, project(stroke.pluck.displacement(info.grid_points), info.modes), stroke.ear))
        sound = mixer.render(round(MATCHED_S * rate_hz))
        return math.sqrt(float(np.square(sound, dtype=np.float64).mean()))


def _match_gain(own: float, truth: float) -> float:
    limit = 10 ** (LARGEST_MATCH_DB / 20)
    gain = truth / own if own > 0 else 0.0
    return gain if 1 / limit <= gain <= limit else 1.0
