"""The audio settings: output, sample rate, buffer; a test tone, dropouts and load.

Every choice takes effect at once. The dialog does not block the window: a buffer can be tried while a string sounds.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from app.audio.choices import Buffer, DeviceChoice, SoundChoice
from app.audio.sound import SoundStatus
from app.views.controls.form import Form
from app.views.controls.parts import combo_box, filled, label, push_button, refill
from app.views.controls.plain import Label
from engine.voices import Gap

RATES = {0: "Device default", 44_100: "44.1 kHz", 48_000: "48 kHz", 96_000: "96 kHz"}
BUFFERS: dict[Buffer, str] = {
    "low": "Low latency",
    "medium": "Medium",
    "high": "High: safest against crackles",
    128: "128 frames",
    256: "256 frames",
    512: "512 frames",
    1024: "1024 frames",
    2048: "2048 frames",
}
ADVICE = (
    "Crackles? Choose a larger buffer, or close other programs that use the processor. "
    "A smaller buffer has a lower latency."
)


class AudioDialog(QDialog):
    """Gestures emit signals; `show_…` shows what became of them.

    A gap is a dropout: a silence while a string should have sounded.
    """

    choice_made = Signal(object, object)  # DeviceChoice or None, SoundChoice
    rescan_asked = Signal()
    tone_asked = Signal(str)  # left, right or both

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Audio settings")
        self.setMinimumWidth(520)
        self._state_label = label()
        self._problem_label = label("warning", selectable=True)
        self._problem = QFrame()
        self._problem.setObjectName("panel")
        QHBoxLayout(self._problem).addWidget(self._problem_label)
        tip = "Audio output; remembered by its name"
        self._device = combo_box("Output", [("System default", None)], tip=tip, picked=self._choose)
        self._device.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._device.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        tip = "Sample rate of the device; the model's rate is converted to it"
        rates = [(name, rate) for rate, name in RATES.items()]
        self._rate = combo_box("Sample rate", rates, tip=tip, picked=self._choose)
        tip = "Length of the audio buffer: longer is safer against dropouts, shorter has a lower latency"
        buffers = [(name, buffer) for buffer, name in BUFFERS.items()]
        self._buffer = combo_box("Buffer", buffers, tip=tip, picked=self._choose)
        self._gaps = Label("0", minimumWidth=40)
        tip = "Processor time of the sound as a share of the time it plays: near 100 % there are dropouts"
        self._load = Label("0 %", toolTip=tip)
        self._latest: Gap | None = None  # the last one reported; None: none was
        self._zero: Gap | None = None  # the last one as the user reset the count: up to it none is counted
        self._lay_out()

    @property
    def device(self) -> DeviceChoice | None:
        """The device as chosen in the list; None: the system's default."""
        key = self._device.currentData()
        return DeviceChoice(name=key[0], host_api=key[1]) if key else None

    @property
    def sound(self) -> SoundChoice:
        return SoundChoice(rate_hz=self._rate.currentData(), buffer=self._buffer.currentData())

    def show_devices(self, devices: Sequence[DeviceChoice], chosen: DeviceChoice | None) -> None:
        """Show the connected outputs; the chosen one is listed even where it is not connected."""
        keys = [(device.name, device.host_api) for device in devices]
        selected = (chosen.name, chosen.host_api) if chosen else None
        entries = [("System default", None), *((f"{name}   ({api})", (name, api)) for name, api in keys)]
        if selected and selected not in keys:
            entries.append((f"{selected[0]}   ({selected[1]}), not connected", selected))
        refill(self._device, entries, selected)

    def show_sound(self, sound: SoundChoice) -> None:
        self._rate.setCurrentIndex(self._rate.findData(sound.rate_hz))
        self._buffer.setCurrentIndex(self._buffer.findData(sound.buffer))

    def show_status(self, status: SoundStatus, latencies_s: Sequence[float] = ()) -> None:
        """Show the state of the output; `latencies_s`: from keys to the device, as measured."""
        device, gaps = status.device, status.gaps
        self._latest = gaps[-1] if gaps else None
        if self._zero in gaps:  # it may be gone: only the latest are there
            gaps = gaps[gaps.index(self._zero) + 1 :]
        facts = f"{status.rate_hz / 1000:g} kHz, buffer {1000 * status.latency_s:.0f} ms"
        if latencies_s:
            facts += f", key to device {1000 * statistics.median(latencies_s):.1f} ms (measured)"
        output = device and f"Sound goes to “{device.name}” ({device.host_api}), {facts}."
        _set(self._state_label, output or "No audio output.")
        _set(self._problem_label, status.problem or "")
        words = [f"{gap.time_s:.1f} s: {gap.cause}" for gap in gaps]
        _set(self._gaps, f"{len(gaps)}, the last at {words[-1]}" if gaps else "0")
        tip = "\n".join(["Silences while a string should have sounded", *words[-12:]])
        if self._gaps.toolTip() != tip:
            self._gaps.setToolTip(tip)
        _set(self._load, f"{100 * status.load:.0f} %")
        if self._problem.isHidden() == bool(status.problem):
            self._problem.setVisible(bool(status.problem))
            self.adjustSize()
        for button in self._tones:
            button.setEnabled(device is not None)

    def _reset_gaps(self) -> None:
        self._zero = self._latest
        self._gaps.setText("0")

    def _choose(self, _: object) -> None:
        self.choice_made.emit(self.device, self.sound)

    def _lay_out(self) -> None:
        tip = "Search for newly connected outputs and open the selected one"
        rescan = push_button("Rescan", tip, "Rescan", pressed=self.rescan_asked)
        self._tones: list[QPushButton] = []
        for side in ("left", "both", "right"):
            tip = f"A soft tone for a second: {side}"
            tone = push_button(side.capitalize(), tip, tip)
            tone.clicked.connect(lambda _=False, side=side: self.tone_asked.emit(side))
            self._tones.append(tone)
        tip = "Count dropouts from zero"
        reset = push_button("Reset", tip, tip, pressed=self._reset_gaps)
        form = Form()
        form.row("Output", self._device, rescan)
        form.row("Sample rate", self._rate)
        form.row("Buffer", self._buffer)
        form.row("Test tone", *self._tones)
        form.row("Dropouts", self._gaps, reset)
        form.row("Load", self._load)
        tip = "Close; changes are already applied"
        close = push_button("Close", tip, tip, pressed=self.accept, default=True)
        last, advice = filled(QHBoxLayout(), None, close), label("faint", ADVICE)
        filled(QVBoxLayout(self), self._state_label, self._problem, form, advice, None, last, spacing=14)


def _set(target: QLabel, text: str) -> None:
    if target.text() != text:
        target.setText(text)
