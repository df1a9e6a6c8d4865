"""The audio settings: output, sample rate, buffer; a test tone, dropouts and load.

Every choice takes effect at once. The dialog does not block the window: a buffer can be tried while a string sounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QFormLayout,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.audio.choices import Buffer, DeviceChoice, SoundChoice
from app.views.controls.parts import combo_box, filled, label, push_button, refill
from app.views.controls.plain import Label

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


@dataclass(frozen=True)
class AudioState:
    """The state of the present output, as the dialog reports it."""

    playing_on: str  # a device with its host API; "": none
    facts: str  # its rate, its buffer, and the latency that was measured
    problem: str
    gaps: tuple[str, ...]  # dropouts: when and why, the latest last
    load: float  # processor time of the mixer as a share of the time that it renders


class AudioDialog(QDialog):
    """Gestures emit signals; `show_…` shows what became of them."""

    choice_made = Signal(object, object)  # DeviceChoice or None, SoundChoice
    rescan_asked = Signal()
    tone_asked = Signal(str)  # left, right or both
    gaps_reset = Signal()

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

    def show_state(self, state: AudioState) -> None:
        output = bool(state.playing_on)
        _set(self._state_label, f"Sound goes to {state.playing_on}, {state.facts}." if output else "No audio output.")
        _set(self._problem_label, state.problem)
        latest = f", the last at {state.gaps[-1]}" if state.gaps else ""
        _set(self._gaps, f"{len(state.gaps)}{latest}")
        tip = "\n".join(["Silences while a string should have sounded", *state.gaps[-12:]])
        if self._gaps.toolTip() != tip:
            self._gaps.setToolTip(tip)
        _set(self._load, f"{100 * state.load:.0f} %")
        if self._problem.isHidden() == bool(state.problem):
            self._problem.setVisible(bool(state.problem))
            self.adjustSize()
        for button in self._tones:
            button.setEnabled(output)

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
        reset = push_button("Reset", tip, tip, pressed=self.gaps_reset)
        form = QFormLayout()
        form.setLabelAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        form.setSpacing(10)
        output = filled(QHBoxLayout(), self._device, rescan)
        output.setStretch(0, 1)
        form.addRow("Output", output)
        form.addRow("Sample rate", self._rate)
        form.addRow("Buffer", self._buffer)
        form.addRow("Test tone", filled(QHBoxLayout(), *self._tones, None))
        form.addRow("Dropouts", filled(QHBoxLayout(), self._gaps, reset, None))
        form.addRow("Load", self._load)
        tip = "Close; changes are already applied"
        close = push_button("Close", tip, tip, pressed=self.accept, default=True)
        last, advice = filled(QHBoxLayout(), None, close), label("faint", ADVICE)
        filled(QVBoxLayout(self), self._state_label, self._problem, form, advice, None, last, spacing=14)


def _set(target: QLabel, text: str) -> None:
    if target.text() != text:
        target.setText(text)
