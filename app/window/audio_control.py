"""The sound output as the user has chosen it: opening it, its dialog, its faults, the badge in the header.

A choice is saved once the device plays with it: one that was refused must not leave the next start without sound.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from app.audio.choices import DeviceChoice, SoundChoice
from app.audio.devices import output_devices
from app.audio.problems import AudioProblem, ProblemKind
from app.audio.sound import Sound, SoundStatus
from app.presets.words import rate_word
from app.views.controls.plain import plain_tip
from app.views.dialogs.audio_dialog import AudioDialog
from app.window.main_window import MainWindow

if TYPE_CHECKING:
    from app.playing.notes import Notes
    from app.rendering import Take

FREQUENT, FREQUENT_WITHIN_S = 3, 10.0  # so many gaps within so long are worth a notice
FREQUENT_GAPS = (
    "The sound has gaps. A longer buffer prevents them: Audio …, or Ctrl+comma. So does closing other programs."
)
LIST_EVERY = 5  # calls of `show` between two looks at the list of devices


MakeSound = Callable[[Callable[[AudioProblem], None]], Sound]


class AudioControl(QObject):
    """The choice of an output, in the window's thread. `device` and `sound`: what played last, to be saved."""

    _reported = Signal(object)  # a fault, from the output's caretaker thread

    def __init__(
        self, window: MainWindow, make_output: MakeSound, device: DeviceChoice | None, sound: SoundChoice
    ) -> None:
        super().__init__(window)
        self.device, self.sound = device, sound
        self._wish = (device, sound)  # what is to play; a device of None: the system's default
        self._window = window
        self.output = make_output(self._reported.emit)
        self._reported.connect(self.report)
        self._changes = 0  # calls of `open` so far
        self._notice = ""  # the notice about the sound that is shown; "": none
        self._latencies_s: tuple[float, ...] = ()  # from gestures to sound, the latest last
        self._measured_with: object = None  # device and its latency, of these; None: not measured
        self._listed: list[DeviceChoice] | None = None  # in the dialog; None: not listed, or not known
        self._moments = 0  # calls of `show` while the dialog was open
        self._advised = False  # of frequent gaps, with this buffer
        self._dialog: AudioDialog | None = None

    def open(self, rescan: bool = False) -> None:
        """Open the output as chosen. Return at once; `show` sees what became of it."""
        self._changes += 1
        self.output.open(*self._wish, rescan)

    def report(self, problem: AudioProblem) -> None:
        """Show a fault of the output as a notice, with what plays on; an internal one stays, for its report."""
        if problem.kind is ProblemKind.INTERNAL:
            self._window.notices.report(str(problem), problem.detail)
            return
        if self._notice:
            self._window.notices.withdraw(self._notice)  # one notice about the sound at a time
        self._notice = str(problem)
        if problem.kind is not ProblemKind.STALLED:
            device = self.output.status().device
            self._notice += (
                f" Playback continues on “{device.name}”." if device else " The app continues without sound."
            )
        self._window.notices.report(self._notice, problem.detail)

    def show(self, status: SoundStatus, notes: Notes, take: Take | None) -> None:
        """Show the present state; to be called ten times a second.

        Args:
            notes: whose latencies are shown, and forgotten where device or buffer have changed.
            take: the shown motion, whose model's rate is in the header; None: none.
        """
        if status.problem is None:
            if self._notice:
                self._window.notices.withdraw(self._notice)  # the sound is back
                self._notice = ""
            if status.changes_done == self._changes and status.device is not None:
                self.device, self.sound = self._wish
        if self._measured_with not in (None, (status.device, status.latency_s)):
            notes.forget_latencies()
        self._measured_with = status.device, status.latency_s
        self._latencies_s = notes.latencies_s
        self._watch_gaps(status)
        if take is not None:
            self._show_badge(status, take.info.rate_hz)
        if self._dialog is not None and self._dialog.isVisible():
            self._moments += 1
            self._dialog.show_status(status, self._latencies_s)
            if self._moments % LIST_EVERY == 0 and self._listed is not None:
                self._list_devices()

    def _watch_gaps(self, status: SoundStatus) -> None:
        """Name the remedy once for a buffer, when gaps have come close together."""
        if not self._advised and len(status.gaps) >= FREQUENT:
            last = status.gaps[-FREQUENT:]
            if last[-1].time_s - last[0].time_s < FREQUENT_WITHIN_S:
                self._advised = True
                self._window.notices.inform(FREQUENT_GAPS)

    def show_dialog(self) -> None:
        """Open the dialog of the sound output, which does not block the window, or bring it to the front."""
        if self._dialog is None:
            self._dialog = dialog = AudioDialog(self._window)
            dialog.choice_made.connect(self._choose)
            dialog.rescan_asked.connect(lambda: self.open(rescan=True))
            dialog.tone_asked.connect(self.output.sound_tone)
        self._listed = None
        self._list_devices()
        self._dialog.show_sound(self._wish[1])
        self._dialog.show_status(self.output.status(), self._latencies_s)
        self._dialog.show()
        self._dialog.raise_()

    def _choose(self, device: DeviceChoice | None, sound: SoundChoice) -> None:
        self._wish = (device, sound)
        self._advised = False
        self.open()

    def _list_devices(self) -> None:
        """List the devices when they have changed. Without PortAudio they are asked for once: that takes long."""
        first = self._listed is None
        try:
            devices = output_devices(rescan=first and self.output.status().device is None)
        except AudioProblem:
            devices, choices = [], None
        else:
            choices = [device.choice for device in devices]
        if self._dialog is not None and (first or choices != self._listed):
            self._dialog.show_devices(choices or [], self._wish[0])
        self._listed = choices

    def _show_badge(self, status: SoundStatus, model_rate_hz: int) -> None:
        """Show in the header the model's rate and, where it differs, the output's; or that there is no sound."""
        rate, fault = rate_word(model_rate_hz), status.device is None
        converted = "" if status.rate_hz == model_rate_hz else f" → {rate_word(status.rate_hz)}"
        text = "no sound" if fault else f"{rate}{converted}"
        tip = "The model's rate, converted to the sound device's rate" if converted else "The sample rate"
        if fault:
            tip = f"{status.problem or 'No audio output'}\nAudio settings: Ctrl+,"
        self._window.show_rate(text, plain_tip(tip), fault)
