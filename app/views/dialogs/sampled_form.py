"""How a patch becomes an instrument for samplers: format, keys, layers, length, source, place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QCheckBox, QFileDialog, QFormLayout, QLineEdit, QSpinBox, QWidget

from app.export.sampled.choices import SampledChoices
from app.export.sampled.job import plain_stem
from app.export.sampled.plan import MOST_LAYERS, SECONDS_RANGE, WIDEST_STEP, SampledPlan
from app.patches.patch import Patch
from app.views.controls.note_box import NoteBox
from app.views.controls.parts import combo_box, faint, tool_button
from app.views.dialogs.sound_form import label, row_of, spin_box

FORM_NAMES = (("SFZ with FLAC samples", "flac"), ("SFZ with WAV samples", "wav"), ("SoundFont 2", "sf2"))
FILTERS = {".sfz": "SFZ (*.sfz)", ".sf2": "SoundFont 2 (*.sf2)"}
RATES_HZ = (44_100, 48_000, 96_000)


class SampledForm(QWidget):
    """Reports each change; `choices` has the state, `plan` and `path` what it means for the patch that is shown."""

    changed = Signal()

    def __init__(self, patch: Patch, choices: SampledChoices, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._patch = patch
        self._folder = choices.folder or str(Path.home())
        self._named_by_user = False
        self.form = combo_box("Format", FORM_NAMES, choices.form)
        self.form.setToolTip("An SFZ has a folder of samples beside it; a SoundFont is one file, of 16 bits")
        self.bits = combo_box("Bits", [("24-bit", "24"), ("16-bit, dithered", "16")], choices.bits)
        self.bits.setToolTip("Of each sample")
        self.rate = combo_box("Sample rate", [(f"{hz / 1000:g} kHz", hz) for hz in RATES_HZ], choices.rate_hz)
        self.rate.setToolTip("Of the samples")
        self.lowest = NoteBox("Lowest key", "The lowest key: a note, as E2, or a MIDI number")
        self.highest = NoteBox("Highest key", "The highest key: a note, as E6, or a MIDI number")
        self.every = _count("Keys a sample", "One sample for so many keys; those between are transposed", WIDEST_STEP)
        self.every.setValue(choices.every)
        self.layers = _count("Velocity layers", "How many velocities are rendered of each key", MOST_LAYERS)
        self.layers.setValue(choices.layers)
        self.seconds = spin_box("Longest sample", *SECONDS_RANGE, choices.seconds, " s", 1, 1)
        self.seconds.setPrefix("at most ")
        self.seconds.setToolTip("Silent ones end sooner; one that still rings is faded out")
        self.source = combo_box("Source", [("Model", "model"), ("Truth", "truth")], choices.source)
        self.source.setToolTip("What plays the patch")
        self.dry = QCheckBox("Dry: the room is left to the sampler")
        self.dry.setToolTip("A room in the samples ends with each released key")
        self.dry.setMinimumHeight(28)
        self.dry.setChecked(choices.dry)
        self.path = QLineEdit()
        self.path.setAccessibleName("File")
        self.path.setToolTip("Where the instrument is written")
        browse = tool_button("Browse …", tip="Choose the file")
        browse.clicked.connect(self._browse)
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow(label("Format"), row_of(self.form, self.bits, self.rate))
        keys = row_of(self.lowest, faint("to"), self.highest, faint("a sample for every"), self.every)
        keys.insertWidget(5, faint("keys"))
        form.addRow(label("Keys"), keys)
        form.addRow(label("Velocity layers"), row_of(self.layers))
        form.addRow(label("Length"), row_of(self.seconds))
        form.addRow(label("Source"), row_of(self.source))
        form.addRow(label("Room"), row_of(self.dry))
        place = row_of(browse)
        place.insertWidget(0, self.path, 100)
        form.addRow(label("File"), place)
        self.show_patch(patch, choices.keys)
        for box in (self.form, self.bits, self.rate, self.source):
            box.currentIndexChanged.connect(self._update)
        for spin in (self.lowest, self.highest, self.every, self.layers, self.seconds):
            spin.valueChanged.connect(self._update)
        self.dry.toggled.connect(self._update)
        self.path.textEdited.connect(self._name_edited)

    def show_patch(self, patch: Patch, keys: tuple[int, int] | None) -> None:
        """Another patch, or the same that was turned. `keys`: those chosen, as far as it has them; None for all."""
        self._patch = patch
        low, high = patch.range
        chosen = keys if keys and low <= keys[0] <= keys[1] <= high else patch.range
        for box, key in zip((self.lowest, self.highest), chosen, strict=True):
            with QSignalBlocker(box):
                box.setRange(low, high)
                box.setValue(key)
        self.dry.setEnabled(patch.room.mix > 0)
        self._suggest_name()

    def keys(self) -> tuple[int, int] | None:
        """None for all of the patch."""
        keys = self.lowest.value(), self.highest.value()
        return None if keys == self._patch.range else keys

    def choices(self) -> SampledChoices:
        return SampledChoices(
            folder=str(Path(self.path.text().strip()).parent),
            form=self.form.currentData(),
            bits=self.bits.currentData(),
            rate_hz=self.rate.currentData(),
            keys=self.keys(),
            every=self.every.value(),
            layers=self.layers.value(),
            seconds=self.seconds.value(),
            source=self.source.currentData(),
            dry=self.dry.isChecked(),
        )

    @property
    def out(self) -> Path:
        """Raises ValueError where it does not end as the format's files do."""
        text = self.path.text().strip()
        if not text:
            raise ValueError("file: choose where the instrument is written")
        path = Path(text)
        if path.suffix.lower() != self._suffix:
            raise ValueError(f"{path}: must end with {self._suffix}")
        return path

    def plan(self) -> SampledPlan:
        """Without the digest of the preset. Raises ValueError: what cannot be; the message names it."""
        low, high = self.lowest.value(), self.highest.value()
        if low > high:
            raise ValueError("keys: the lowest is above the highest; exchange them")
        patch = self._patch.with_value("room.mix", 0.0) if self.dry.isChecked() else self._patch
        chosen = self.choices()
        plan = SampledPlan(
            patch, self.keys(), chosen.every, chosen.layers, chosen.seconds, chosen.rate_hz, source=chosen.source
        )
        return plan if chosen.form == "sf2" else replace(plan, format=chosen.form, bits=chosen.bits)

    @property
    def _suffix(self) -> str:
        return ".sf2" if self.form.currentData() == "sf2" else ".sfz"

    def _update(self) -> None:
        self._suggest_name()
        self.changed.emit()

    def _suggest_name(self) -> None:
        """After the patch unless the user gave one; the ending follows the format."""
        self.bits.setVisible(self._suffix == ".sfz")
        typed = self.path.text().strip()
        if not self._named_by_user:
            self.path.setText(str(Path(self._folder) / f"{plain_stem(self._patch.name)}{self._suffix}"))
        elif Path(typed).suffix.lower() in FILTERS:
            self.path.setText(str(Path(typed).with_suffix(self._suffix)))

    def _name_edited(self) -> None:
        self._named_by_user = True
        self.changed.emit()

    def _browse(self) -> None:
        kind = FILTERS[self._suffix]
        path, _ = QFileDialog.getSaveFileName(self, "Export instrument", self.path.text(), kind)
        if path:
            self.path.setText(path if path.lower().endswith(self._suffix) else f"{path}{self._suffix}")
            self._name_edited()


def _count(name: str, tip: str, most: int) -> QSpinBox:
    spin = QSpinBox(minimum=1, maximum=most)
    spin.setAccessibleName(name)
    spin.setToolTip(tip)
    spin.setMinimumWidth(56)
    spin.lineEdit().setTextMargins(6, 0, 0, 0)
    return spin
