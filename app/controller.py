"""Where everything is connected: session, render worker, player and window.

    widgets ── intents ──► session ── changed ──► controller ──► worker, player, widgets
    worker, player ── (their threads) ── signals of `_Mail`, queued ──► controller
    a timer ── 60 times a second ──► playhead, motion, meter

Everything here runs in the window's thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtGui import QAction

from app.audio import AudioDevice, AudioProblem, AudioUnavailable, Player, Track, output_devices
from app.library import PresetEntry, list_presets
from app.main_window import MainWindow
from app.motion import Strobe, frame_at
from app.rendering import SOURCES, RenderRequest, RenderWorker, Take
from app.session import Session
from app.settings import DeviceChoice, Settings, save_settings
from app.views.export_dialog import ExportDialog
from engine.metrics import ErrorSums
from engine.preset import outside_training
from engine.sources import FULL_SCALE_M

BUFFER_S = 0.05  # of sound ahead: room for a busy interpreter, and still a prompt pluck
FRAME_MS = 16
SPECTRUM_EVERY = 3  # frames of the picture: 20 spectra a second
MM = 1000.0
ProblemListener = Callable[[AudioProblem], None]
MOTION_FIELDS = {"preset", "position", "amplitude_mm", "shape", "width", "seconds"}


class _Mail(QObject):
    """Carries what other threads say into the window's thread (Qt queues the signals)."""

    started = Signal(object, object)
    replaced = Signal(object, object)
    finished = Signal(object, object)
    failed = Signal(str, str)
    audio_problem = Signal(object)

    def take_started(self, take: Take, track: Track) -> None:
        self.started.emit(take, track)

    def track_replaced(self, take: Take, track: Track) -> None:
        self.replaced.emit(take, track)

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        self.finished.emit(take, errors)

    def render_failed(self, message: str, detail: str) -> None:
        self.failed.emit(message, detail)


@dataclass
class _Stage:
    """What is on stage: the take that is shown and its track, and whether it shall sound as soon as it is there."""

    take: Take | None = None
    track: Track | None = None
    play_when_ready: bool = False
    drawn_frames: int = -1  # of the waveform


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
        self._stage = _Stage()
        self._strobe = Strobe()
        self._ticks = 0
        self._last_tick_s = time.monotonic()
        self._spectrum_place: tuple[object, int, float] | None = None
        self._asked_rate_hz = 0
        self._audio_notice = ""
        self.entries, problems = list_presets()
        self._connect()
        self._choose_first_preset()
        for problem in problems:
            self.window.notices.tell(problem)
        self._show_choices(frozenset(type(self.session.choices).model_fields))
        self._open_device()
        self._render()
        self._timer = QTimer(self, interval=FRAME_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        self._timer.start()

    # Connections

    def _connect(self) -> None:
        window, session = self.window, self.session
        session.changed.connect(self._choices_changed)
        window.presets.set_entries(self.entries)
        window.presets.preset_chosen.connect(lambda name: session.update(preset=name))
        window.presets.step_asked.connect(self._step_preset)
        window.previous_asked.connect(lambda: self._step_preset(-1))
        window.next_asked.connect(lambda: self._step_preset(1))
        window.string.pluck_drawn.connect(session.move_pluck)
        window.string.pluck_released.connect(self.pluck)
        window.string.listening_point_moved.connect(session.move_listening_point)
        window.transport.change_asked.connect(self._change)
        window.transport.play_asked.connect(self.play_or_stop)
        window.transport.export_asked.connect(self.export)
        window.export_asked.connect(self.export)
        window.play_asked.connect(self.play_or_stop)
        window.pluck_asked.connect(self.pluck)
        window.switch_asked.connect(session.switch_source)
        window.loop_asked.connect(lambda: session.update(loop=not session.choices.loop))
        window.waveform.seek_asked.connect(self.player.seek)
        window.waveform.getPlotItem().sigXRangeChanged.connect(self._redraw_waveform)
        window.audio_menu.aboutToShow.connect(self._fill_audio_menu)
        window.closing.connect(self.close)
        self._mail.started.connect(self._take_started)
        self._mail.replaced.connect(self._track_replaced)
        self._mail.finished.connect(self._take_finished)
        self._mail.failed.connect(self._render_failed)
        self._mail.audio_problem.connect(self._tell_audio_problem)

    def _change(self, field: str, value: object) -> None:
        try:
            self.session.update(**{field: value})
        except ValueError:  # a knob at its end asks for a hair more
            self._show_choices(frozenset({field}))

    # Intents

    def pluck(self) -> None:
        """Lets the string go: from the start, with sound."""
        stage = self._stage
        stage.play_when_ready = True
        if stage.take is None or stage.track is None or self._is_stale(stage.take):
            return  # the rendering is on its way, and begins to sound when it starts
        if self._load(stage.track, keep_position=False):
            self._begin()

    def play_or_stop(self) -> None:
        if self.player.status().playing:
            self._stage.play_when_ready = False
            self.player.stop()
        else:
            self.pluck()
        self.window.transport.show_playing(self.player.status().playing)

    def export(self) -> None:
        entry = self.entry
        if entry is None:
            self.window.notices.tell("There is no preset to export: choose one first.")
            return
        dialog = ExportDialog(entry, self.session.choices, self._settings.export, self.window)
        dialog.exec()
        self._settings = self._settings.model_copy(update={"export": dialog.export_choices()})

    @property
    def entry(self) -> PresetEntry | None:
        """The chosen preset."""
        return next((e for e in self.entries if e.name == self.session.choices.preset), None)

    def close(self) -> None:
        """Saves the choices and ends every thread."""
        self._timer.stop()
        self._settings = self._settings.model_copy(
            update={"choices": self.session.choices, "window_geometry": self.window.geometry_text()}
        )
        try:
            save_settings(self._settings_path, self._settings)
        except OSError as error:
            self.window.notices.tell(f"The settings {self._settings_path} cannot be written ({error.strerror}).")
        self.worker.close()
        self.player.close()

    # Session → everything

    def _choices_changed(self, names: frozenset[str]) -> None:
        self._show_choices(names)
        if names & MOTION_FIELDS:
            self._stage.play_when_ready |= self.player.status().playing
            self._render()
        elif "listen" in names:
            self._render()

    def _show_choices(self, names: frozenset[str]) -> None:
        choices, window = self.session.choices, self.window
        window.transport.show_choices(choices)
        if "preset" in names:
            window.presets.set_chosen(choices.preset)
        if names & {"position", "amplitude_mm", "shape", "width", "preset", "listen"}:
            self._show_pluck()
        if "heard" in names:
            for view in (window.string, window.spectrum, window.waveform):
                view.set_heard(choices.heard)
            if self._stage.track is not None:
                self.player.select(choices.heard)
        if "loop" in names:
            self.player.set_loop(choices.loop)
        if "volume_db" in names:
            self.player.set_volume_db(choices.volume_db)

    def _show_pluck(self) -> None:
        choices, entry, string = self.session.choices, self.entry, self.window.string
        points = entry.info.grid_points if entry else 101
        string.set_pluck(choices.position, choices.amplitude_mm, choices.pluck.displacement(points).numpy() * MM)
        string.set_listening_point(choices.listen)
        trained = entry.info.trained_range.position if entry else None
        string.set_trained_positions(trained)
        string.set_warning(self._pluck_warning())

    def _pluck_warning(self) -> str:
        choices, entry = self.session.choices, self.entry
        if choices.amplitude_mm == 0:
            return "silent: the amplitude is 0"
        if choices.listen in (0.0, 1.0):
            return "silent: the listening point is at a fixed end"
        if entry is None:
            return ""
        return "; ".join(outside_training(entry.info, choices.pluck))

    def _step_preset(self, step: int) -> None:
        self.session.step_preset([entry.name for entry in self.entries], step)

    def _choose_first_preset(self) -> None:
        if self.entry is None and self.entries:
            highest_hz = max(entry.info.rate_hz for entry in self.entries)
            fullest = [entry for entry in self.entries if entry.info.rate_hz == highest_hz]
            best = min(fullest, key=lambda e: 1.0 if e.info.rel_mae is None else e.info.rel_mae)
            self.session.update(preset=best.name)

    # Rendering

    def _render(self) -> None:
        entry, choices = self.entry, self.session.choices
        if entry is None:
            self.window.notices.tell("No preset was found: train one, or get the presets again.")
            return
        self._asked_rate_hz = self.player.rate_hz
        self.worker.submit(
            RenderRequest(entry.path, choices.pluck, choices.seconds, choices.listen, self._asked_rate_hz)
        )

    def _is_stale(self, take: Take) -> bool:
        choices = self.session.choices
        wanted = (choices.preset, choices.pluck, round(choices.seconds * take.info.rate_hz) + 1)
        return (take.preset_name, take.pluck, take.frames) != wanted

    def _take_started(self, take: Take, track: Track) -> None:
        if self._is_stale(take):
            return
        info = take.info
        new_preset = self._stage.take is None or self._stage.take.info is not info
        self._stage = _Stage(take, track, self._stage.play_when_ready)
        if new_preset:
            self.window.spectrum.set_rate(info.rate_hz)
        peak_mm = max(1e-3, float(np.abs(take.signal_m("truth", self.session.choices.listen)).max()) * MM)
        self.window.waveform.set_take(take.seconds, info.horizon_s, 1.25 * peak_mm)
        self.window.error_label.setText("rendering …")
        if self._load(track, keep_position=False) and self._stage.play_when_ready:
            self._begin()

    def _begin(self) -> None:
        self._stage.play_when_ready = False
        self.player.play()
        self._strobe.restart()

    def _track_replaced(self, take: Take, track: Track) -> None:
        if take is self._stage.take:
            self._stage.track = track
            self._stage.drawn_frames = -1
            self._spectrum_place = None
            self._load(track, keep_position=True)

    def _load(self, track: Track, keep_position: bool) -> bool:
        """False where the device changed its rate meanwhile: the sound is then made again at the new one."""
        try:
            self.player.load(track, keep_position)
        except ValueError:
            self._render()
            return False
        self.player.select(self.session.choices.heard)
        return True

    def _take_finished(self, take: Take, errors: ErrorSums) -> None:
        if take is not self._stage.take:
            return
        if take.model_ends_s is not None:
            self.window.notices.tell(
                f"The model's output ran away {take.model_ends_s:.2f} s after the pluck and is silent from there; "
                "the truth goes on. Choose a pluck inside its training, or another preset."
            )
        windows = errors.windows(
            take.info.rate_hz, (0.0, take.info.horizon_s, max(take.seconds, take.info.horizon_s))
        )
        parts = [
            f"{100 * w.rel_mae:.1f} % {place}" for w, place in zip(windows, ("as trained", "past it"), strict=False)
        ]
        self.window.error_label.setText("error of this pluck: " + ", ".join(parts))

    def _render_failed(self, message: str, detail: str) -> None:
        self.window.error_label.setText("")
        self.window.notices.tell(message, detail)

    # Sixty times a second

    def _tick(self) -> None:
        now_s = time.monotonic()
        elapsed_s, self._last_tick_s = now_s - self._last_tick_s, now_s
        self._ticks += 1
        status = self.player.status()
        window = self.window
        window.transport.show_playing(status.playing)
        window.transport.meter.show_level(status.peak_db, status.limiting)
        if status.device is not None and self._audio_notice:
            window.notices.withdraw(self._audio_notice)  # the sound is back
            self._audio_notice = ""
        if status.rate_hz != self._asked_rate_hz:
            self._render()
        take = self._stage.take
        if take is None:
            return
        self._show_rate(take, status.rate_hz, status.device is not None)
        position_s = min(status.position_s, take.seconds)
        window.waveform.show_playhead(position_s)
        if status.playing or position_s > 0:
            self._strobe.advance(
                elapsed_s if status.playing else 0.0, self.session.choices.speed, take.fundamental_hz
            )
            shown_s = self._strobe.time_s(position_s, take.fundamental_hz)
            window.string.show_frame(frame_at(take, position_s, shown_s, self.session.choices.speed))
        else:
            window.string.show_frame(None)
        if self._ticks % SPECTRUM_EVERY == 0:
            self._show_spectrum(take, position_s)
            if self._stage.drawn_frames != take.ready_frames:
                self._redraw_waveform()

    def _show_spectrum(self, take: Take, position_s: float) -> None:
        place = (take, take.ready_frames if not take.complete else -1, position_s)
        if place == self._spectrum_place:
            return
        self._spectrum_place = place
        first = round(position_s * take.info.rate_hz)
        last = first + self.window.spectrum.analyser.window_frames
        self.window.spectrum.show_signals(
            {name: take.signal_m(name, self.session.choices.listen, first, last) / FULL_SCALE_M for name in SOURCES}
        )

    def _redraw_waveform(self) -> None:
        take = self._stage.take
        if take is not None:
            self._stage.drawn_frames = take.ready_frames
            signals = {name: take.signal_m(name, self.session.choices.listen) * MM for name in SOURCES}
            self.window.waveform.show_signals(signals, take.info.rate_hz)

    def _show_rate(self, take: Take, sound_rate_hz: int, has_device: bool) -> None:
        model, device = take.info.rate_hz / 1000, sound_rate_hz / 1000
        text = f"{model:g} → {device:g} kHz" if has_device else f"{model:g} kHz  ·  no sound device"
        if self.window.rate_label.text() != text:
            self.window.rate_label.setText(text)
            self.window.rate_label.setToolTip("The model's rate, converted to the sound device's rate")

    # Sound device

    def _open_device(self) -> None:
        chosen = self._settings.device
        self.player.open(AudioDevice(chosen.name, chosen.host_api) if chosen else None, BUFFER_S)

    def _tell_audio_problem(self, problem: AudioProblem) -> None:
        self._audio_notice = f"{problem} The app goes on without sound."
        self.window.notices.tell(self._audio_notice, problem.detail)

    def _fill_audio_menu(self) -> None:
        menu = self.window.audio_menu
        menu.clear()
        default = QAction("System default", menu)
        default.triggered.connect(lambda: self._choose_device(None))
        menu.addAction(default)
        menu.addSeparator()
        try:
            devices = output_devices(rescan=self.player.status().device is None)
        except AudioUnavailable as error:
            menu.addAction(str(error)).setEnabled(False)
            return
        present = self.player.status().device
        for device in devices:
            action = QAction(f"{device.name}   ({device.host_api})", menu, checkable=True)
            action.setChecked(
                present is not None and (device.name, device.host_api) == (present.name, present.host_api)
            )
            choice = DeviceChoice(name=device.name, host_api=device.host_api)
            action.triggered.connect(lambda _=False, choice=choice: self._choose_device(choice))
            menu.addAction(action)

    def _choose_device(self, choice: DeviceChoice | None) -> None:
        self._settings = self._settings.model_copy(update={"device": choice})
        self._open_device()
