"""How a sound becomes a file: length, rate, format, level. Both pages of the export dialog share it."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QCheckBox, QDoubleSpinBox, QFormLayout, QHBoxLayout, QLabel, QWidget

from app.export.choices import ExportChoices
from app.export.sound import DECAY_RANGE_DB, LONGEST_S
from app.export.wav import WavSettings
from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB, Bits
from app.views.controls.parts import combo_box, faint
from app.views.controls.plain import Label

RATES_HZ = (0, 44_100, 48_000, 96_000)  # 0: the model's own
BITS_NAMES: dict[Bits, str] = {"16": "16-bit PCM, dithered", "24": "24-bit PCM", "32f": "32-bit floating point"}
LABEL_WIDTH = 104


class SoundForm(QWidget):
    """Emits `changed` at each change; `choices` gives the state."""

    changed = Signal()

    def __init__(self, export: ExportChoices, preset_rate_hz: int, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._preset_rate_hz = preset_rate_hz
        self.length = combo_box("Length", [("Until it has decayed", True), ("Fixed", False)], export.until_decayed)
        self.length.setToolTip("Where the file ends: when the sound has decayed, or after a fixed time")
        self.decay = spin_box("Decay", *DECAY_RANGE_DB, export.decay_db, " dB", 0, 5)
        self.decay.setPrefix("by ")
        self.decay.setToolTip("The sound ends where model and truth are this far below their peak")
        self.longest = spin_box("Longest duration", 0.1, LONGEST_S, export.longest_s, " s", 1, 1)
        self.longest.setPrefix("at most ")
        self.longest.setToolTip("A string that rings longer is faded out at this length")
        self.seconds = spin_box("Duration", 0.1, LONGEST_S, export.seconds, " s", 1, 0.5)
        self.seconds.setToolTip("The end is faded out within 10 ms")
        names = [("The model's rate", 0), *((f"{rate / 1000:g} kHz", rate) for rate in RATES_HZ if rate)]
        self.rate = combo_box("Sample rate", names, export.rate_hz)
        self.rate.setToolTip("A rate above the model's own adds no bandwidth")
        self._rate_note = faint()
        self.bits = combo_box("Format", [(name, bits) for bits, name in BITS_NAMES.items()], export.bits)
        self.bits.setToolTip("16 bits are dithered; floating point never clips")
        self.normalise = QCheckBox("Normalise to −1 dBFS, one gain for model and truth")
        self.normalise.setMinimumHeight(28)
        self.normalise.setToolTip("Off: 10 mm of displacement is full scale, as played at 0 dB without a patch")
        self.normalise.setChecked(export.normalise)
        self.gain = spin_box(
            "Gain of the difference", *DIFFERENCE_GAIN_RANGE_DB, export.difference_gain_db, " dB", 0, 6
        )
        self.gain.setPrefix("+")
        self.gain.setToolTip("Gain of the difference, model − truth")
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow(label("Length"), row_of(self.length, self.decay, self.longest, self.seconds))
        form.addRow(label("Sample rate"), row_of(self.rate, self._rate_note))
        form.addRow(label("Format"), row_of(self.bits))
        form.addRow(label("Level"), row_of(self.normalise))
        self._difference = QWidget()
        self._difference.setLayout(row_of(self.gain, faint("gain")))
        form.addRow(label("Difference"), self._difference)
        self._form = form
        for box in (self.length, self.rate, self.bits):
            box.currentIndexChanged.connect(self._update)
        for spin in (self.decay, self.longest, self.seconds, self.gain):
            spin.valueChanged.connect(self._update)
        self.normalise.toggled.connect(self._update)
        self._update()

    def choices(self) -> dict[str, object]:
        """Fields of `ExportChoices`."""
        return {
            "until_decayed": self.length.currentData(),
            "decay_db": self.decay.value(),
            "longest_s": self.longest.value(),
            "seconds": self.seconds.value(),
            "rate_hz": self.rate.currentData(),
            "bits": self.bits.currentData(),
            "normalise": self.normalise.isChecked(),
            "difference_gain_db": self.gain.value(),
        }

    def show_difference(self, shown: bool) -> None:
        """Whether the gain of the difference matters."""
        self._form.setRowVisible(self._difference, shown)

    def _update(self) -> None:
        decays = self.length.currentData()
        for spin, shown in ((self.decay, decays), (self.longest, decays), (self.seconds, not decays)):
            spin.setVisible(shown)
        rate_hz = self.rate.currentData() or self._preset_rate_hz
        text = "" if self.rate.currentData() else f"{rate_hz / 1000:g} kHz"
        if rate_hz > self._preset_rate_hz:
            text = f"adds no bandwidth: the model ends at {self._preset_rate_hz / 2000:g} kHz"
        self._rate_note.setText(text)
        self.changed.emit()


def wav_settings(export: ExportChoices) -> WavSettings:
    """The settings of the WAV writer, of the dialog's choices."""
    return WavSettings(bits=export.bits, rate_hz=export.rate_hz or None, normalise=export.normalise)


def label(text: str) -> QLabel:
    """A form's label; all are of one width, so that the forms of the dialog are aligned."""
    made = Label(text)
    made.setFixedWidth(LABEL_WIDTH)
    made.setMinimumHeight(28)
    made.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
    return made


def row_of(*widgets: QWidget) -> QHBoxLayout:
    """Side by side, with empty space at the end."""
    row = QHBoxLayout()
    row.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        row.addWidget(widget)
    row.addStretch(1)
    return row


def spin_box(
    name: str, low: float, high: float, value: float, suffix: str, decimals: int, step: float
) -> QDoubleSpinBox:
    spin = QDoubleSpinBox(minimum=low, maximum=high, singleStep=step, suffix=suffix, decimals=decimals)
    spin.setAccessibleName(name)
    spin.lineEdit().setTextMargins(6, 0, 0, 0)
    spin.setMinimumWidth(84)
    spin.setValue(value)
    return spin
