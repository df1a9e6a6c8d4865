"""The pluck that is played and the pluck that is shown.

A gesture strikes a note, which sounds at once; the picture follows: the render worker makes the motion of the same
pluck, and the views show it at the note's own time. All but `strike` and `handle` runs in the window's thread.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject

from app.audio.sound import Sound
from app.export.sound import Through
from app.instrument.events import Event
from app.instrument.player import Struck
from app.patches.patch import Patch
from app.playing.chosen import mix_of, render_request, stroke_of, subject_of
from app.playing.due import Due
from app.playing.keyboard import PLACES, Reach
from app.playing.live import Live
from app.playing.notes import Note, Notes
from app.playing.sources import Sources
from app.playing.stroke import Stroke
from app.presets.library import Library, PresetEntry
from app.presets.words import model_word, percent
from app.rendering import RenderRequest, RenderWorker, Take
from app.rendering.subject import path_of, string_of
from app.session.choices import Choices, Session
from app.session.ears import heard_ear
from app.session.instrument import choices_of
from app.session.silence import why_ran_away
from app.window.main_window import MainWindow
from app.window.panels import Panel
from app.window.render_signals import RenderSignals
from engine.metrics import ErrorSums
from engine.pluck import Pluck
from engine.resonators.string import StringParameters

MotionKey = tuple[str, StringParameters, Pluck, float]  # the preset's name, its string, the pluck, how long it is
LOOP_AHEAD_S = 0.5  # by which the next turn of a loop is handed to the mixer early
EAR_FIELDS = {"listen", "listen_right", "stereo", "pickup", "solo"}
PLACE_FIELDS = {"preset", "string", "amplitude_mm", "shape", "width", "patch", "keys_play"}  # of keys at ten places
SLOT_FIELDS = {"a", "b", "heard"}
MIX_FIELDS = {"a", "b", "heard", "level_match", "difference_gain_db"}


def motion_key(take: Take) -> MotionKey:
    """What the motion of a take depends on."""
    return take.preset_name, take.info.string, take.pluck, take.seconds


@dataclass
class _Shown:
    """What the views show: a motion, and the note whose time it follows; without a note it stands at `parked_s`."""

    take: Take | None = None
    note: Note | None = None
    parked_s: float = 0.0


class Performance(QObject):
    """Owns the notes, the patch that is played (`live`) and the render worker. Times are in s from the pluck."""

    def __init__(
        self, window: MainWindow, session: Session, library: Library, sound: Sound, panels: Sequence[Panel]
    ) -> None:
        super().__init__(window)
        self._window, self._session, self._library, self._sound = window, session, library, sound
        self._panels = panels
        self._asked: RenderRequest | None = None
        self._shown = _Shown()
        self._latest: Note | None = None  # struck last
        self._next_turn: Note | None = None  # of the loop, which waits in the mixer for its frame
        self._waiting_words = self._error_words = ""
        mail = self._mail = RenderSignals()
        mail.started.connect(self._take_started)
        mail.finished.connect(self._take_finished)
        mail.other_refused.connect(self._other_refused)
        mail.failed.connect(self._render_failed)
        mail.refused.connect(self._window.notices.tell)
        self._sources = Sources()
        self.notes = Notes(sound, self._sources, mail.refused.emit)
        self.live = Live(self.notes, self._sources, self._path_of, mail.refused.emit, sound.set_effects)
        self._worker = RenderWorker(mail, self._sources.load, lambda: self.notes.ringing > 0)

    @property
    def entry(self) -> PresetEntry | None:
        """The chosen preset."""
        return self._library.find(self._session.choices.preset)

    @property
    def take(self) -> Take | None:
        """The motion that is shown."""
        return self._shown.take

    @property
    def ready(self) -> bool:
        """Whether the motion that is shown is that of the chosen pluck."""
        return self.take is not None and motion_key(self.take) == self._key(self._session.choices)

    @property
    def at_hand(self) -> bool:
        """Whether the chosen pluck would sound at once: its sources are loaded, and the output is open."""
        stroke = self._stroke()
        return stroke is not None and self._sound.status().changes_done > 0 and self.notes.have(stroke)

    @property
    def playing(self) -> bool:
        """Whether a note rings that was not released."""
        return self.notes.ringing > 0

    @property
    def position_s(self) -> float:
        """The playhead: the time in the shown motion that is heard now, or where it stands."""
        shown = self._shown
        if shown.take is None:
            return 0.0
        heard_s = shown.parked_s
        if shown.note is not None:
            heard_s = max(shown.note.seconds - self._sound.mixer.output_latency_s, shown.note.from_s)
        return min(max(heard_s, 0.0), shown.take.seconds)

    @property
    def moving(self) -> bool:
        """Whether the playhead moves."""
        note, take = self._shown.note, self._shown.take
        return note is not None and take is not None and not note.over and note.seconds < take.seconds

    @property
    def settled(self) -> bool:
        """Whether motion and signals are complete, so that views need not look for more."""
        return self.take is None or (self.take.complete and self.take.listened.complete)

    @property
    def match(self) -> Mapping[str, float] | None:
        """By source, the factor that brings the latest note to the level of the truth; None: not known yet."""
        return None if self._latest is None else self._latest.match

    # Intents

    def strike(self, choices: Choices) -> Note | None:
        """Plucks the string as `choices` say, while other notes ring on. Any thread; `follow` then shows it.

        None where the preset is not in the library.
        """
        entry = self._library.find(choices.preset)
        if entry is None:
            return None
        note = self.notes.strike(self._stroke_of(choices, entry))
        self._latest = note
        return note

    def handle(self, event: Event, due: Due | None = None) -> Struck | None:
        """Plays an event through the patch. Any thread; `follow` then shows it. None where it struck no string."""
        made = self.live.handle(event, due)
        if made is None:
            return None
        struck, self._latest = made
        return struck

    def pluck(self) -> None:
        """Plucks the string as chosen, and shows it."""
        self.strike(self._session.choices)
        self.follow()

    def follow(self) -> None:
        """Shows the latest note while it rings, if its motion is rendered; otherwise `_take_started` does."""
        latest = self._latest
        if latest is None or latest is self._shown.note or latest.released or latest.over:
            return
        if self.ready and self._is_of(latest, self._session.choices):
            self._forget_turn()
            self._shown.note, self._shown.parked_s = latest, latest.from_s

    def play_or_stop(self) -> None:
        """Stops what rings; where nothing does, plucks."""
        if self.playing:
            self.stop()
        else:
            self.pluck()

    def stop(self) -> None:
        """Everything fades out; the playhead stays."""
        self._forget_turn()
        self._shown.parked_s = self.position_s
        self._shown.note = None
        self.live.stop()
        self.notes.stop()

    def seek(self, position_s: float) -> None:
        """Moves the playhead; while notes ring, one that begins there replaces them."""
        if self.take is None:
            return
        position_s = min(max(position_s, 0.0), self.take.seconds)
        self._forget_turn()
        self._shown.note, self._shown.parked_s = None, position_s
        if self.playing and (stroke := self._stroke()) is not None:
            self._latest = self._shown.note = self.notes.strike(stroke, from_s=position_s, alone=True)

    def render(self) -> None:
        """Asks for the motion of what is chosen."""
        entry = self.entry
        self._asked = None if entry is None else render_request(self._session.choices, entry.path, self._library)
        if self._asked is None:
            self._window.notices.tell("No preset was found: install the presets again, or train one.")
            return
        self.notes.prepare(self._asked.preset, *self._asked.others)
        self._worker.submit(self._asked)

    def choices_changed(self, names: frozenset[str]) -> None:
        """Applies changed fields of `Choices` to the notes, and asks for another motion where that has changed."""
        choices, entry = self._session.choices, self.entry
        if names & MIX_FIELDS:
            self.notes.set_mix(mix_of(choices))
        if names & {*EAR_FIELDS, "patch"}:  # another patch ends a comparison, which was heard elsewhere
            self.notes.listen(heard_ear(choices))
        if names & SLOT_FIELDS:
            self.hear_dry(False)
        if "patch" in names:
            self.live.set_patch(choices.patch, heard_ear(choices))
        elif names & EAR_FIELDS:
            self.live.listen(heard_ear(choices))
        self.live.seconds = choices.seconds
        if names & PLACE_FIELDS and entry is not None and not choices.plays_pitches:
            reach = Reach.of(entry.info)
            places = (reach.place(number / (PLACES - 1)) for number in range(PLACES))
            plucks = [replace(choices.pluck, position=place) for place in places]
            self.notes.prepare_plucks(subject_of(choices, entry.path), plucks)
        if "loop" in names and not choices.loop:
            self._forget_turn()
        if entry is not None and render_request(choices, entry.path, self._library) != self._asked:
            self.render()
        self.follow()

    def hear_dry(self, dry: bool) -> None:
        """Leaves body and room out where `dry` is True; else only while the difference is heard."""
        self.live.hear_dry(dry or self._session.source_heard == "difference")

    def hear_patch(self, patch: Patch | None) -> None:
        """Lets keys play this patch until another is chosen; None: the chosen one. The choices stay."""
        choices = self._session.choices
        if patch is not None:
            choices = choices.changed(choices_of(patch))
        self.notes.listen(heard_ear(choices))
        self.live.set_patch(choices.patch, heard_ear(choices))

    def through(self, choices: Choices) -> Through | None:
        """What the instrument adds to the chosen string: its level, body and room; None: there is no instrument."""
        patch, string = self.live.heard_through, choices.string
        if patch is None:
            return None
        return Through.of(patch, 1.0 if string is None else self.live.gain_of(string.parameters))

    def render_sound(self, choices: Choices, rate_hz: int) -> Future[Mapping[str, NDArray[np.float32]]]:
        """Model and truth of a pluck as they are heard, (frames, channels) by source, rendered in the background.

        `choices.preset` must be in the library.
        """
        entry = self._library.find(choices.preset)
        assert entry is not None
        stroke = replace(stroke_of(choices, entry.path, self._library), sources=("model", "truth"))
        return self.notes.render(stroke, rate_hz, choices.seconds)

    def close(self) -> None:
        """Ends the threads; may be called again."""
        self.notes.stop()
        self._worker.close()
        self.notes.close()

    # Sixty times a second

    def tick(self) -> None:
        """Forgets notes that ended, goes on with the loop, and updates the header."""
        self.notes.poll()
        if self._session.choices.loop:
            self._turn()
        waits = self._waiting()
        if waits != self._waiting_words:
            self._waiting_words = waits
            self._show_words()

    def _waiting(self) -> str:
        """When a model that is rendered before it is heard will sound; "" where none waits."""
        latest = self._latest
        if latest is None or not latest.waits_s:
            return ""
        entry = self._library.find(path_of(latest.stroke.preset).stem)
        name = model_word(entry.info.model) if entry else "model"
        return f"{name}: buffering, starts in {latest.waits_s:.1f} s"

    def _turn(self) -> None:
        """Hands the next turn of the loop to the mixer, LOOP_AHEAD_S before it begins."""
        # once another pluck is chosen, the note that rings is not the shown one, and its turn is the new pluck's
        note, take, turn = self._shown.note or self._latest, self._shown.take, self._next_turn
        if note is None or take is None or not note.began:
            return
        if turn is not None:
            if turn.began and not turn.cut:
                self._latest = turn
                if self._is_of(turn, self._session.choices):
                    self._shown.note = turn
            if turn.began:  # it sounds, or it was cut with its mixer: the next call hands over another
                self._next_turn = None
            return
        if note.cut or note.released or (stroke := self._stroke()) is None:
            return
        frame, mixer = note.frame_at(take.seconds), self._sound.mixer
        if frame > (mixer.seconds + LOOP_AHEAD_S) * mixer.rate_hz:
            return
        note.release_at(frame)
        self._next_turn = self.notes.strike(stroke, begin_frame=frame)

    def _forget_turn(self) -> None:
        turn, self._next_turn = self._next_turn, None
        if turn is not None:
            turn.release(0.0)
            if self._shown.note is not None:
                self._shown.note.release_at(0)

    # Signals of the render worker

    def _take_started(self, take: Take) -> None:
        if motion_key(take) != self._key(self._session.choices):  # overtaken by the next one
            return
        self._shown = _Shown(take)
        for panel in self._panels:
            panel.take_started(take)
        self.follow()
        self._tell("rendering …")

    def _take_finished(self, take: Take, errors: ErrorSums) -> None:
        if take is not self.take:
            return
        for panel in self._panels:
            panel.take_finished(take, errors)
        if reason := why_ran_away(take):
            self._window.notices.tell(reason)
        windows = errors.windows(take.picture_hz, (0.0, take.info.horizon_s, max(take.seconds, take.info.horizon_s)))
        parts = [
            f"{percent(w.rel_mae)} {place}" for w, place in zip(windows, ("as trained", "past it"), strict=False)
        ]
        self._tell("error of this pluck: " + ", ".join(parts))

    def _other_refused(self, preset: str, message: str) -> None:
        self._window.notices.tell(f"{preset} cannot be heard beside this preset: {message}")

    def _render_failed(self, message: str, detail: str) -> None:
        self._tell("")
        self._window.notices.tell(message, detail)

    # Helpers

    def _tell(self, words: str) -> None:
        self._error_words = words
        self._show_words()

    def _show_words(self) -> None:
        """In the header: how long a model is still waited for, or the error."""
        self._window.error_label.setText(self._waiting_words or self._error_words)

    def _stroke(self) -> Stroke | None:
        entry = self.entry
        return None if entry is None else self._stroke_of(self._session.choices, entry)

    def _stroke_of(self, choices: Choices, entry: PresetEntry) -> Stroke:
        """The chosen pluck, with the gain that its string has when a key plays it."""
        stroke = stroke_of(choices, entry.path, self._library)
        string = string_of(stroke.preset)
        return stroke if string is None else replace(stroke, gain=self.live.gain_of(string))

    def _is_of(self, note: Note, choices: Choices) -> bool:
        entry = self._library.find(choices.preset)
        if entry is None or note.stroke.pluck != choices.pluck or path_of(note.stroke.preset) != entry.path:
            return False
        return string_of(note.stroke.preset) == string_of(subject_of(choices, entry.path))

    def _key(self, choices: Choices) -> MotionKey | None:
        entry = self._library.find(choices.preset)
        if entry is None:
            return None
        string = choices.string.parameters if choices.string is not None else entry.info.string
        return entry.name, string, choices.pluck, choices.seconds

    def _path_of(self, preset: str) -> Path | None:
        entry = self._library.find(preset)
        return None if entry is None else entry.path
