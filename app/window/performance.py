"""The note that is played and the pluck that is shown.

An event begins a note, which sounds at once; the picture follows. The render worker makes the motion of the same
pluck, and the views show it at the note's own time. All but `play_preset` runs in the window's thread.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from PySide6.QtCore import QObject, Signal

from app.audio.sound import Sound
from app.instruments.instrument import Instrument
from app.playing.key_note import KeyNote
from app.playing.note import PluckVoices
from app.playing.notes import Notes
from app.playing.sources import Sources
from app.presets.library import Library, PresetEntry
from app.presets.words import NOTICEABLE, model_word, percent
from app.rendering import BlowTake, RenderWorker, Take
from app.rendering.subject import path_of, string_of
from app.session.choices import OBSERVED
from app.session.monitor import Monitor
from app.session.silence import why_ran_away
from app.session.slots import request_of
from app.stage.session import Session
from app.stage.stage import Asked, Note, Parked, Rendered, Turned
from app.window.main_window import MainWindow
from app.window.panels import Moment, Panel
from engine.plain_text import name_text

GROWN = 3.0  # times the preset's own error, from which an error has grown


class Performance(QObject):
    """The owner of the notes and the render worker. Times are in s from the pluck or blow.

    A note is what sounds; a take is the rendered motion and signals of one pluck or blow, which the views show.
    The lead is the note whose time the playhead follows. A turn is one pass of a loop: a note of its own.
    Each turn is handed to the mixer shortly before the one that rings ends.
    """

    _reported = Signal(str, str)  # a notice and its details, from any thread
    _rendered = Signal(object, bool)  # from the worker's thread: a take, and whether all of it is; None: it failed

    def __init__(
        self, window: MainWindow, session: Session, library: Library, sound: Sound, panels: Sequence[Panel]
    ) -> None:
        super().__init__(window)
        self._window = window
        self._session = session
        self._library = library
        self._sound = sound
        self._panels = panels
        self._turn: tuple[Note, Note] | None = None  # the note that rings, the next turn; None: none handed over
        self._waiting_words = self._error_words = ""  # of the header: a model still buffers; the shown error
        self._reported.connect(window.notices.report)
        self._rendered.connect(self._take_rendered)
        self._sources = Sources()  # loaded presets: model and truth
        self.notes = Notes(sound, self._sources, library.find, self._reported.emit, sound.set_effects)
        self._worker = RenderWorker(
            self._hear_worker, self._sources.load, lambda: self.notes.ringing > 0, lambda: self.playable
        )

    @property
    def entry(self) -> PresetEntry | None:
        """The chosen preset."""
        return self._library.find(self._session.choices.preset)

    @property
    def take(self) -> Take | None:
        """The motion of a string that is shown; None while drums are played."""
        take = self._session.stage.take
        return take if isinstance(take, Take) else None

    @property
    def _plays_drums(self) -> bool:
        return self._session.choices.drums is not None

    @property
    def ready(self) -> bool:
        """Return True if the motion that is shown is that of the chosen pluck."""
        return self.take is not None and self._session.stage.ready

    @property
    def at_hand(self) -> bool:
        """Return True if the chosen pluck would sound at once: its sources are loaded, and the output is open."""
        return self._sound.status().changes_done > 0 and self.notes.at_hand

    @property
    def playable(self) -> bool:
        """Return True if a pluck and the instrument's key, if any, would sound at once; of drums a key alone."""
        if self._plays_drums:
            return self._sound.status().changes_done > 0 and self.notes.keys.player is not None
        return self.at_hand and (self._session.choices.instrument is None or self.notes.keys.player is not None)

    @property
    def playing(self) -> bool:
        """Return True if a note rings that was not released."""
        return self.notes.ringing > 0

    @property
    def position_s(self) -> float:
        """The playhead in s from the pluck or blow: the time in the motion that is heard now, or where it stands."""
        return self._session.stage.position_s(self._sound.mixer.output_latency_s)

    @property
    def moving(self) -> bool:
        """Return True if the playhead moves."""
        return self._session.stage.moving

    @property
    def settled(self) -> bool:
        """Return True if motion and signals are complete, so that views need not look for more."""
        take = self._session.stage.take
        return take is None or (take.complete and take.listened.complete)

    @property
    def match(self) -> Mapping[str, float] | None:
        """The factors by source that bring their levels to the truth's; None: not known yet.

        They are of the latest note where it is a key of the played instrument, else of the chosen pluck.
        """
        note = self._session.stage.note
        keys = isinstance(note, KeyNote) and self._session.choices.plays_instrument
        return note.match if note is not None and keys else self.notes.match

    def moment(self, elapsed_s: float) -> Moment:
        """The moment that panels show now; `elapsed_s`: since they were shown the last one."""
        stage = self._session.stage
        return Moment(stage.take, self.position_s, stage.moving, elapsed_s, stage.audible)

    def catch_up(self, panel: Panel) -> None:
        """Give a panel that was made late the take that is shown, and its end where all of it is rendered."""
        take = self._session.stage.take
        if take is None or (panel.of_strings and self._plays_drums):
            return
        panel.take_started(take)
        if isinstance(take, Take) and self._session.stage.complete:
            panel.take_finished(take)

    # Intents

    def stop(self) -> None:
        """Fade all sound out; the playhead stays."""
        self._forget_turn()
        self._session.send(Parked(self.position_s))
        self.notes.stop()

    def seek(self, position_s: float) -> None:
        """Move the playhead to a time in s, limited to the motion; while notes ring, one from there replaces them.

        Of drums the playhead alone moves.
        """
        if (take := self._session.stage.take) is None:
            return
        position_s = min(max(position_s, 0.0), take.seconds)
        self._forget_turn()
        self._session.send(Parked(position_s))
        if not self._plays_drums and self.playing and (note := self.notes.ring(position_s, alone=True)) is not None:
            self._take_turn(note)

    def stage_changed(self, names: frozenset[str]) -> None:
        """Follow changes of the session; `names`: the fields of `Choices` and `Stage` that have other values.

        Where another note than that of the loop leads, the turn that was handed over is dropped.
        """
        if not names.isdisjoint(OBSERVED):
            self.choices_changed(names)
        if "request" in names:
            self._ask()
        if "lead" in names and self._turn is not None and self._session.stage.lead not in (None, self._turn[0]):
            self._forget_turn()

    def choices_changed(self, names: frozenset[str]) -> None:
        """Apply changed fields of `Choices` to the notes; ask for another motion where another is to be shown.

        The request names that motion: of the latest blow while drums are played, else of the chosen pluck.
        """
        choices = self._session.choices
        if names & {"face", *Monitor.model_fields}:
            self.notes.set_monitor(choices, compared=choices.face == "lab")
        if names & {"instrument", "single"}:  # ends a comparison
            self.notes.set_instrument(choices.instrument, choices.ear, choices.single)
        elif "ear" in names:
            self.notes.listen(choices.ear)
        stage = self._session.stage
        request = stage.blow if choices.drums is not None else request_of(choices, self._library)
        if "loop" in names and not choices.loop:
            self._forget_turn()
        if request != stage.request:  # else an event may have chosen another pluck, which the session takes later
            self._session.send(Asked(request))

    def _ask(self) -> None:
        """Ask the worker for the motion that is to be shown; none is where no string or drum is chosen.

        What loops and seeks start from is the pluck of a string; a drum, or a key of an instrument, starts none.
        """
        request = self._session.stage.request
        plucked = request if request is not None and request.struck is None else None
        self.notes.choose(plucked)
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
        self.notes.set_instrument(choices.instrument, choices.ear, name)

    def hear_instrument(self, instrument: Instrument | None) -> None:
        """Let keys play this instrument until another is chosen; None: the chosen one. The choices stay."""
        choices = self._session.choices
        if instrument is not None:
            choices = choices.changed({"instrument": instrument})
        self.notes.set_instrument(choices.instrument, choices.ear, choices.single)

    def close(self) -> None:
        """End the threads; may be called again."""
        self.notes.stop()
        self._worker.close()
        self.notes.close()

    # Sixty times a second

    def tick(self) -> None:
        """Forget notes that ended, hand over the next turn of the loop, and update the header."""
        self.notes.poll()
        if self._session.choices.loop:
            self._hand_over_turn()
        waits = self._buffering_words()
        if waits != self._waiting_words:
            self._waiting_words = waits
            self._show_words()

    def _buffering_words(self) -> str:
        """The time until a model that is rendered ahead will sound, in words; "" where none waits."""
        latest = self._session.stage.note
        if not isinstance(latest, PluckVoices) or not latest.waits_s:
            return ""
        entry = self._library.find(name_text(path_of(latest.request.preset).stem))
        name = model_word(entry.info.model) if entry else "model"
        return f"{name}: buffering, starts in {latest.waits_s:.1f} s"

    def _hand_over_turn(self) -> None:
        """Hand the next turn of the loop to the mixer, ahead of time: it begins where the shown motion ends.

        Where one is handed over already, wait until it sounds and make it the shown note.
        """
        stage = self._session.stage
        # once another pluck is chosen, the note that rings is not the shown one, and its turn is the new pluck's
        note, take = stage.lead or stage.note, stage.take
        if self._turn is not None:
            turn = self._turn[1]
            if turn.began:  # it sounds, or it was cut with its mixer: the next call hands over another
                self._turn = None
                if not turn.cut:
                    self._take_turn(turn)
            return
        rings = note is not None and note.request is not None and note.began and not (note.cut or note.released)
        if note is not None and rings and take is not None:
            next_turn = self.notes.turn(note, take.seconds, stage.by_hand())
            self._turn = None if next_turn is None else (note, next_turn)

    def _take_turn(self, note: Note) -> None:
        """Make a note that the loop or a seek began the latest one, whose time the playhead follows."""
        self.notes.latest = note
        self._session.send(Turned(note))

    def _forget_turn(self) -> None:
        """Drop the turn that was handed over, if there is one; the note before it rings on."""
        if self._turn is not None:
            (note, turn), self._turn = self._turn, None
            turn.release(0.0)  # s: at once, so that it never begins
            if isinstance(turn, KeyNote):
                self.notes.keys.recorder.cancel(turn.event)
            note.release_at(0)  # no frame: it is not to fade where the turn would have begun

    def _hear_worker(self, signal_name: str, *values: Any) -> None:
        """Pass a message of the render worker to the window's thread; called in the worker's.

        Args:
            signal_name: "started" or "finished", with the take; "failed", with a message and its details;
                "other_refused", with another preset's name and why its model cannot be rendered.
        """
        if signal_name == "failed":
            self._rendered.emit(None, False)
            self._reported.emit(*values)
        elif signal_name == "other_refused":
            self._reported.emit(f"{values[0]} cannot be heard beside this preset: {values[1]}", "")
        else:
            self._rendered.emit(values[0], signal_name == "finished")

    # What has been rendered

    def _take_rendered(self, take: Take | BlowTake | None, complete: bool) -> None:
        """Take a motion from the worker: its first block, or `complete`, all of it; None: rendering failed."""
        if take is None:
            self._show_error("")
        elif complete:
            self._finish(take)
        elif self._is_of_chosen(take):  # else overtaken
            self._begin(take)

    def _begin(self, take: Take | BlowTake) -> None:
        """Show a take of which the first block is rendered: it grows while the panels draw it."""
        is_shown = take is self._session.stage.take
        self._session.send(Rendered(take))
        if not is_shown:
            for panel in self._panels:
                if not (panel.of_strings and self._plays_drums):
                    panel.take_started(take)
            self._show_error("Rendering …")

    def _finish(self, take: Take | BlowTake) -> None:
        """Show the errors of the shown take, all of which is rendered now; ignore another take.

        Of a drum the error is an RMSE relative to the truth, of a string a relative MAE.
        """
        if take is not self._session.stage.take or self._session.stage.complete:
            return
        self._session.send(Rendered(take, complete=True))
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
        self._show_error("Error of this pluck: " + ", ".join(parts), growth)

    # Helpers

    def _show_error(self, words: str, growth: str = "") -> None:
        """Show the error of the shown motion in the header; `growth`: as of `growth_words`, "" for no sign."""
        self._error_words = words
        self._show_words()
        self._window.show_growth(growth)

    def _show_words(self) -> None:
        """Show in the header how long a model is still waited for, or the error."""
        self._window.error_label.setText(self._waiting_words or self._error_words)

    def _is_of_chosen(self, take: Take | BlowTake) -> bool:
        """Return True if a take is of the pluck that is asked for, or of the latest blow; else it was overtaken."""
        request, entry = self._session.stage.request, self.entry
        if isinstance(take, BlowTake):
            return take.request.same_motion(request)
        if request is None or request.struck is not None or entry is None:
            return False
        string = string_of(request.preset) or entry.info.string
        chosen = entry.name, string, request.pluck, request.seconds
        return (take.preset_name, take.info.string, take.pluck, take.seconds) == chosen


def growth_words(errors: Sequence[float], validation_mae: float | None) -> str:
    """The sentence that reports how far the model's error on this pluck has grown; "" where it has not grown.

    It has grown if the largest error is at least NOTICEABLE (1 %) and at least GROWN times `validation_mae`.

    Args:
        errors: relative mean absolute errors (1: 100 %): within the time of training, then past its end. It may lack
            the second, or both; NaN counts as none.
        validation_mae: the preset's relative mean absolute error on validation data; None: not known.
    """
    largest = max((error for error in errors if not math.isnan(error)), default=0.0)
    if largest < max(NOTICEABLE, GROWN * (validation_mae or 0.0)):
        return ""
    where = "on this pluck" if errors and errors[0] == largest else "past the end of its training"
    return f"The model's error grows to {percent(largest)} {where}. The Lab shows it (F9)."
