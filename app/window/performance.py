"""The note that is played and the pluck that is shown.

An event begins a note, which sounds at once; the picture follows. The render worker makes the motion of the same
pluck, and the views show it at the note's own time. All but `play_preset` runs in the window's thread.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from PySide6.QtCore import QObject

from app.audio.sound import Sound
from app.instrument.events import NoteOn, PluckAt
from app.patches.patch import Patch
from app.playing.key_note import KeyNote
from app.playing.keyboard import PluckRange
from app.playing.note import PluckVoices
from app.playing.notes import Notes
from app.playing.sources import Sources
from app.presets.library import Library, PresetEntry
from app.presets.words import NOTICEABLE, model_word, percent
from app.rendering import BlowTake, RenderRequest, RenderWorker, Take
from app.rendering.subject import path_of, string_of
from app.session.choices import Session, ShownString
from app.session.listener import Listener
from app.session.monitor import Monitor
from app.session.silence import why_ran_away
from app.session.slots import request_of
from app.shared.vocabulary import DIFFERENCE
from app.window.blows import Blows
from app.window.main_window import MainWindow
from app.window.panels import Moment, Panel
from app.window.playhead import Playhead
from app.window.render_signals import RenderSignals
from engine.plain_text import name_text

GROWN = 3.0  # times the preset's own error, from which an error has grown
PLACED = {"single", *ShownString.model_fields} - {"position"}  # what plucks at ten places depend on


class Performance(QObject):
    """The owner of the notes and the render worker. Times are in s from the pluck.

    Attributes:
        by_hand: the chosen pluck as an event, which loops play.
    """

    def __init__(
        self, window: MainWindow, session: Session, library: Library, sound: Sound, panels: Sequence[Panel]
    ) -> None:
        super().__init__(window)
        self._window = window
        self._session = session
        self._library = library
        self._sound = sound
        self._panels = panels
        self.by_hand: Callable[[], NoteOn | PluckAt] = lambda: PluckAt(session.choices.pluck)
        self._asked: RenderRequest | None = None
        self._shown: Playhead[Take] = Playhead()
        self._next_turn: PluckVoices | KeyNote | None = None  # of the loop, which waits in the mixer for its frame
        self._waiting_words = self._error_words = ""
        mail = self._mail = RenderSignals()
        mail.started.connect(self._take_started)
        mail.finished.connect(self._take_finished)
        mail.other_refused.connect(self._other_refused)
        mail.failed.connect(self._render_failed)
        mail.refused.connect(self._window.notices.report)
        self._sources = Sources()
        self.notes = Notes(sound, self._sources, library.find, mail.refused.emit, sound.set_effects)
        self._worker = RenderWorker(mail, self._sources.load, lambda: self.notes.ringing > 0, lambda: self.playable)
        self._blows = Blows(session, library, self._worker.submit)

    @property
    def entry(self) -> PresetEntry | None:
        """The chosen preset."""
        return self._library.find(self._session.choices.preset)

    @property
    def take(self) -> Take | None:
        """The motion that is shown; None while drums are played."""
        return None if self._plays_drums else self._shown.take

    @property
    def _plays_drums(self) -> bool:
        return self._session.choices.drums is not None

    @property
    def _playhead(self) -> Playhead[Take] | Playhead[BlowTake]:
        """The playhead of the motion that is shown."""
        return self._blows.shown if self._plays_drums else self._shown

    @property
    def ready(self) -> bool:
        """Return True if the motion that is shown is that of the chosen pluck."""
        return self.take is not None and self._is_of_chosen(self.take)

    @property
    def at_hand(self) -> bool:
        """Return True if the chosen pluck would sound at once: its sources are loaded, and the output is open."""
        return self._sound.status().changes_done > 0 and self.notes.at_hand

    @property
    def playable(self) -> bool:
        """Return True if a pluck and the patch's key, if any, would sound at once; of drums a key alone."""
        if self._plays_drums:
            return self._sound.status().changes_done > 0 and self.notes.keys.player is not None
        return self.at_hand and (self._session.choices.patch is None or self.notes.keys.player is not None)

    @property
    def playing(self) -> bool:
        """Return True if a note rings that was not released."""
        return self.notes.ringing > 0

    @property
    def position_s(self) -> float:
        """The playhead: the time in the shown motion that is heard now, or where it stands."""
        return self._playhead.position_s(self._sound.mixer.output_latency_s)

    @property
    def moving(self) -> bool:
        """Return True if the playhead moves."""
        return self._playhead.moving

    @property
    def settled(self) -> bool:
        """Return True if motion and signals are complete, so that views need not look for more."""
        if self._plays_drums:
            return self._blows.settled
        return self.take is None or (self.take.complete and self.take.listened.complete)

    @property
    def match(self) -> Mapping[str, float] | None:
        """The factor by source that brings what is chosen to the level of the truth; None: not known yet."""
        latest = self.notes.latest
        keys = isinstance(latest, KeyNote) and self._session.choices.plays_patch
        return latest.match if latest is not None and keys else self.notes.match

    def moment(self, elapsed_s: float) -> Moment:
        """The moment that panels show now; `elapsed_s`: since they were shown the last one."""
        blow = self._blows.shown.take if self._plays_drums else None
        return Moment(self.take, self.position_s, self.moving, elapsed_s, blow, self._playhead.audible)

    def catch_up(self, panel: Panel) -> None:
        """Show a panel that was made late the motion that it has missed."""
        if self._plays_drums and (blow := self._blows.shown.take) is not None:
            if not panel.of_strings:
                panel.take_started(blow)
        elif self.take is not None:
            panel.take_started(self.take)
            if self._shown.finished:
                panel.take_finished(self.take)

    # Intents

    def follow(self) -> None:
        """Show the latest note while it rings, if its motion is rendered; otherwise `_take_started` does."""
        latest = self.notes.latest
        if isinstance(latest, KeyNote) and latest.of_drum:
            if self._plays_drums:
                self._blows.follow(latest)
            return
        if latest is None or latest is self._shown.note or latest.released or latest.over:
            return
        if self.ready and self._is_chosen(latest):
            self._forget_turn()
            self._shown.note, self._shown.parked_s = latest, latest.from_s

    def stop(self) -> None:
        """Fade all sound out; the playhead stays."""
        self._forget_turn()
        self._playhead.park(self.position_s)
        self.notes.stop()

    def seek(self, position_s: float) -> None:
        """Move the playhead; while notes ring, one that begins there replaces them."""
        if (take := self._playhead.take) is None:
            return
        position_s = min(max(position_s, 0.0), take.seconds)
        self._forget_turn()
        self._playhead.park(position_s)
        if not self._plays_drums and self.playing and (note := self.notes.ring(position_s, alone=True)) is not None:
            self.notes.latest = self._shown.note = note

    def choices_changed(self, names: frozenset[str]) -> None:
        """Apply changed fields of `Choices` to the notes, and ask for another motion where that has changed."""
        choices, entry = self._session.choices, self.entry
        if names & {"face", *Monitor.model_fields}:
            self.notes.set_monitor(choices, compared=choices.face == "lab")
        if names & Monitor.model_fields.keys():
            self.hear_dry(False)
        if names & {"patch", "single"}:  # ends a comparison
            self.notes.set_instrument(choices.patch, choices.ear, choices.single)
        elif names & Listener.model_fields.keys():
            self.notes.listen(choices.ear)
        request = None if self._plays_drums else request_of(choices, self._library)
        if self._plays_drums:
            self._blows.listen()
        elif names & {"patch", "single"}:
            self._blows.forget()
        if names & PLACED and not (choices.plays_patch or entry is None or request is None):
            plucks = [replace(request.pluck, position=place) for place in PluckRange.of(entry.info).row]
            self.notes.prepare_plucks(request.preset, plucks)
        if "loop" in names and not choices.loop:
            self._forget_turn()
        if request != self._asked:  # else an event may have chosen another pluck, which the session takes later
            self._asked = request
            self.notes.choose(request)
            if request is None:
                self._forget_turn()
                self._shown = Playhead()
                self._show_error("")
                self._window.show_growth("")
            else:
                self.notes.prepare(request.preset, *request.others)
                self._worker.submit(request)
        self.follow()

    def play_preset(self, name: str) -> None:
        """Let events pluck this preset's string from now on. Any thread; the choices must follow."""
        choices = self._session.choices
        self.notes.set_instrument(choices.patch, choices.ear, name)

    def hear_dry(self, dry: bool) -> None:
        """Leave body and room out where `dry` is True; else only while the difference is heard."""
        self.notes.hear_dry(dry or self._session.choices.source_heard == DIFFERENCE)

    def hear_patch(self, patch: Patch | None) -> None:
        """Let keys play this patch until another is chosen; None: the chosen one. The choices stay."""
        choices = self._session.choices
        if patch is not None:
            choices = choices.changed({"patch": patch})
        self.notes.set_instrument(choices.patch, choices.ear, choices.single)

    def close(self) -> None:
        """End the threads; may be called again."""
        self.notes.stop()
        self._worker.close()
        self.notes.close()

    # Sixty times a second

    def tick(self) -> None:
        """Forget notes that ended, continue with the loop, and update the header."""
        self.notes.poll()
        if self._session.choices.loop:
            self._hand_over_turn()
        waits = self._buffering_words()
        if waits != self._waiting_words:
            self._waiting_words = waits
            self._show_words()

    def _buffering_words(self) -> str:
        """The time until a model that is rendered ahead will sound, in words; "" where none waits."""
        latest = self.notes.latest
        if not isinstance(latest, PluckVoices) or not latest.waits_s:
            return ""
        entry = self._library.find(name_text(path_of(latest.request.preset).stem))
        name = model_word(entry.info.model) if entry else "model"
        return f"{name}: buffering, starts in {latest.waits_s:.1f} s"

    def _hand_over_turn(self) -> None:
        """Hand the next turn of the loop to the mixer, shortly before it begins."""
        # once another pluck is chosen, the note that rings is not the shown one, and its turn is the new pluck's
        note = self._shown.note or self.notes.latest
        take = self._shown.take
        turn = self._next_turn
        if note is None or take is None or note.request is None or not note.began:
            return
        if turn is not None:
            if turn.began and not turn.cut:
                self.notes.latest = turn
                if self._is_chosen(turn):
                    self._shown.note = turn
            if turn.began:  # it sounds, or it was cut with its mixer: the next call hands over another
                self._next_turn = None
            return
        if not (note.cut or note.released):
            self._next_turn = self.notes.turn(note, take.seconds, self.by_hand())

    def _forget_turn(self) -> None:
        turn, self._next_turn = self._next_turn, None
        if turn is not None:
            turn.release(0.0)
            if isinstance(turn, KeyNote):
                self.notes.keys.recorder.cancel(turn.event)
            if self._shown.note is not None:
                self._shown.note.release_at(0)

    # Signals of the render worker

    def _take_started(self, take: Take | BlowTake) -> None:
        if isinstance(take, BlowTake):
            if not self._plays_drums or not self._blows.started(take):  # overtaken by the next one
                return
        elif take is self._shown.take or not self._is_of_chosen(take):  # shown already, or overtaken
            return
        else:
            self._shown = Playhead(take)
        for panel in self._panels:
            if not (panel.of_strings and self._plays_drums):
                panel.take_started(take)
        self.follow()
        self._show_error("Rendering …")
        self._window.show_error(math.nan)
        self._window.show_growth("")

    def _take_finished(self, take: Take | BlowTake) -> None:
        if isinstance(take, BlowTake):
            if self._plays_drums and take is self._blows.shown.take:
                self._show_error(f"Error of this blow: {percent(math.sqrt(take.errors.rel_mse))} over the drum")
            return
        if take is not self.take or self._shown.finished:
            return
        self._shown.finished = True
        for panel in self._panels:
            panel.take_finished(take)
        if reason := why_ran_away(take):
            self._window.notices.report(reason)
        errors, places = take.errors_by_training, ("in the training range", "beyond")
        parts = [f"{percent(error)} {place}" for error, place in zip(errors, places, strict=False)]
        self._show_error("Error of this pluck: " + ", ".join(parts))
        self._window.show_error(take.error)
        self._window.show_growth(growth_words(errors, take.info.rel_mae))

    def _other_refused(self, preset: str, message: str) -> None:
        self._window.notices.report(f"{preset} cannot be heard beside this preset: {message}")

    def _render_failed(self, message: str, detail: str) -> None:
        self._show_error("")
        self._window.notices.report(message, detail)

    # Helpers

    def _show_error(self, words: str) -> None:
        self._error_words = words
        self._show_words()

    def _show_words(self) -> None:
        """Show in the header how long a model is still waited for, or the error."""
        self._window.error_label.setText(self._waiting_words or self._error_words)

    def _is_chosen(self, note: PluckVoices | KeyNote) -> bool:
        """Return True if a note is of the chosen pluck."""
        chosen_request, request = self._asked, note.request
        return (
            chosen_request is not None
            and request is not None
            and (request.preset, request.pluck) == (chosen_request.preset, chosen_request.pluck)
        )

    def _is_of_chosen(self, take: Take) -> bool:
        """Return True if a take is of the chosen pluck."""
        request, entry = self._asked, self.entry
        if request is None or entry is None:
            return False
        string = string_of(request.preset) or entry.info.string
        chosen = entry.name, string, request.pluck, request.seconds
        return (take.preset_name, take.info.string, take.pluck, take.seconds) == chosen


def growth_words(errors: Sequence[float], validation_mae: float | None) -> str:
    """The words for people that the error of a pluck has grown; "" where it has not.

    Args:
        errors: relative mean absolute errors within the training range and beyond, as far as there are.
        validation_mae: that of the preset on validation data; None: not known.
    """
    largest = max((error for error in errors if not math.isnan(error)), default=0.0)
    if largest < max(NOTICEABLE, GROWN * (validation_mae or 0.0)):
        return ""
    where = "on this pluck" if errors and errors[0] == largest else "past the end of its training"
    return f"The model's error grows to {percent(largest)} {where}. The Lab shows it (F9)."
