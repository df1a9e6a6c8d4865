"""Where everything is connected: session, performance, player, panels and window.

    widgets ── intents ──► session ── changed ──► controller ──► performance, player, panels, widgets
    a timer ── 60 times a second ──► the panels that can be seen, meter

Everything here runs in the window's thread.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QTimer, Signal

from app.about import about_text
from app.abx.subject import subject_of
from app.appearance import Appearance
from app.audio import AudioProblem, Player
from app.audio_control import AudioControl
from app.dropping import receive
from app.history import History
from app.instruments import Instruments
from app.library import Library, PresetEntry
from app.main_window import KEYS, PLAYED_KEYS, MainWindow
from app.panels import Moment, StringPanel
from app.panels.rack import fill
from app.performance import Performance
from app.preset_desk import PresetDesk
from app.session import Session
from app.settings import Settings, save_settings
from app.slots import gain_db, levels, missing_presets
from app.views.about_dialog import AboutDialog
from app.views.abx_dialog import AbxDialog
from app.views.export_dialog import ExportDialog
from app.views.help_dialog import HelpDialog
from app.views.knob import Knob
from app.views.preset_browser import PresetBrowser
from app.views.slot_buttons import SLOTS
from app.views.string_view import StringView
from engine.preset import SHIPPED

FRAME_MS = 16
STARTING_TICKS = 9  # at most so many pictures are left out at a time for a pluck that begins,
GIVE_WAY_TICKS = 3  # and for one whose rendering is hardly ahead
COMFORTABLE_S = 0.3  # ahead of what is heard
ProblemListener = Callable[[AudioProblem], None]


class _AudioMail(QObject):
    """Carries a fault of the sound device from the feeder's thread into the window's (Qt queues the signal)."""

    told = Signal(object)


class Controller(QObject):
    """Lives as long as the window."""

    def __init__(
        self,
        window: MainWindow,
        settings: Settings,
        settings_path: Path,
        make_player: Callable[[ProblemListener], Player] = Player,
    ) -> None:
        super().__init__(window)
        self.window = window
        self.session = Session(settings.choices)
        self._settings = settings
        self._settings_path = settings_path
        self._audio_mail = _AudioMail()
        self.player = make_player(self._audio_mail.told.emit)
        self.audio = AudioControl(window, self.player, settings.device, settings.sound)
        self.appearance = Appearance(window, settings.look)
        self._last_tick_s = time.monotonic()
        self._ticks_given = 0
        self._pictures_held = False
        self._abx: AbxDialog | None = None  # while it is open, the player is its own
        self._help: HelpDialog | None = None
        self.library = Library([])
        problems = self.library.refresh()
        self.presets = PresetDesk(
            self.session, self.library, window.presets, PresetBrowser(window), settings.favourites
        )
        self.panels = fill(window, self.session, self.library)
        self.performance = Performance(window, self.session, self.library, self.player, self.panels)
        window.order_tabs()
        self._connect()
        if self.entry is None and (first := self.library.first()):
            self.session.update(preset=first.name)
        for slot, name in missing_presets(self.session.choices, self.library).items():
            self.session.update(**{slot: "model" if slot == "a" else "truth"})
            problems.append(f"The preset {name}, which slot {slot.upper()} held, was not found.")
        self.history = History(self.session)
        self._connect_history()
        self.instruments = Instruments(window, self.session, self.library, settings.midi)
        self.instruments.plucked.connect(self.pluck)
        self.instruments.told.connect(window.notices.tell)
        self.instruments.start()
        for problem in problems:
            self.window.notices.tell(problem)
        self._choices_shown(frozenset(type(self.session.choices).model_fields))
        self.audio.open()
        self.performance.render()
        self._timer = QTimer(self, interval=FRAME_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        self._timer.start()

    # Connections

    def _connect(self) -> None:
        window, session = self.window, self.session
        session.changed.connect(self._choices_changed)
        for panel in self.panels:
            panel.seek_asked.connect(self.player.seek)
            panel.pluck_asked.connect(self.pluck)
            panel.told.connect(window.notices.tell)
        self.presets.pluck_asked.connect(self.pluck)
        self.presets.told.connect(window.notices.tell)
        window.previous_asked.connect(lambda: self.presets.step(-1))
        window.next_asked.connect(lambda: self.presets.step(1))
        window.browse_asked.connect(self.presets.toggle)
        window.file_dropped.connect(lambda path: self.take_file(Path(path)))
        window.transport.slots.set_entries(self.library.entries)
        self.library.changed.connect(lambda: window.transport.slots.set_entries(self.library.entries))
        window.transport.change_asked.connect(self._change)
        window.transport.play_asked.connect(self.play_or_stop)
        window.transport.export_asked.connect(self.export)
        window.export_asked.connect(self.export)
        window.abx_asked.connect(self.listening_test)
        window.play_asked.connect(self.play_or_stop)
        window.pluck_asked.connect(self.pluck)
        window.switch_asked.connect(session.switch_source)
        window.loop_asked.connect(lambda: session.update(loop=not session.choices.loop))
        window.help_asked.connect(self.show_help)
        window.about_asked.connect(lambda: AboutDialog(about_text(self._settings_path, SHIPPED), window).open())
        window.all_modes_asked.connect(lambda: session.update(solo=0))
        window.closing.connect(self.close)
        self._audio_mail.told.connect(self.audio.tell)

    def _connect_history(self) -> None:
        window, session, history = self.window, self.session, self.history
        window.undo_asked.connect(history.undo)
        window.redo_asked.connect(history.redo)
        window.motion_asked.connect(lambda: session.update(motion=not session.choices.motion))
        window.envelope_asked.connect(lambda: session.update(envelope=not session.choices.envelope))
        strings = (panel.view for panel in self.panels if isinstance(panel, StringPanel))
        draggable: list[StringView | Knob] = [*strings, *window.transport.knobs.values()]
        for dragged in draggable:
            dragged.drag_started.connect(history.hold)
            dragged.drag_ended.connect(history.let_go)

    def _change(self, field: str, value: object) -> None:
        try:
            self.session.update(**{field: value})
        except ValueError:  # a knob at its end asks for a hair more
            self._choices_shown(frozenset({field}))

    # Intents

    def pluck(self) -> None:
        self.performance.pluck()
        self._hold_pictures(bool(self.performance.strikes.awaited))

    def play_or_stop(self) -> None:
        self.performance.play_or_stop()
        self.window.transport.show_playing(self.player.status().playing)

    def export(self) -> None:
        choices = self.session.choices
        if self.entry is None:
            self.window.notices.tell("There is no preset to export: choose one first.")
            return
        dialog = ExportDialog(
            self.library.entries,
            choices,
            self._settings.export,
            self.window,
            listen_right=choices.listen_right if choices.stereo else None,
            pickup=choices.pickup,
        )
        dialog.exec()
        self._settings = self._settings.model_copy(update={"export": dialog.export_choices()})

    def listening_test(self) -> None:
        """Opens the ABX test on what is on stage; until it is closed, the player belongs to it."""
        entry, stage = self.entry, self.performance
        if entry is None or stage.track is None or not stage.ready:
            self.window.notices.tell("The listening test needs a sound: wait until the pluck is rendered.")
            return
        try:
            subject = subject_of(entry, self.session.choices)
        except OSError as error:
            self.window.notices.tell(f"{entry.path} cannot be read ({error.strerror}).")
            return
        self._abx = AbxDialog(self.player, subject, self._settings.abx, self.window)
        self._abx.finished.connect(self._listening_test_ended)
        stage.lend_player(self._abx.set_track)
        self._abx.open()

    def _listening_test_ended(self) -> None:
        dialog, self._abx = self._abx, None
        assert dialog is not None
        self._settings = self._settings.model_copy(update={"abx": dialog.choices()})
        dialog.deleteLater()
        self.performance.take_player_back()

    def show_help(self) -> None:
        if self._help is None:
            views = [(panel.title, panel.help) for panel in self.panels if panel.help]
            self._help = HelpDialog([*PLAYED_KEYS, *((key, what) for key, _, what in KEYS)], views, self.window)
        self._help.show()
        self._help.raise_()

    def take_file(self, file: Path) -> None:
        """A dropped preset is taken in and chosen; a dropped WAV's recipe is restored."""
        dropped = receive(file, self.library)
        notice = dropped.notice
        try:
            self.session.update(**dropped.choices)
        except ValueError as error:  # a recipe that was edited, or of another version
            notice = f"{file}: its choices cannot be restored here ({error})."
        if notice:
            self.window.notices.tell(notice)

    @property
    def entry(self) -> PresetEntry | None:
        """The chosen preset."""
        return self.performance.entry

    def close(self) -> None:
        """Saves the choices and ends every thread."""
        if self._abx is not None:
            self._abx.abandon()
        self._timer.stop()
        self._settings = self._settings.model_copy(
            update={
                "choices": self.session.choices,
                "device": self.audio.device,
                "sound": self.audio.sound,
                "look": self.appearance.look,
                "midi": self.instruments.midi.choices,
                "favourites": tuple(sorted(self.presets.favourites)),
                "window_geometry": self.window.geometry_text(),
            }
        )
        try:
            save_settings(self._settings_path, self._settings)
        except OSError as error:
            self.window.notices.tell(f"The settings {self._settings_path} cannot be written ({error.strerror}).")
        self.instruments.close()
        for panel in self.panels:
            panel.close()
        self.performance.close()
        self.player.close()

    # Session → everything

    def _choices_changed(self, names: frozenset[str]) -> None:
        self.performance.choices_changed()  # first of all: a pluck may be waiting for it
        self._choices_shown(names)

    def _choices_shown(self, names: frozenset[str]) -> None:
        choices, window = self.session.choices, self.window
        window.transport.show_choices(choices)
        if "preset" in names:
            self.presets.choice_changed()
        window.left.show_key(choices.left_view)
        window.right.show_key(choices.right_view)
        for panel in self.panels:
            panel.choices_changed(names)
        window.show_solo(choices.solo)
        if names & {"a", "b", "heard"}:
            self.performance.select()
        if names & {"level_match", "difference_gain_db"}:
            self.player.set_levels(levels(choices))
        if "loop" in names:
            self.player.set_loop(choices.loop)
        if "volume_db" in names:
            self.player.set_volume_db(choices.volume_db)

    def _hold_pictures(self, on: bool) -> None:
        """Nothing is painted while a struck pluck's first block is rendered: both need the interpreter."""
        if on != self._pictures_held:
            self._pictures_held = on
            for panel in self.panels:
                panel.view.setUpdatesEnabled(not on)

    # Sixty times a second

    def _tick(self) -> None:
        status = self.player.status()
        starting, hurried = self.performance.starting, self.performance.hurried(status, COMFORTABLE_S)
        if self._ticks_given < (STARTING_TICKS if starting else GIVE_WAY_TICKS if hurried else 0):
            self._ticks_given += 1
            return  # whoever renders it needs the interpreter more
        self._ticks_given = 0
        self._hold_pictures(False)
        now_s = time.monotonic()
        elapsed_s, self._last_tick_s = now_s - self._last_tick_s, now_s
        window = self.window
        window.transport.show_playing(status.playing)
        hidden = self._abx is not None  # a level would give away what is heard
        window.transport.meter.show_level(-math.inf if hidden else status.peak_db, status.limiting and not hidden)
        self.performance.rate_shown(status.rate_hz)
        self.performance.watch(status)
        choices, take, track = self.session.choices, self.performance.take, self.performance.track
        window.transport.slots.show_gains({s: gain_db(choices, track, getattr(choices, s)) for s in SLOTS})
        self.audio.show(status, take)
        position_s = min(status.position_s, take.seconds) if take is not None else 0.0
        moment = Moment(take, position_s, status.playing, elapsed_s)
        for panel in self.panels:
            if panel.view.isVisible():
                panel.show_moment(moment)
