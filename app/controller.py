"""Where everything is connected: session, render worker, player, panels and window.

    widgets ── intents ──► session ── changed ──► controller ──► worker, player, panels, widgets
    worker, player ── (their threads) ── signals of `_Mail`, queued ──► controller
    a timer ── 60 times a second ──► the panels that can be seen, meter

Everything here runs in the window's thread.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QTimer, Signal

from app.about import about_text
from app.abx.subject import subject_of
from app.appearance import Appearance
from app.audio import AudioProblem, Player, Track
from app.audio_control import AudioControl
from app.dropping import receive
from app.history import History
from app.instruments import Instruments
from app.library import Library, PresetEntry
from app.main_window import KEYS, PLAYED_KEYS, MainWindow
from app.panels import (
    ComparePanel,
    EigenvaluesPanel,
    ErrorPlanePanel,
    ErrorTimePanel,
    Moment,
    Panel,
    PartialsPanel,
    SpaceTimePanel,
    SpectrogramPanel,
    SpectrumPanel,
    StringPanel,
    WaveformPanel,
)
from app.preset_desk import PresetDesk
from app.preset_words import percent
from app.rendering import RenderRequest, RenderWorker, Take
from app.session import Session
from app.settings import Settings, save_settings
from app.slots import gain_db, levels, missing_presets, render_request
from app.views.about_dialog import AboutDialog
from app.views.abx_dialog import AbxDialog
from app.views.export_dialog import ExportDialog
from app.views.help_dialog import HelpDialog
from app.views.knob import Knob
from app.views.preset_browser import PresetBrowser
from app.views.slot_buttons import SLOTS
from app.views.string_view import StringView
from engine.metrics import ErrorSums
from engine.preset import SHIPPED

LEFT: tuple[type[Panel], ...] = (SpectrumPanel, SpectrogramPanel, EigenvaluesPanel, PartialsPanel, ErrorPlanePanel)
RIGHT: tuple[type[Panel], ...] = (WaveformPanel, SpaceTimePanel, ErrorTimePanel, ComparePanel)

FRAME_MS = 16
ProblemListener = Callable[[AudioProblem], None]


class _Mail(QObject):
    """Carries what other threads say into the window's thread (Qt queues the signals)."""

    started = Signal(object, object)
    replaced = Signal(object, object)
    finished = Signal(object, object)
    other_refused = Signal(str, str)
    failed = Signal(str, str)
    audio_problem = Signal(object)

    def take_started(self, take: Take, track: Track) -> None:
        self.started.emit(take, track)

    def track_replaced(self, take: Take, track: Track) -> None:
        self.replaced.emit(take, track)

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        self.finished.emit(take, errors)

    def other_failed(self, preset: str, message: str) -> None:
        self.other_refused.emit(preset, message)

    def render_failed(self, message: str, detail: str) -> None:
        self.failed.emit(message, detail)


@dataclass
class _Stage:
    """What is on stage.

    Attributes:
        take, track: what is shown, and its sound.
        play_when_ready: whether the next take shall sound as soon as it is there.
        awaited: plucks that were struck before they were rendered, as `_key`: each sounds when it is there, even
            if the next one is on stage by then.
    """

    take: Take | None = None
    track: Track | None = None
    play_when_ready: bool = False
    awaited: list[tuple[object, ...]] = field(default_factory=list)


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
        self._mail = _Mail()
        self.player = make_player(self._mail.audio_problem.emit)
        self.worker = RenderWorker(self._mail)
        self.audio = AudioControl(window, self.player, settings.device, settings.sound)
        self.appearance = Appearance(window, settings.look)
        self._stage = _Stage()
        self._last_tick_s = time.monotonic()
        self._asked: RenderRequest | None = None
        self._loaded: Track | None = None  # the latest in the player
        self._abx: AbxDialog | None = None  # while it is open, the player is its own
        self._help: HelpDialog | None = None
        self.library = Library([])
        problems = self.library.refresh()
        self.presets = PresetDesk(
            self.session, self.library, window.presets, PresetBrowser(window), settings.favourites
        )
        self.panels = self._make_panels()
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
        self._render()
        self._timer = QTimer(self, interval=FRAME_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        self._timer.start()

    # Connections

    def _make_panels(self) -> list[Panel]:
        """Every panel, its view in its place in the window."""
        session, window = self.session, self.window
        string = self._string = StringPanel(session, self.library)
        window.show_string(string.view)
        panels: list[Panel] = [string]
        for choice, deck, kinds in (("left_view", window.left, LEFT), ("right_view", window.right, RIGHT)):
            for panel in (kind(session, self.library) for kind in kinds):
                deck.add(panel.key, panel.title, panel.view)
                panels.append(panel)
            deck.chosen.connect(lambda key, choice=choice: session.update(**{choice: key}))
        for panel in panels:
            panel.seek_asked.connect(self.player.seek)
            panel.pluck_asked.connect(self.pluck)
            panel.told.connect(window.notices.tell)
        return panels

    def _connect(self) -> None:
        window, session = self.window, self.session
        session.changed.connect(self._choices_changed)
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
        self._mail.started.connect(self._take_started)
        self._mail.replaced.connect(self._track_replaced)
        self._mail.finished.connect(self._take_finished)
        self._mail.other_refused.connect(self._other_refused)
        self._mail.failed.connect(self._render_failed)
        self._mail.audio_problem.connect(self.audio.tell)

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
        """Lets the string go: from the start, with sound, beside the plucks that still ring."""
        stage = self._stage
        self.worker.strike()
        if stage.take is None or stage.track is None or self._is_stale(stage.take):
            stage.play_when_ready = True  # the rendering is on its way, and begins to sound when it starts
            if (key := self._wanted_key()) is not None:
                stage.awaited.append(key)
        elif self._load(stage.track, ring=True):
            self._begin()

    def play_or_stop(self) -> None:
        if self.player.status().playing:
            self._stage.play_when_ready = False
            self._stage.awaited.clear()
            self.player.stop()
        else:
            self.pluck()
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
        entry, stage = self.entry, self._stage
        if entry is None or stage.track is None or stage.take is None or self._is_stale(stage.take):
            self.window.notices.tell("The listening test needs a sound: wait until the pluck is rendered.")
            return
        try:
            subject = subject_of(entry, self.session.choices)
        except OSError as error:
            self.window.notices.tell(f"{entry.path} cannot be read ({error.strerror}).")
            return
        self._abx = AbxDialog(self.player, subject, self._settings.abx, self.window)
        self._abx.finished.connect(self._listening_test_ended)
        self._abx.set_track(stage.track)
        self._abx.open()

    def _listening_test_ended(self) -> None:
        dialog, self._abx = self._abx, None
        assert dialog is not None
        self._settings = self._settings.model_copy(update={"abx": dialog.choices()})
        dialog.deleteLater()
        self._stage.play_when_ready = False
        self.player.set_loop(self.session.choices.loop)
        if self._stage.track is not None:
            self._load(self._stage.track, keep_position=False)

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
        return self.library.find(self.session.choices.preset)

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
        self.worker.close()
        self.player.close()

    # Session → everything

    def _choices_changed(self, names: frozenset[str]) -> None:
        asked, request = self._asked, self._request()
        if request is not None and request != asked:  # first of all: a pluck may be waiting for it
            if not request.same_motion(asked) and not self._string.drawing:
                self._stage.play_when_ready |= self.player.status().playing
            self._render()
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
        self._select()
        if names & {"level_match", "difference_gain_db"}:
            self.player.set_levels(levels(choices))
        if "loop" in names:
            self.player.set_loop(choices.loop)
        if "volume_db" in names:
            self.player.set_volume_db(choices.volume_db)

    # Rendering

    def _request(self) -> RenderRequest | None:
        entry = self.entry
        if entry is None:
            return None
        return render_request(self.session.choices, entry.path, self.library, self.player.rate_hz)

    def _render(self) -> None:
        self._asked = self._request()
        if self._asked is None:
            self.window.notices.tell("No preset was found: train one, or get the presets again.")
        else:
            self.worker.submit(self._asked)

    def _wanted_key(self) -> tuple[object, ...] | None:
        entry, choices = self.entry, self.session.choices
        if entry is None:
            return None
        return entry.name, choices.pluck, round(choices.seconds * entry.info.rate_hz) + 1

    def _is_stale(self, take: Take) -> bool:
        return _key(take) != self._wanted_key()

    def _take_started(self, take: Take, track: Track) -> None:
        stage = self._stage
        struck = _key(take) in stage.awaited
        if struck:
            stage.awaited.remove(_key(take))
        if self._is_stale(take):
            if struck and self._load(track, ring=True):  # a quick pluck, overtaken by the next one: it sounds too
                self.player.play()
            return
        stage.take, stage.track = take, track
        # While the string is drawn the last pluck rings on until this one is let go. The sound comes first.
        if not self._string.drawing and self._load(track, ring=struck) and stage.play_when_ready:
            self._begin()
        for panel in self.panels:
            panel.take_started(take)
        self.window.error_label.setText("rendering …")

    def _begin(self) -> None:
        self._stage.play_when_ready = False
        self.player.play()

    def _track_replaced(self, take: Take, track: Track) -> None:
        if take is self._stage.take:
            self._stage.track = track
            self._load(track, keep_position=True)

    def _load(self, track: Track, keep_position: bool = False, ring: bool = False) -> bool:
        """False where the device changed its rate meanwhile: the sound is then made again at the new one."""
        if self._abx is not None:
            self._abx.set_track(track)
            return False
        try:
            self.player.load(track, keep_position, ring)
        except ValueError:
            self._render()
            return False
        self._loaded = track
        self._select()
        return True

    def _select(self) -> None:
        """Lets the chosen slot be heard, as soon as there is a track that has what it holds."""
        source = self.session.source_heard
        if self._abx is None and self._loaded is not None and source in self._loaded.sources:
            self.player.select(source)

    def _take_finished(self, take: Take, errors: ErrorSums) -> None:
        if take is not self._stage.take:
            return
        for panel in self.panels:
            panel.take_finished(take, errors)
        if take.model_ends_s is not None:
            self.window.notices.tell(
                f"The model's output ran away {take.model_ends_s:.2f} s after the pluck and is silent from there; "
                "the truth goes on. Choose a pluck inside its training, or another preset."
            )
        windows = errors.windows(
            take.info.rate_hz, (0.0, take.info.horizon_s, max(take.seconds, take.info.horizon_s))
        )
        parts = [
            f"{percent(w.rel_mae)} {place}" for w, place in zip(windows, ("as trained", "past it"), strict=False)
        ]
        self.window.error_label.setText("error of this pluck: " + ", ".join(parts))

    def _other_refused(self, preset: str, message: str) -> None:
        self.window.notices.tell(f"{preset} cannot be heard beside this preset: {message}")

    def _render_failed(self, message: str, detail: str) -> None:
        self._stage.awaited.clear()
        self.window.error_label.setText("")
        self.window.notices.tell(message, detail)

    # Sixty times a second

    def _tick(self) -> None:
        now_s = time.monotonic()
        elapsed_s, self._last_tick_s = now_s - self._last_tick_s, now_s
        status = self.player.status()
        window = self.window
        window.transport.show_playing(status.playing)
        hidden = self._abx is not None  # a level would give away what is heard
        window.transport.meter.show_level(-math.inf if hidden else status.peak_db, status.limiting and not hidden)
        if self._asked is not None and status.rate_hz != self._asked.sound_rate_hz:
            self._render()
        choices, track = self.session.choices, self._stage.track
        window.transport.slots.show_gains({s: gain_db(choices, track, getattr(choices, s)) for s in SLOTS})
        take = self._stage.take
        self.audio.show(status, take)
        position_s = min(status.position_s, take.seconds) if take is not None else 0.0
        moment = Moment(take, position_s, status.playing, elapsed_s)
        for panel in self.panels:
            if panel.view.isVisible():
                panel.show_moment(moment)


def _key(take: Take) -> tuple[object, ...]:
    """What tells the motion of a take from others."""
    return take.preset_name, take.pluck, take.frames
