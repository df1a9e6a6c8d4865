"""The controller, which connects everything: session, performance, sound, panels and window.

    widgets ── intents ──► session ── changed ──► controller ──► performance, sound, panels, widgets

    a timer ── 60 times a second, 10 when all is still ──► the panels that can be seen, meter

Everything here runs in the window's thread.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Qt, QTimer
from PySide6.QtGui import QGuiApplication

from app.analysis.abx.record import material_of
from app.audio.sound import Sound
from app.export.compared import ComparedModels
from app.export.sound import compared_sounds
from app.playing.key_note import KeyNote
from app.presets.library import Library
from app.presets.words import why_no_middle
from app.session.choices import OBSERVED
from app.session.slots import missing_presets, sound_of, through_words
from app.session.trained import brought_pluck
from app.shared.log import log_file
from app.shared.vocabulary import Face
from app.stage.session import Session
from app.views.controls.app_menu import ENTRIES
from app.views.controls.knob import Knob
from app.views.controls.slot_buttons import SLOTS
from app.views.dialogs.abx_dialog import AbxDialog
from app.views.dialogs.help_dialog import ABOUT, HelpDialog
from app.views.dialogs.learn_dialog import LearnDialog
from app.views.stage import StageView
from app.window.about import about_text
from app.window.audio_control import AudioControl, MakeSound
from app.window.browsing import PresetDesk
from app.window.drag_out import DragOut
from app.window.dropped_files import Dropped, receive, receive_body
from app.window.exports import Exports
from app.window.figures import Figures
from app.window.inputs import Inputs
from app.window.instrument_desk import TAKEN_FILES, InstrumentDesk
from app.window.leaving import Leaving
from app.window.main_window import PLAYED_KEYS, MainWindow
from app.window.panels import Location, Panel, StringPanel
from app.window.panels.drum import DrumPanel
from app.window.performance import Performance
from app.window.remembering import SettingsSaver
from app.window.settings import InstrumentChoice, Settings
from engine.presets import SHIPPED, PresetError

if TYPE_CHECKING:
    from app.player.learned import Kept

LOOK_MS = 8  # between two pictures of TURNS: each painting is short, as keys that are played wait for it
IDLE_LOOK_MS = 50  # while nothing moves
TURNS: tuple[Location, ...] = ("stage", "left", "stage", "right")  # the panels that a tick shows, in turn
KEYS_EVERY_S, FACTS_EVERY_S, JUDGED_EVERY_S = 0.04, 0.1, 0.15  # sounding keys; output's state; training's words
LIVELY_S = 1.0  # at the full rate after the last movement
METER_FALL_DB_PER_S = 20.0
METER_FLOOR_DB = -120.0
DRUMS_PLAYED = (
    "This view shows a string, and drums are played.\nWaveform, spectrum, spectrogram and error over time show them."
)


@dataclass
class Duty:
    """A task of the window's timer, done from time to time."""

    every_s: float
    do: Callable[[], object]
    due_s: float = 0.0  # when it is next done, as of `time.monotonic`


class Controller(QObject):
    """A controller that lives as long as the window.

    The stage is the picture of string or drum; below it are the decks, left and right, with the views of the Lab.
    """

    def __init__(
        self, window: MainWindow, settings: Settings, settings_path: Path, make_sound: MakeSound = Sound
    ) -> None:
        super().__init__(window)
        self.window = window
        self.library = Library([])
        self.session = Session(
            settings.choices,
            held=lambda: bool(QGuiApplication.mouseButtons()),
            brought=lambda choices, preset: brought_pluck(choices, self.library, preset),
        )
        self._settings = settings
        self._settings_path = settings_path
        self.audio = AudioControl(window, make_sound, settings.device, settings.sound)
        self.sound = self.audio.output
        window.closing.connect(self.sound.close)  # in case the rest of this fails
        self.audio.open()  # it is opened while all else is made
        window.show_look(settings.look)
        window.places.choices = settings.files
        self._timer = QTimer(self, interval=LOOK_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        self._lively_until_s = 0.0  # then the timer is slower, as of `time.monotonic`
        self._ticks = 0  # of the timer so far
        self._shown_s = dict.fromkeys(TURNS, time.monotonic())  # when each place was last shown
        self._peak_db = METER_FLOOR_DB  # that the meter shows
        self._abx: AbxDialog | None = None  # while it is open, nothing else plays
        self._help: HelpDialog | None = None  # made when it is first opened
        self._learning: LearnDialog | None = None  # asks what a dropped sound is; None: not open
        problems = self.library.refresh()
        self.presets = PresetDesk(window, self.session, self.library, settings.favourites)
        self.string, self.drum = StringPanel(self.session, self.library), DrumPanel(self.session, self.library)
        window.show_stage(self.string, self.drum)
        self.string.view.setFocus()
        self.panels: list[Panel] = [self.string, self.drum]  # and those of the decks from the Lab on
        self.performance = Performance(window, self.session, self.library, self.sound, self.panels)
        window.order_tabs()
        if self.performance.entry is None and (first := self.library.first()):
            self.session.play(preset=first.name)
        for slot, name in missing_presets(self.session.choices, self.library).items():
            self.session.play(**{slot: "model" if slot == "a" else "truth"})
            problems.append(f"The preset {name}, which slot {slot.upper()} held, was not found.")
        self._connect_undo()
        self.inputs = Inputs(window, self.session, self.library, settings.midi, self.performance)
        self.inputs.begun.connect(self._wake)
        self.inputs.midi.start()
        self.instruments = InstrumentDesk(
            window, self.session, self.library, self.performance, self.inputs, settings.instrument_favourites
        )
        window.instrument.bar.takes.choose(dict(settings.record))
        window.show_keys(settings.instrument.shown)
        window.instrument.show_surface(settings.instrument.surface)
        window.instrument.set_unfolded(settings.instrument.unfolded)
        self.exports = Exports(
            window,
            self.session,
            self.library,
            self.instruments.recordings,
            (settings.export, settings.sampled),
        )
        self.drag_out = DragOut(window, self.exports, self.instruments.recordings)
        self.figures = Figures(window, self.session, self.library)
        self.leaving = Leaving(window, self.instruments.recordings, self.exports)
        window.transport.export_asked.connect(window.action["export"].trigger)
        self._connect()
        self._connect_actions()
        self.keeper = SettingsSaver(settings_path, settings, self.settings, self)
        self.keeper.failed.connect(window.notices.report)
        for problem in problems:
            self.window.notices.report(problem)
        self.session.changed.connect(self.performance.stage_changed)  # sound before all that is shown
        self.session.changed.connect(self._stage_changed)
        self.performance.stage_changed(frozenset(OBSERVED))
        self._stage_changed(frozenset(OBSERVED))
        self._duties = [
            Duty(KEYS_EVERY_S, self.instruments.tick),
            Duty(FACTS_EVERY_S, self._show_facts),
            Duty(JUDGED_EVERY_S, self.instruments.judge),
            Duty(1.0, self.inputs.midi.look),
            Duty(1.0, self.keeper.look),
        ]
        self._timer.start()
        window.closing.disconnect(self.sound.close)
        window.closing.connect(self.close)

    # Connections

    def _connect(self) -> None:
        window = self.window
        for panel in self.panels:
            self._connect_panel(panel)
        self.presets.browser.played.connect(lambda name: self.pluck())
        window.file_dropped.connect(self.take_file)
        window.transport.slots.set_entries(self.library.entries)
        self.library.changed.connect(lambda: window.transport.slots.set_entries(self.library.entries))
        window.transport.change_asked.connect(self._change)
        window.transport.play_asked.connect(self.play_or_stop)
        window.pluck_asked.connect(self.pluck)
        window.transport.trained_asked.connect(self.pluck_as_trained)
        window.face_asked.connect(self.show_face)

    def _connect_panel(self, panel: Panel) -> None:
        panel.seek_asked.connect(self.performance.seek)
        panel.pluck_asked.connect(self.pluck)
        panel.strike_asked.connect(self.inputs.strike)
        panel.export_asked.connect(self._export_models)
        panel.reported.connect(self.window.notices.report)
        if panel.figure is not None:
            self.figures.add(panel)

    def _fill_decks(self) -> None:
        """Make the views of the Lab when they are first needed. They and their plots take a fifth of a second."""
        if any(panel.location != "stage" for panel in self.panels):
            return
        from app.window.panels.rack import decks

        for panel in decks(self.window, self.session, self.library):
            self.panels.append(panel)
            self._connect_panel(panel)
            panel.choices_changed(frozenset(OBSERVED))
            self.performance.catch_up(panel)
        self._show_kind()
        self.window.order_tabs()

    def show_face(self, face: Face) -> None:
        """Play returns to the instrument, which a preset of the Lab may have replaced."""
        self.session.update(face=face)
        if face == "play":
            self.session.play_instrument()

    def _connect_actions(self) -> None:
        """Connect the actions of the menu and its shortcuts; the window itself does the rest."""
        window = self.window
        session = self.session
        does: dict[str, Callable[[], object]] = {
            "record": self.instruments.recordings.record,
            "takes": window.instrument.bar.popup_takes,
            "export": lambda: self.exports.open("note"),
            "sampler": lambda: self.exports.open("sampler"),
            "plugin": lambda: self.exports.open("plugin"),
            "models": self._compare_models,
            "undo": lambda: self._step(session.undo, session.undo_words, "Undone", "Nothing to undo"),
            "redo": lambda: self._step(session.redo, session.redo_words, "Redone", "Nothing to redo"),
            "save": self.instruments.save,
            "copy": lambda: self.drag_out.ask("note", "copy"),
            "save_as": self.instruments.save_as,
            "revert": self.instruments.revert,
            "compare": window.instrument.bar.compare.click,
            "play": self.play_or_stop,
            "trained": self.pluck_as_trained,
            **{field: partial(self._toggle, field) for field in ("loop", "motion", "envelope")},
            "instruments": self.instruments.toggle,
            "browse": self.presets.toggle,
            "previous": lambda: self.presets.step(-1),
            "next": lambda: self.presets.step(1),
            "switch": session.switch_source,
            "difference": self._hear_difference,
            "all_modes": self._play_all_modes,
            "abx": self.listening_test,
            "audio": self.audio.show_dialog,
            "midi": lambda: self.inputs.midi.show_dialog(window),
            "help": self.show_help,
            "about": lambda: self.show_help(ABOUT),
        }
        for name, do in does.items():
            window.action[name].triggered.connect(lambda _=False, do=do: do())

    def _connect_undo(self) -> None:
        """Show undo's steps in the menu, and make each drag of a knob or in a picture one step."""
        window, session = self.window, self.session
        window.menu.aboutToShow.connect(lambda: window.menu.show_steps(session.undo_words, session.redo_words))
        draggable: tuple[StageView | Knob, ...] = (self.string.view, self.drum.view, *window.findChildren(Knob))
        for dragged in draggable:
            dragged.drag_started.connect(session.hold)
            dragged.drag_ended.connect(session.release)

    def _change(self, field: str, value: object) -> None:
        """Give a field of `Choices` a control's value; where that is out of bounds, set the control back."""
        try:
            self.session.update(**{field: value})
        except ValueError as error:
            self._choices_shown(frozenset({field}))
            if not isinstance(value, float):  # else a knob at its end, which asks for slightly more than the bound
                self.window.notices.report(str(error))

    # Intents

    def _toggle(self, field: str) -> None:
        self.session.update(**{field: not getattr(self.session.choices, field)})

    def _play_all_modes(self) -> None:
        """Play all modes; while the dialog of exports shows a result, close it."""
        if not self.exports.dismiss():
            self.session.update(solo=0)

    def _hear_difference(self) -> None:
        """Hear the difference, or again what was before it. Keys struck in Play have no voice of the truth."""
        if self.session.choices.face == "lab" or self.session.choices.difference:
            self._toggle("difference")
        else:
            self.window.say_briefly("The difference is heard in the Lab (F9)")

    def _step(self, take: Callable[[], None], words: str, done: str, nothing: str) -> None:
        """Take a step of undo or redo, and say which; `words`: those of the step."""
        take()
        self.window.say_briefly(f"{done}: {words}" if words else nothing)

    def pluck(self) -> None:
        """Pluck the string as chosen, or strike the drum that is shown."""
        if self._abx is not None:
            return
        if self.session.choices.drums is None:
            self.inputs.pluck()
        else:
            self.inputs.strike(*self.drum.place, self.session.choices.velocity)

    def pluck_as_trained(self) -> None:
        """Choose the pluck in the middle of what the preset was trained on, and pluck."""
        entry = self.performance.entry
        if entry is not None and entry.info.middle_pluck is not None:
            self.session.update(pluck=entry.info.middle_pluck)
            self.pluck()

    def _show_trained(self) -> None:
        """Let the string be plucked as trained, or say why it cannot be."""
        entry = self.performance.entry
        drums = self.session.choices.drums is not None
        why = "No string is played" if entry is None or drums else why_no_middle(entry.info)
        self.window.show_trained(why)

    def _compare_models(self) -> None:
        """Show the table of all models on this pluck, with the keyboard in it."""
        self.show_face("lab")
        self.session.update(right_view="compare")
        next(panel for panel in self.panels if panel.key == "compare").setFocus()

    def _export_models(self, models: ComparedModels) -> None:
        self.exports.models = models
        self.exports.open("models")

    def play_or_stop(self) -> None:
        """Stop all that sounds; where nothing does, pluck. Do nothing while the listening test is open."""
        if self._abx is None:
            was_playing = self.instruments.playing
            self.instruments.stop()
            if self.performance.playing:
                self.performance.stop()
            elif not was_playing:  # in a rest of a file nothing rings
                self.pluck()
            self.window.transport.show_playing(self.performance.playing)

    def listening_test(self) -> None:
        """Open the ABX test of what an export would write; until it is closed nothing else plays."""
        entry = self.performance.entry
        choices = self.session.choices
        if entry is None:
            self.window.notices.report("The listening test needs a preset that can be plucked: choose one first.")
            return
        sound = sound_of(choices, entry.path, self.session.stage.struck)
        try:
            material = material_of(sound, sound.words(entry.title), choices.volume_db)
        except PresetError as error:
            self.window.notices.report(str(error))
            return
        self.performance.stop()
        render = partial(self.performance.notes.compute, partial(compared_sounds, sound))
        self.performance.notes.set_blind_test(True)
        self._abx = AbxDialog(self.sound, material, self._settings.abx, render, self.window.places, self.window)
        self._abx.finished.connect(self._listening_test_ended)
        self._abx.open()

    def _listening_test_ended(self) -> None:
        """Let the app sound as before the listening test, and keep the test's choices for the settings."""
        dialog, self._abx = self._abx, None
        self.performance.notes.set_blind_test(False)
        self.sound.set_volume_db(self.session.choices.volume_db)
        assert dialog is not None
        self._settings = self._settings.model_copy(update={"abx": dialog.choices()})
        dialog.deleteLater()

    def show_help(self, topic: str = "") -> None:
        """Open the help at the tab of a title; "": the one that was shown last."""
        if self._help is None:
            self._fill_decks()
            views = [(panel.title, panel.help) for panel in self.panels if panel.help]
            keys = [*PLAYED_KEYS, *((entry.key_name, entry.does) for entry in ENTRIES.values() if entry.key)]
            about = about_text(self._settings_path, SHIPPED)
            self._help = HelpDialog(keys, views, log_file(), about, self.window)
        self._help.open_at(topic)
        self._help.raise_()

    def take_file(self, file: Path) -> None:
        """Take a dropped file: install and choose a preset, restore an export's recipe; ask what other sounds are.

        Instruments, scales and MIDI files go to `instruments`.
        """
        self.window.places.opened(file)
        if file.suffix.lower() in TAKEN_FILES:
            self.instruments.take_file(file)
            return
        dropped = receive(file, self.library)
        if dropped.sound:
            self._ask_what_it_is(file)
        self._take(file, dropped)

    def _take(self, file: Path, dropped: Dropped) -> None:
        """Apply what a dropped file brings: new choices, a body for the instrument, a notice."""
        notice = dropped.notice
        try:
            self.session.update(**dropped.choices)
        except ValueError as error:  # a recipe that was edited, or of another version
            notice = f"{file}: its choices cannot be restored here ({error})."
        if dropped.body:
            self.instruments.take_body(dropped.body)
        if notice:
            self.window.notices.report(notice)

    def _ask_what_it_is(self, file: Path) -> None:
        """Open the dialog that asks whether a sound is a string or a body, in place of one that is open.

        Where that one may not be closed now, a notice asks to open the file again later.
        """
        if self._learning is not None:
            if not self._learning.may_close():
                self.window.notices.report(f"{file.name}: open it again once the other recording is done with.")
                return
            self._learning.done(0)
        self.performance.stop()
        dialog = self._learning = LearnDialog(file, self.sound, self.window)
        dialog.body_chosen.connect(lambda: self._take(file, receive_body(file)))
        dialog.instrument_kept.connect(self._play_learned)
        dialog.finished.connect(self._learning_ended)
        dialog.open()

    def _learning_ended(self) -> None:
        dialog, self._learning = self._learning, None
        if dialog is not None:
            dialog.deleteLater()

    def _play_learned(self, kept: Kept) -> None:
        """Choose an instrument that was just learned."""
        self.library.refresh()
        self.instruments.reload()
        file = kept.instrument
        self.instruments.take_file(file)
        self.window.notices.inform(f"{file.stem}: learned. Its report: {kept.report}", file=file)

    def close(self) -> None:
        """Save the settings and end every thread."""
        if self._abx is not None:
            self._abx.abandon()
        if self._learning is not None:
            self._learning.done(0)
        self._timer.stop()
        self.keeper.close()
        self.exports.close()
        self.drag_out.close()
        self.instruments.close()
        self.inputs.close()
        for panel in self.panels:
            panel.end()
        self.performance.close()
        self.sound.close()

    def settings(self) -> Settings:
        """The present settings, to be saved."""
        return self._settings.model_copy(
            update={
                "choices": self.session.choices,
                "export": self.exports.choices[0],
                "sampled": self.exports.choices[1],
                "files": self.window.places.choices,
                "record": self.window.instrument.bar.takes.meter,
                "device": self.audio.device,
                "sound": self.audio.sound,
                "look": self.window.look,
                "midi": self.inputs.midi.choices,
                "favourites": tuple(sorted(self.presets.favourites)),
                "instrument_favourites": tuple(sorted(self.instruments.favourites)),
                "instrument": InstrumentChoice(
                    shown=self.window.shows_keys,
                    surface=self.window.instrument.surface,
                    unfolded=self.window.instrument.unfolded,
                ),
                "window_geometry": self.window.geometry_text(),
            }
        )

    # Session → everything

    def _stage_changed(self, names: frozenset[str]) -> None:
        """Show what has changed in the session; `names`: fields of `Choices` and of `Stage`."""
        if not names.isdisjoint(OBSERVED):
            self.inputs.choices_changed(names)
            self._choices_shown(names)
        if names & {"note", "known"} and self.session.stage.known:
            self._show_struck()
            self.exports.refresh()

    def _choices_shown(self, names: frozenset[str]) -> None:
        """Show the choices in window, panels, desks and exports; `names`: the fields that have other values."""
        choices, window = self.session.choices, self.window
        window.transport.show_choices(choices)
        if "preset" in names:
            self.presets.choice_changed()
        if "face" in names:
            if choices.face == "lab":
                self._fill_decks()
            window.show_face(choices.face)
        window.left.show_key(choices.left_view)
        window.right.show_key(choices.right_view)
        for panel in self.panels:
            panel.choices_changed(names)
        if names & {"instrument", "single"}:
            self._show_kind()
            self._show_trained()
        window.show_solo(choices.solo)
        window.show_through(*through_words(choices))
        self.instruments.choices_changed(names)
        self.exports.choices_changed(names)
        if "volume_db" in names and self._abx is None:  # a blind test keeps the one that it began with
            self.sound.set_volume_db(choices.volume_db)
        self._wake()

    def _show_kind(self) -> None:
        """Show the string or the drum; views of a string say that they do not show drums."""
        drums = self.session.choices.drums
        if (key := self.session.stage.drum_key) is not None:
            self.drum.show_key(key)
        stage_panel = self.string if drums is None else self.drum
        self.window.show_on_stage(stage_panel, stage_panel.view)
        for panel in self.panels:
            if panel.of_strings:
                panel.cover("" if drums is None else DRUMS_PLAYED)

    def _show_struck(self) -> None:
        """Show the drum that was struck last, and where."""
        latest, drums = self.session.stage.note, self.session.choices.drums
        if drums is None or not isinstance(latest, KeyNote) or not latest.of_drum:
            return
        if (drum := drums.of_key(latest.event.key)) is not None:
            self.drum.show_key(latest.event.key, latest.event.place or drum.place)

    def _wake(self) -> None:
        """Run the timer at its full rate for LIVELY_S, as something may move."""
        self._lively_until_s = time.monotonic() + LIVELY_S
        self._set_pace(LOOK_MS)

    def _set_pace(self, interval_ms: int) -> None:
        if self._timer.interval() != interval_ms:
            self._timer.setInterval(interval_ms)

    # A hundred and twenty times a second

    def _tick(self) -> None:
        """Show the panels of the next place of TURNS: the string and, between two of its frames, a deck."""
        now_s = time.monotonic()
        location = TURNS[self._ticks % len(TURNS)]
        self._ticks += 1
        elapsed_s, self._shown_s[location] = now_s - self._shown_s[location], now_s
        self.inputs.look()
        if location == "stage":
            self._follow_sound(now_s, elapsed_s)
        moment = self.performance.moment(elapsed_s)
        for panel in self.panels:
            if panel.location == location and panel.isVisible():
                panel.show_moment(moment)

    def _follow_sound(self, now_s: float, elapsed_s: float) -> None:
        """Show what sounds, sixty times a second, and ten times as long as nothing moves."""
        performance, transport = self.performance, self.window.transport
        performance.tick()
        transport.show_playing(performance.playing)
        self._show_level(elapsed_s)
        for duty in self._duties:
            if now_s >= duty.due_s:
                duty.due_s = now_s + duty.every_s
                duty.do()
        is_still = performance.settled and not (performance.playing or performance.moving)
        if not is_still or self._peak_db > METER_FLOOR_DB:
            self._lively_until_s = now_s + LIVELY_S
        self._set_pace(LOOK_MS if now_s < self._lively_until_s else IDLE_LOOK_MS)

    def _show_facts(self) -> None:
        """Show the gains and the state of the audio output."""
        choices, performance = self.session.choices, self.performance
        gains_db = {slot: choices.gain_db(slot, performance.match) for slot in SLOTS}
        self.window.transport.slots.show_gains(gains_db)
        self.audio.show(self.sound.status(), performance.notes, performance.take)

    def _show_level(self, elapsed_s: float) -> None:
        """Show the peak of the output in dBFS, which falls slowly; nothing in a listening test."""
        mixer = self.sound.mixer
        peak, reduction_db = mixer.take_peak(), mixer.take_reduction_db()
        fallen_db = self._peak_db - METER_FALL_DB_PER_S * elapsed_s
        self._peak_db = max(20 * math.log10(peak) if peak > 0 else METER_FLOOR_DB, fallen_db, METER_FLOOR_DB)
        hidden = self._abx is not None  # the level would give X away
        self.window.transport.meter.show_level(
            -math.inf if hidden else self._peak_db, reduction_db > 0.01 and not hidden
        )
