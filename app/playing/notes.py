"""The notes that ring: struck, switched between sources, heard from other points, and ended.

A gesture strikes a note in its own thread: its voices are made and handed to the mixer at once, before anything is
drawn. The voices of one note begin with the same frame, so that a switch between them stays in time.
"""

from __future__ import annotations

import math
import threading
import traceback
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from app.audio.sound import Sound, SoundStatus
from app.playing.ahead import Ahead, AheadVoice
from app.playing.due import Due
from app.playing.sources import Sources
from app.playing.stroke import Mix, Stroke
from app.rendering.subject import Subject
from app.shared.thread_priority import Rank, step_back
from engine.kernels.layout import QUANTUM
from engine.pluck import Pluck
from engine.presets import PresetError
from engine.voices import Ear, Mixer, Voice, render_voice

MOST_NOTES = 40  # that ring at once; the oldest makes room
STOLEN_S = 0.03  # the fade of one that makes room
STOP_S = 0.012  # the fade of `stop`
REPLACED_S = 0.02  # the fade of notes that another replaces
BUSY = 0.75  # load of the device: above it the oldest notes end, so that the others have no gaps
LEAST_RELIEF = 2  # notes that end then, at each look at the load
MATCHED_S = 1.0  # from the pluck on: the part whose levels are compared
LARGEST_MATCH_DB = 40.0  # beyond this a source is silent rather than soft, and stays as it is
KEPT_MATCHES = 256
MOST_CARRIED = 4  # notes that ring on when the device changes its rate

Report = Callable[[str, str], None]  # a message and its details


class Note:
    """A pluck that was struck.

    Attributes:
        from_s: where in its motion it begins.
        begin_frame: the frame of the mixer at which it begins; 0: at once.
        voices: by source.
        ahead: those of its voices that are rendered ahead.
        match: by source, the factor that brings it to the level of the truth; None until it is known.
        pending: it was not handed to a mixer yet.
        released: it was told to fade out.
        mixer: to which it was handed.
        cut: it is not heard any more: its mixer was replaced, or it could not be played.
    """

    def __init__(self, stroke: Stroke, from_s: float = 0.0, begin_frame: int = 0) -> None:
        self.stroke, self.from_s, self.begin_frame = stroke, from_s, begin_frame
        self.voices: dict[str, Voice] = {}
        self.ahead: list[AheadVoice] = []
        self.match: Mapping[str, float] | None = None
        self.pending = True
        self.handed_over = False  # or about to be
        self.released = False
        self.mixer: Mixer | None = None
        self.cut = False
        self.timed = False  # its latency has been noted
        self.adopted = False  # its voices were made by a caller of `adopt`, who changes them

    @property
    def over(self) -> bool:
        """Whether it has ended: nothing of it will be heard any more."""
        if self.cut or self.pending:
            return self.cut or self.released
        return all(voice.over for voice in self.voices.values())

    @property
    def seconds(self) -> float:
        """The time in its motion up to which the device has its samples."""
        if self.pending:
            return self.from_s
        return max((voice.seconds for voice in self.voices.values()), default=0.0)

    @property
    def began(self) -> bool:
        """Whether the device has any of its samples, or it was cut after it was handed over."""
        return not self.pending and (self.cut or any(each.sounding or each.over for each in self.voices.values()))

    @property
    def waits_s(self) -> float:
        """For how many seconds it will still be rendered before it sounds; 0: it does not wait, or not known."""
        waits = self.pending and not self.over
        return max((each.waits_s for each in self.ahead), default=0.0) if waits else 0.0

    @property
    def began_frame(self) -> int:
        """The frame of the mixer at which it began; 0 before that."""
        return max((voice.began_frame for voice in self.voices.values()), default=0)

    def frame_at(self, seconds: float) -> int:
        """The frame of its mixer at which its motion reaches a time; only once it has begun."""
        assert self.mixer is not None
        rate_hz = self.mixer.rate_hz
        skipped = (round(self.from_s * rate_hz) + QUANTUM // 2) // QUANTUM * QUANTUM
        starved_s = min(voice.starved_s for voice in self.voices.values())
        return self.began_frame + round((seconds + starved_s) * rate_hz) - skipped

    def release_at(self, frame: int) -> None:
        """Lets it fade out from a frame of the mixer on; 0: not any more."""
        for voice in self.voices.values():
            voice.release_at(frame)

    def end(self) -> None:
        """Cuts it, where no device plays its voices any more; they are over."""
        self.cut = True
        for voice in self.voices.values():
            voice.refuse()

    def release(self, seconds: float) -> None:
        """Lets it fade out within so many seconds, from now on."""
        self.released = True
        for voice in self.voices.values():
            voice.release(seconds)


class Notes:
    """All public methods but `poll` and `close`, which are the window's, may be called from any thread.

    Args:
        report: is called with a message and its details where something cannot be played; in any thread.
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
        self._wished_plucks: object = None
        sound.watch(self._bound_load)

    # Gestures

    def strike(self, stroke: Stroke, from_s: float = 0.0, alone: bool = False, begin_frame: int = 0) -> Note:
        """Plucks a string, while other notes ring on. Returns at once.

        It sounds with the next quantum of the device, unless presets must be loaded or a model is rendered ahead.


        Args:
            from_s: where in its motion it begins.
            alone: whether the other notes fade out.
            begin_frame: the frame of the mixer at which it begins; 0: at once.
        """
        struck_s = 0.0 if from_s or begin_frame else self._sound.now_s()  # only gestures are timed
        note = Note(stroke, from_s, begin_frame)
        if alone:
            self.stop(REPLACED_S)
        with self._lock:
            self._notes.append(note)
        begin = self._guarded(lambda: self._begin(note, struck_s), note)
        if from_s > 0 or not self.have(stroke):
            self._submit(begin)
        else:
            begin()
        return note

    def adopt(self, stroke: Stroke, voices: Mapping[str, Voice], struck_s: float, due: Due | None = None) -> Note:
        """A note of given voices, which have the rate of the present mixer; it sounds with the next quantum.

        It ends when the device changes its rate. All its sources have the gain of the stroke: they are not matched.

        Args:
            struck_s: when the gesture was, by `now_s`; 0 where there was none.
            due: when it sounds instead.
        """
        mixer = self._sound.mixer
        note = Note(stroke, begin_frame=0 if due is None else due.frame_in(mixer))
        note.adopted, note.voices, note.match = True, dict(voices), dict.fromkeys(voices, 1.0)
        for voice in voices.values():
            voice.set_struck(struck_s)
            voice.begin_at(note.begin_frame)
        with self._lock:
            self._notes.append(note)
        if not self._hand_over(note, mixer):
            note.end()
        return note

    def now_s(self) -> float:
        """The clock by which gestures are timed."""
        return self._sound.now_s()

    @property
    def mixer(self) -> Mixer:
        """The present one, whose frames are the time of events."""
        return self._sound.mixer

    @property
    def buffer_s(self) -> float:
        """The length of the device's buffer: so much may be rendered at once."""
        return self._sound.status().latency_s

    @property
    def rate_hz(self) -> int:
        """The present rate of the device."""
        return self._sound.rate_hz

    def in_background(self, work: Callable[[], None]) -> None:
        """Does `work` in the helper's thread, after what waits there; its errors are reported."""
        self._submit(self._guarded(work))

    def have(self, stroke: Stroke) -> bool:
        """Whether nothing needs to be loaded for it."""
        rate_hz = self._sound.rate_hz
        return all(self._sources.has(stroke.subject(source), rate_hz) for source in stroke.sources)

    def prepare(self, *subjects: Subject) -> None:
        """Loads presets in the background, so that a strike need not wait."""
        rate_hz = self._sound.rate_hz
        for subject in subjects:
            if not self._sources.has(subject, rate_hz):
                self._submit(self._guarded(lambda subject=subject: self._sources.prepare(subject, rate_hz)))  # type: ignore[misc]

    def prepare_plucks(self, subject: Subject, plucks: Sequence[Pluck]) -> None:
        """Computes in the background where voices of these plucks start; the latest call counts."""
        rate_hz = self._sound.rate_hz
        wish = self._wished_plucks = object()

        def work() -> None:
            for pluck in plucks:
                for kind in ("model", "truth"):
                    if not self._closed and wish is self._wished_plucks:
                        self._sources.begin(subject, kind, rate_hz, pluck)

        self._submit(self._guarded(work))

    def stop(self, seconds: float = STOP_S) -> None:
        """Lets all notes fade out; those that wait will not sound."""
        with self._lock:
            for note in self._notes:
                note.release(seconds)

    def set_mix(self, mix: Mix) -> None:
        """Sets what is heard of all notes; those that ring are cross-faded."""
        with self._lock:
            self._mix = mix
            notes = list(self._notes)
            for note in notes:
                self._apply_mix(note)
        for note in notes:
            if not note.pending and not note.over:
                self._wish_match(note)

    def listen(self, ear: Ear) -> None:
        """Sets where all notes are heard; those that ring are cross-faded, but keep their kind of pick-up."""
        with self._lock:
            self._ear = ear

    def render(self, stroke: Stroke, rate_hz: int, seconds: float) -> Future[Mapping[str, NDArray[np.float32]]]:
        """The sound of each source, (frames, channels), rendered in the background and not played."""

        def work() -> Mapping[str, NDArray[np.float32]]:
            found = {}
            for source in stroke.sources:
                subject = stroke.subject(source)
                program = self._sources.program(subject, "truth" if source == "truth" else "model", rate_hz)
                loaded = self._sources.load(subject)
                found[source] = render_voice(
                    program, loaded.model, loaded.preset.info, stroke.pluck, stroke.ear, seconds
                )
            return found

        return self._helper.submit(work)

    # What there is

    @property
    def ringing(self) -> int:
        """The number of notes that were neither released nor have ended; those that wait are counted."""
        with self._lock:
            return sum(not note.over and not note.released for note in self._notes)

    @property
    def latencies_s(self) -> tuple[float, ...]:
        """Times from gestures to the callbacks that gave their first samples to the device, the latest last."""
        return tuple(self._latencies_s)

    def poll(self) -> None:
        """Forgets notes that ended, and moves listening points. The window calls it at each frame."""
        with self._lock:
            self._carry()
            self._notes = [note for note in self._notes if not note.over]
            for note in self._notes:
                if not note.timed and not note.ahead and note.voices:
                    latency_s = next(iter(note.voices.values())).struck_to_began_s
                    if latency_s is not None:
                        note.timed = True
                        self._latencies_s.append(latency_s)
                if note.ahead and note.match is None and not note.pending:
                    self._wish_match(note)
                if self._ear is not None:
                    for voice in note.voices.values():
                        voice.listen(self._ear)

    def close(self) -> None:
        """Ends the threads; may be called again."""
        self._closed = True
        self._helper.shutdown(wait=True, cancel_futures=True)
        self._ahead.close()

    # How it is done

    def _guarded(self, work: Callable[[], None], note: Note | None = None) -> Callable[[], None]:
        """`work` with its errors reported; they cut the note."""

        def guarded() -> None:
            try:
                work()
                return
            except (PresetError, ValueError) as error:
                self._report(str(error), "")
            except Exception as error:
                self._report(f"This pluck cannot be played: {error}", traceback.format_exc())
            if note is not None:
                note.cut = True

        return guarded

    def _submit(self, work: Callable[[], None]) -> None:
        if not self._closed:
            self._helper.submit(work)

    def _carry(self) -> None:
        """When the device has changed its rate, the latest notes ring on in its new mixer."""
        mixer = self._sound.mixer
        left = [note for note in self._notes if note.mixer not in (None, mixer) and not note.over]
        ringing = [note for note in left if note.seconds and not (note.released or note.adopted)][-MOST_CARRIED:]
        for note in left:
            if note in ringing:
                note.from_s, note.begin_frame, note.mixer = note.seconds, 0, None
                note.pending, note.handed_over = True, False
                self._submit(self._guarded(lambda note=note: self._begin(note, 0.0), note))  # type: ignore[misc]
            else:
                note.end()

    def _begin(self, note: Note, struck_s: float) -> None:
        """Makes the voices and hands them over; again where the device changes its rate meanwhile."""
        for _ in range(3):
            mixer = self._sound.mixer
            self._make_voices(note, mixer.rate_hz, struck_s)
            for voice in note.voices.values():
                voice.set_struck(struck_s)
                voice.begin_at(note.begin_frame)
            if note.ahead:
                for each in note.ahead:
                    self._ahead.render(each)
                return
            self._skip(note)
            if self._hand_over(note, mixer):
                return
            note.begin_frame = 0  # another mixer counts anew

    def _skip(self, note: Note) -> None:
        if note.from_s > 0:
            for voice in note.voices.values():
                voice.skip(note.from_s, Mixer(voice.program.rate_hz).memory)

    def _make_voices(self, note: Note, rate_hz: int, struck_s: float) -> None:
        stroke, voices = note.stroke, {}
        ahead: list[AheadVoice] = []
        for source in stroke.sources:
            subject, kind = stroke.subject(source), "truth" if source == "truth" else "model"
            try:
                program = self._sources.program(subject, kind, rate_hz)
                initial_m, begin = self._sources.begin(subject, kind, rate_hz, stroke.pluck)
                model = self._sources.load(subject).model if program.rendered else None
            except (PresetError, ValueError):
                if source not in stroke.others:
                    raise
                continue  # another preset that cannot be used; the render worker reports why
            if model is None:
                voices[source] = Voice(program, initial_m, stroke.ear, 0.0, begin=begin)
                continue
            voice = voices[source] = Voice(program, initial_m, stroke.ear, 0.0, stroke.seconds, model.rate_hz, begin)
            voice.fade_out_by(stroke.seconds)  # behind it there are no samples
            ahead.append(
                AheadVoice(
                    voice,
                    model,
                    initial_m,
                    program.grid_weights(stroke.ear),
                    (subject, stroke.pluck, stroke.ear.points, stroke.ear.solo, stroke.seconds),
                    lambda: self._rendered_enough(note, ahead, struck_s),
                    lambda error: self._cannot_render(note, error),
                    lambda: note.over,
                    note.from_s,
                )
            )
        note.ahead, note.voices = ahead, voices

    def _rendered_enough(self, note: Note, ahead: list[AheadVoice], struck_s: float) -> None:
        """Hands the note over once all its models are rendered far enough. Any thread."""
        with self._lock:
            if note.handed_over or ahead is not note.ahead or not all(each.begun for each in ahead):
                return
            note.handed_over = True  # or two that are ready at the same time would both do it
        self._skip(note)
        if not self._hand_over(note, self._sound.mixer):
            note.handed_over, note.begin_frame = False, 0
            self._submit(self._guarded(lambda: self._begin(note, struck_s), note))

    def _cannot_render(self, note: Note, error: Exception) -> None:
        note.cut = True
        self._report(f"This pluck cannot be rendered: {error}", "")

    def _hand_over(self, note: Note, mixer: Mixer) -> bool:
        """Whether it could; False where the device has another mixer by now."""
        with self._lock:
            if note.over:
                return True
            if mixer is not self._sound.mixer:
                return False
            if not note.adopted:
                note.match = self._matches.get(note.stroke.matching_key)
            self._apply_mix(note, at_once=note.from_s == 0)
            try:
                mixer.add(*note.voices.values())
            except ValueError:
                return False
            note.mixer, note.pending = mixer, False
            self._make_room(MOST_NOTES)
        self._wish_match(note)
        return True

    def _bound_load(self, status: SoundStatus) -> None:
        """Ends the oldest notes where the device has no time for all. In the caretaker's thread of the sound."""
        if status.load > BUSY:
            with self._lock:
                ringing = self.ringing
                self._make_room(max(1, min(ringing - LEAST_RELIEF, int(ringing * BUSY / status.load))))

    def _make_room(self, most: int) -> None:
        """Releases the oldest notes where more than `most` ring."""
        ringing = [note for note in self._notes if not note.over and not note.released]
        for note in ringing[: max(0, len(ringing) - most)]:
            note.release(STOLEN_S)

    def _apply_mix(self, note: Note, at_once: bool = False) -> None:
        for source, voice in note.voices.items():
            gain = note.stroke.gain * self._mix.of(note.voices).gain(source, note.match)
            voice.set_gain(gain)
            if at_once:
                voice.start_with_gain(gain)

    # Levels

    def _wish_match(self, note: Note) -> None:
        key = note.stroke.matching_key
        with self._lock:
            known = note.match is not None or key in self._matching or len(self._matching) > 8
            if (
                not self._mix.matched
                or known
                or not all(each.finished or each.rendered_s >= MATCHED_S for each in note.ahead)
            ):
                return
            self._matching.add(key)
        self._submit(self._guarded(lambda: self._match(note, key)))

    def _match(self, note: Note, key: tuple[object, ...]) -> None:
        try:
            seconds = min([MATCHED_S, *(each.rendered_s for each in note.ahead)])  # a pluck may be shorter
            levels = {source: self._level(note, source, seconds) for source in note.voices}
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

    def _level(self, note: Note, source: str, seconds: float) -> float:
        """Root mean square of the first `seconds`; 0 where it is not known, so that the source stays as it is."""
        stroke = note.stroke
        subject, kind = stroke.subject(source), "truth" if source == "truth" else "model"
        rate_hz = min(self._sound.rate_hz, 48_000)
        program = self._sources.program(subject, kind, rate_hz)
        if program.rendered:
            return note.voices[source].level_of_samples(seconds) if stroke.ear.pickup != "velocity" else 0.0
        mixer = Mixer(rate_hz, limited=False)
        initial_m, begin = self._sources.begin(subject, kind, rate_hz, stroke.pluck)
        mixer.add(Voice(program, initial_m, stroke.ear, begin=begin))
        sound = mixer.render(round(seconds * rate_hz))
        return math.sqrt(float(np.square(sound, dtype=np.float64).mean()))


def _match_gain(own: float, truth: float) -> float:
    limit = 10 ** (LARGEST_MATCH_DB / 20)
    gain = truth / own if own > 0 else 0.0
    return gain if 1 / limit <= gain <= limit else 1.0
