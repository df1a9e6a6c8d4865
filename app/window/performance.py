"""The note that is played and the pluck that is shown.

An event begins a note, which sounds at once; the picture follows. The render worker makes the motion of the same
pluck, and the views show it at the note's own time. All but `play_preset` runs in the window's thread.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from PySide6.QtCore import QObject, Signal

from app.audio.sound import Sound
from app.instrument.drum_keys import DrumKeys
from app.instrument.events import Event, NoteOn, PluckAt
from app.patches.patch import Patch
from app.playing.key_note import KeyNote
from app.playing.note import PluckVoices
from app.playing.notes import Notes
from app.playing.playback import Due
from app.playing.sources import Sources
from app.presets.library import Library, PresetEntry
from app.presets.words import NOTICEABLE, model_word, percent
from app.rendering import BlowRequest, BlowTake, RenderRequest, RenderWorker, Take
from app.rendering.subject import path_of, string_of
from app.session.listener import Listener
from app.session.monitor import Monitor
from app.session.silence import why_ran_away
from app.session.slots import request_of
from app.shared.vocabulary import DIFFERENCE
from app.stage.session import Session
from app.stage.stage import Turned
from app.window.main_window import MainWindow
from app.window.panels import Moment, Panel
from engine.plain_text import name_text
from engine.strike import Strike

GROWN = 3.0  # times the preset's own error, from which an error has grown


@dataclass
class Playhead:
    """A motion and the note whose time it follows; without a note it stands at `parked_s`.

    Attributes:
        finished: whether the motion is known to be complete.
    """

    take: Take | BlowTake | None = None
    note: PluckVoices | KeyNote | None = None
    parked_s: float = 0.0
    finished: bool = False

    def position_s(self, latency_s: float) -> float:
        """The time in the motion that is heard now, or where it stands; `latency_s`: of the output."""
        if self.take is None:
            return 0.0
        heard_s = self.parked_s
        if self.note is not None:
            heard_s = max(self.note.seconds - latency_s, self.note.from_s)
        return min(max(heard_s, 0.0), self.take.seconds)

    def park(self, position_s: float) -> None:
        """Park the playhead: it stands at a time of the motion from now on."""
        self.note, self.parked_s = None, position_s

    @property
    def moving(self) -> bool:
        """Return True if it moves."""
        note, take = self.note, self.take
        return note is not None and take is not None and not note.over and note.seconds < take.seconds

    @property
    def audible(self) -> bool:
        """Return True if the note of the motion rings, which may be longer than the motion."""
        return self.note is not None and self.take is not None and not self.note.over


class RenderSignals(QObject):
    """The `RenderListener` of the window: calls of other threads become signals, which Qt queues for its thread."""

    started = Signal(object)  # Take or BlowTake
    finished = Signal(object)  # the same
    other_refused = Signal(str, str)  # name of the preset, message
    failed = Signal(str, str)  # message, details
    refused = Signal(str, str)  # a pluck cannot be played: message, details

    def take_started(self, take: Take | BlowTake) -> None:
        self.started.emit(take)

    def take_finished(self, take: Take | BlowTake) -> None:
        self.finished.emit(take)

    def other_failed(self, preset: str, message: str) -> None:
        self.other_refused.emit(preset, message)

    def render_failed(self, message: str, detail: str) -> None:
        self.failed.emit(message, detail)


class Performance(QObject):
    """The owner of the notes and the render worker. Times are in s from the pluck or blow.

    Attributes:
        compared: a blind test is open: no other note begins, and all is heard without body and room.
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
        self.compared = False
        self._asked: RenderRequest | BlowRequest | None = None  # the motion that is to be shown
        self._blow: KeyNote | None = None  # the note of a blow that is asked for
        self._shown = Playhead()
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

    @property
    def entry(self) -> PresetEntry | None:
        """The chosen preset."""
        return self._library.find(self._session.choices.preset)

    @property
    def take(self) -> Take | None:
        """The motion of a string that is shown; None while drums are played."""
        return self._shown.take if isinstance(self._shown.take, Take) else None

    @property
    def _plays_drums(self) -> bool:
        return self._session.choices.drums is not None

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
        return self._shown.position_s(self._sound.mixer.output_latency_s)

    @property
    def moving(self) -> bool:
        """Return True if the playhead moves."""
        return self._shown.moving

    @property
    def settled(self) -> bool:
        """Return True if motion and signals are complete, so that views need not look for more."""
        take = self._shown.take
        return take is None or (take.complete and take.listened.complete)

    @property
    def match(self) -> Mapping[str, float] | None:
        """The factor by source that brings what is chosen to the level of the truth; None: not known yet."""
        latest = self.notes.latest
        keys = isinstance(latest, KeyNote) and self._session.choices.plays_patch
        return latest.match if latest is not None and keys else self.notes.match

    def moment(self, elapsed_s: float) -> Moment:
        """The moment that panels show now; `elapsed_s`: since they were shown the last one."""
        shown = self._shown
        return Moment(shown.take, self.position_s, shown.moving, elapsed_s, shown.audible)

    def catch_up(self, panel: Panel) -> None:
        """Show a panel that was made late the motion that it has missed."""
        take = self._shown.take
        if take is None or (panel.of_strings and self._plays_drums):
            return
        panel.take_started(take)
        if isinstance(take, Take) and self._shown.finished:
            panel.take_finished(take)

    # Intents

    def follow(self) -> None:
        """Show the latest note while it rings, if its motion is rendered; otherwise `_take_started` does."""
        latest = self.notes.latest
        if isinstance(latest, KeyNote) and latest.of_drum:
            self._follow_blow(latest)
            return
        if latest is None or latest is self._shown.note or latest.released or latest.over:
            return
        if self.ready and self._is_chosen(latest):
            self._forget_turn()
            self._shown.note, self._shown.parked_s = latest, latest.from_s

    def _follow_blow(self, note: KeyNote) -> None:
        """Show the latest blow on the drums that are played, once its motion is rendered."""
        choices = self._session.choices
        entry = self._library.find(note.patch.preset)
        keys = note.player.keys
        patch = choices.patch
        if note is self._blow or choices.drums is None or patch is None or note.patch.name != patch.name:
            return
        drum_key = keys.of_key(note.event.key) if isinstance(keys, DrumKeys) else None
        if drum_key is None or entry is None:
            return
        strike = drum_key.strike(note.event.velocity, note.patch.pluck.curve)
        if note.event.place is not None:
            strike = Strike(note.event.place, strike.speed_m_s, strike.mallet)
        self._asked = BlowRequest(entry.path, drum_key.modes, strike, choices.seconds, choices.ear)
        self._blow = note
        shown = self._shown.take
        if isinstance(shown, BlowTake) and self._asked.same_motion(shown.request):
            self._shown = Playhead(shown, note)
        self._worker.submit(self._asked)

    def stop(self) -> None:
        """Fade all sound out; the playhead stays."""
        self._forget_turn()
        self._shown.park(self.position_s)
        self.notes.stop()

    def seek(self, position_s: float) -> None:
        """Move the playhead; while notes ring, one that begins there replaces them."""
        if (take := self._shown.take) is None:
            return
        position_s = min(max(position_s, 0.0), take.seconds)
        self._forget_turn()
        self._shown.park(position_s)
        if not self._plays_drums and self.playing and (note := self.notes.ring(position_s, alone=True)) is not None:
            self.notes.latest = self._shown.note = note
            self._session.send(Turned(note))

    def choices_changed(self, names: frozenset[str]) -> None:
        """Apply changed fields of `Choices` to the notes, and ask for another motion where that has changed."""
        choices = self._session.choices
        if names & {"face", *Monitor.model_fields}:
            self.notes.set_monitor(choices, compared=choices.face == "lab")
        if names & Monitor.model_fields.keys():
            self._hear_dry()
        if names & {"patch", "single"}:  # ends a comparison
            self.notes.set_instrument(choices.patch, choices.ear, choices.single)
        elif names & Listener.model_fields.keys():
            self.notes.listen(choices.ear)
        request = self._request()
        if "loop" in names and not choices.loop:
            self._forget_turn()
        if request != self._asked:  # else an event may have chosen another pluck, which the session takes later
            self._ask(request)
        self.follow()

    def _request(self) -> RenderRequest | BlowRequest | None:
        """The motion that the choices ask for: of drums the latest blow, until other ones are played."""
        choices = self._session.choices
        asked = self._asked
        blow = self._blow
        if choices.drums is None:
            return request_of(choices, self._library)
        is_theirs = blow is not None and choices.patch is not None and blow.patch.name == choices.patch.name
        if not is_theirs or not isinstance(asked, BlowRequest):
            return None
        is_heard = (asked.seconds, asked.ear) == (choices.seconds, choices.ear)
        return asked if is_heard else replace(asked, seconds=choices.seconds, ear=choices.ear)

    def _ask(self, request: RenderRequest | BlowRequest | None) -> None:
        """Ask for another motion; None: there is none, and nothing is shown."""
        if type(request) is not type(self._asked):
            self._shown = Playhead()
        self._asked = request
        plucked = request if isinstance(request, RenderRequest) else None
        self.notes.choose(plucked)
        if not isinstance(request, BlowRequest):
            self._blow = None
        if plucked is not None:
            self.notes.prepare(plucked.preset, *plucked.others)
        if request is not None:
            self._worker.submit(request)
        else:
            self._forget_turn()
            self._show_error("")

    def play_preset(self, name: str) -> None:
        """Let events pluck this preset's string from now on. Any thread; the choices must follow."""
        choices = self._session.choices
        self.notes.set_instrument(choices.patch, choices.ear, name)

    def handle(self, event: Event, due: Due | None = None) -> PluckVoices | KeyNote | None:
        """Play an event; the note that it began, or None. Any thread."""
        if self.compared and isinstance(event, NoteOn | PluckAt):
            return None  # all else is heard: a pedal that is lifted meanwhile is up afterwards
        return self.notes.handle(event, due)

    def compare(self, compared: bool) -> None:
        """Begin or end a blind test, beside which no other note begins."""
        self.compared = compared
        self._hear_dry()

    def _hear_dry(self) -> None:
        """Leave body and room out in a blind test, and while the difference is heard."""
        self.notes.hear_dry(self.compared or self._session.choices.source_heard == DIFFERENCE)

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
            if turn.began:  # it sounds, or it was cut with its mixer: the next call hands over another
                self._next_turn = None
                if not turn.cut:
                    self.notes.latest = turn
                    self._session.send(Turned(turn))
            return
        if not (note.cut or note.released):
            self._next_turn = self.notes.turn(note, take.seconds, self._session.stage.by_hand())

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
        before = self._shown
        if take is before.take or not self._is_of_chosen(take):  # shown already, or overtaken
            return
        self._shown = Playhead(take, self._blow)
        is_same_strike = (
            isinstance(take, BlowTake)
            and isinstance(before.take, BlowTake)
            and take.request.strike is before.take.request.strike
        )
        if is_same_strike and before.note is None:
            self._shown.park(before.parked_s)
        for panel in self._panels:
            if not (panel.of_strings and self._plays_drums):
                panel.take_started(take)
        self.follow()
        self._show_error("Rendering …")

    def _take_finished(self, take: Take | BlowTake) -> None:
        if take is not self._shown.take or self._shown.finished:
            return
        self._shown.finished = True
        if isinstance(take, BlowTake):
            self._show_error(f"Error of this blow: {percent(math.sqrt(take.error_course.rel_mse))} over the drum")
            return
        for panel in self._panels:
            panel.take_finished(take)
        if reason := why_ran_away(take):
            self._window.notices.report(reason)
        errors, places = take.errors_by_training, ("in the training range", "beyond")
        parts = [f"{percent(error)} {place}" for error, place in zip(errors, places, strict=False)]
        growth = growth_words(errors, take.info.rel_mae)
        self._show_error("Error of this pluck: " + ", ".join(parts), take.error, growth)

    def _other_refused(self, preset: str, message: str) -> None:
        self._window.notices.report(f"{preset} cannot be heard beside this preset: {message}")

    def _render_failed(self, message: str, detail: str) -> None:
        self._show_error("")
        self._window.notices.report(message, detail)

    # Helpers

    def _show_error(self, words: str, error: float = math.nan, growth: str = "") -> None:
        """Show the error of the shown motion in the header, and that it grew, as far as they are known."""
        self._error_words = words
        self._show_words()
        self._window.show_error(error)
        self._window.show_growth(growth)

    def _show_words(self) -> None:
        """Show in the header how long a model is still waited for, or the error."""
        self._window.error_label.setText(self._waiting_words or self._error_words)

    def _is_chosen(self, note: PluckVoices | KeyNote) -> bool:
        """Return True if a note is of the chosen pluck."""
        chosen_request, request = self._asked, note.request
        return (
            isinstance(chosen_request, RenderRequest)
            and request is not None
            and (request.preset, request.pluck) == (chosen_request.preset, chosen_request.pluck)
        )

    def _is_of_chosen(self, take: Take | BlowTake) -> bool:
        """Return True if a take is of the chosen pluck, or of the latest blow."""
        request, entry = self._asked, self.entry
        if isinstance(take, BlowTake):
            return take.request.same_motion(request)
        if not isinstance(request, RenderRequest) or entry is None:
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
