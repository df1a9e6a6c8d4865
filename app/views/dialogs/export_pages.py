"""The pages of the export dialog: the present pluck, and a batch of many."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QFileDialog,
    QFormLayout,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QWidget,
)

from app.export.batch import BatchPlan, NamedString
from app.export.choices import BatchChoices, ExportChoices
from app.export.files import Source
from app.export.sound import SOURCES
from app.patches.patch import Patch
from app.presets.library import PresetEntry
from app.presets.words import shape_word
from app.session.choices import Choices
from app.session.slots import other_preset
from app.views.controls.parts import combo_box, faint, tool_button
from app.views.controls.plain import Label, plain_tip
from app.views.dialogs.chosen_sound import string_word, suggested_name
from app.views.dialogs.sound_form import label, row_of, wav_settings
from engine.pluck import Pluck

SOURCE_NAMES = (
    ("Model", "model"),
    ("Truth", "truth"),
    ("Difference: model minus truth", "difference"),
    ("Both, in two files", "files"),
    ("Both, model left and truth right", "both"),
)


def as_heard(
    entries: Sequence[PresetEntry], choices: Choices, export: ExportChoices
) -> tuple[Choices, ExportChoices]:
    """Both choices, with the source that is heard as the one to save.

    Where model and truth were saved together last and one of them is heard, both are saved again. Where the heard
    slot holds another preset, that preset's model is saved.
    """
    source = choices.source_heard
    if name := other_preset(source):
        if any(entry.name == name for entry in entries):
            choices = choices.changed({"preset": name})
        source = "model"
    if source == "difference":
        gain_db = choices.difference_gain_db
        return choices, export.model_copy(update={"source": source, "difference_gain_db": gain_db})
    if export.source in ("files", "both") and not name:
        return choices, export
    return choices, export.model_copy(update={"source": source})


class SoundPage(QWidget):
    """One pluck to one file, or two."""

    changed = Signal()

    def __init__(
        self,
        preset: PresetEntry,
        choices: Choices,
        export: ExportChoices,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._preset, self._choices = preset, choices
        self._named_by_user = False
        self._folder = export.folder or str(Path.home())
        names = [entry for entry in SOURCE_NAMES if not (choices.stereo and entry[1] == "both")]
        self.source = combo_box("Source", names, export.source)
        self.source.currentIndexChanged.connect(self.changed)
        self.source.setToolTip("What to save")
        self.path = QLineEdit()
        self.path.setAccessibleName("File")
        self.path.setToolTip("With two files, the source is appended to each name")
        self.path.textEdited.connect(self._name_edited)
        browse = tool_button("Browse …", tip="Choose the file")
        browse.clicked.connect(self._browse)
        self.what = Label(_pluck_text(preset, choices))
        self.what.setObjectName("faint")
        self.what.setWordWrap(True)
        form = QFormLayout(self)
        form.setContentsMargins(0, 12, 0, 0)
        form.addRow(label("Sound"), self.what)
        form.addRow(label("Source"), row_of(self.source))
        place = row_of(browse)
        place.insertWidget(0, self.path, 100)
        form.addRow(label("File"), place)
        self.names = faint()
        form.addRow(label("Saved as"), self.names)
        self._form = form

    def suggest_name(self, rate_hz: int) -> None:
        """A name after what is in the file, unless the user gave one; two files are named beneath."""
        if not self._named_by_user:
            chosen = self.source.currentData()
            source: Source = "model" if chosen == "files" else chosen
            name = suggested_name(self._preset, self._choices, rate_hz, source)
            self.path.setText(str(Path(self._folder) / name))
        self.names.setText("\n".join(path.name for path in self.paths().values()))
        self._form.setRowVisible(self.names, len(self.paths()) > 1)

    def paths(self) -> dict[Source, Path]:
        """The files that will be written, by source."""
        path, source = Path(self.path.text().strip()), self.source.currentData()
        if path.name and path.suffix.lower() != ".wav":
            path = path.with_name(f"{path.name}.wav")
        if source != "files":
            return {source: path}
        stem = path.stem.removesuffix("_model").removesuffix("_truth")
        return {name: path.with_name(f"{stem}_{name}.wav") for name in ("model", "truth")}

    def _name_edited(self) -> None:
        self._named_by_user = True
        self.changed.emit()

    def _browse(self) -> None:
        path, _ = QFileDialog.getSaveFileName(self, "Export WAV", self.path.text(), "WAV (*.wav)")
        if path:
            self.path.setText(path if path.lower().endswith(".wav") else f"{path}.wav")
            self._name_edited()


class BatchPage(QWidget):
    """Positions × amplitudes × presets × sources to a folder.

    Lists of several are remembered; where there is one preset, position or amplitude, it is the present one.
    """

    changed = Signal()

    def __init__(
        self,
        entries: Sequence[PresetEntry],
        choices: Choices,
        export: ExportChoices,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._entries, self._choices = list(entries), choices
        batch = export.batch
        self.presets = QListWidget()
        self.presets.setAccessibleName("Presets")
        self.presets.setToolTip("Space checks and unchecks")
        self.presets.setFixedHeight(128)
        checked = set(batch.presets) if len(batch.presets) > 1 else {choices.preset}
        for entry in self._entries:
            item = QListWidgetItem(entry.title)
            item.setToolTip(plain_tip(entry.path.name))
            item.setCheckState(Qt.CheckState.Checked if entry.name in checked else Qt.CheckState.Unchecked)
            self.presets.addItem(item)
        self.presets.setCurrentRow(next((row for row, e in enumerate(self._entries) if e.name in checked), 0))
        self.what = faint(f"{_shape_text(choices)}, {_heard_text(choices)}{_dry_text(choices)}")
        self.what.setWordWrap(True)
        self.positions = _line("Positions", _several_or(batch.positions, choices.position), "0.1, 0.2, 0.35")
        self.amplitudes = _line("Amplitudes in mm", _several_or(batch.amplitudes, choices.amplitude_mm), "1, 2, 5")
        self.sources = {
            source: QCheckBox(source.capitalize()) for source in SOURCES if not (choices.stereo and source == "both")
        }
        for source, box in self.sources.items():
            box.setMinimumSize(92, 28)
            box.setToolTip({data: text for text, data in SOURCE_NAMES}[source])
            box.setChecked(source in batch.sources)
        self.overwrite = QCheckBox("Overwrite existing files")
        self.overwrite.setToolTip("Off: existing files with the same settings are kept")
        self.folder = _line("Folder", batch.folder or str(Path(export.folder or Path.home()) / "strings"), "")
        browse = tool_button("Browse …", tip="Choose the folder")
        browse.clicked.connect(self._browse)
        place = row_of(browse)
        place.insertWidget(0, self.folder, 100)
        form = QFormLayout(self)
        form.setContentsMargins(0, 12, 0, 0)
        form.addRow(label("Presets"), self.presets)
        form.addRow(label("Plucks"), self.what)
        for name, edit in (("Positions", self.positions), ("Amplitudes, mm", self.amplitudes)):
            several = row_of(faint("comma-separated"))
            several.insertWidget(0, edit, 100)
            form.addRow(label(name), several)
        form.addRow(label("Sources"), row_of(*self.sources.values()))
        form.addRow(label("Folder"), place)
        form.addRow(label(""), row_of(self.overwrite))
        self.presets.itemChanged.connect(self.changed)
        for edit in (self.positions, self.amplitudes, self.folder):
            edit.textChanged.connect(self.changed)
        for box in (*self.sources.values(), self.overwrite):
            box.toggled.connect(self.changed)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.presets.scrollToItem(self.presets.currentItem())

    def choices(self) -> BatchChoices:
        return BatchChoices(
            presets=tuple(entry.name for entry in self._checked()),
            positions=self.positions.text(),
            amplitudes=self.amplitudes.text(),
            sources=tuple(source for source, box in self.sources.items() if box.isChecked()),
            folder=self.folder.text(),
        )

    def plan(self, export: ExportChoices) -> BatchPlan:
        """The batch as chosen. Raises ValueError: positions or amplitudes are no numbers; the message names them."""
        choices = self._choices
        return BatchPlan(
            tuple(entry.path for entry in self._checked()),
            _numbers("positions", self.positions.text()),
            _numbers("amplitudes", self.amplitudes.text()),
            tuple(source for source, box in self.sources.items() if box.isChecked()),
            Path(self.folder.text().strip()),
            export.longest_s if export.until_decayed else export.seconds,
            choices.listen,
            Pluck(shape=choices.shape, width=choices.width),
            choices.listen_right if choices.stereo else None,
            choices.pickup,
            export.difference_gain_db,
            export.decay_db if export.until_decayed else None,
            wav_settings(export),
            self.overwrite.isChecked(),
            self._strings(),
        )

    def _strings(self) -> tuple[NamedString, ...]:
        """The chosen string, where every preset of the batch can play it; else none: presets play their own."""
        string = self._choices.string
        if string is None or any(entry.info.family is None for entry in self._checked()):
            return ()
        return (NamedString(string_word(self._choices).replace(" ", ""), string.parameters),)

    def _checked(self) -> list[PresetEntry]:
        rows = range(self.presets.count())
        return [self._entries[row] for row in rows if self.presets.item(row).checkState() == Qt.CheckState.Checked]

    def _browse(self) -> None:
        if folder := QFileDialog.getExistingDirectory(self, "Folder of the batch", self.folder.text()):
            self.folder.setText(folder)


def _pluck_text(preset: PresetEntry, choices: Choices) -> str:
    pluck = f"{_shape_text(choices)}, at {choices.position:.2f}, {choices.amplitude_mm:g} mm"
    modes = f". All modes, although mode {choices.solo} is soloed" if choices.solo else ""
    string = f", a string of {string_word(choices)}" if choices.string else ""
    return f"{preset.title}{string}: {pluck}, {_heard_text(choices)}{modes}{_dry_text(choices)}"


def _dry_text(choices: Choices) -> str:
    """What of the patch is heard in the window and is not in these files, which are to be compared."""
    patch = choices.instrument
    if not isinstance(patch, Patch):
        return ""
    left_out = "body, room and level" if patch.body.name or patch.room.mix > 0 else "level"
    return f". The string alone, without the {left_out} that {patch.name} gives it"


def _shape_text(choices: Choices) -> str:
    width = "" if choices.shape == "triangular" else f" {choices.width:.3f} wide"
    return f"{shape_word(choices.shape)}{width}"


def _heard_text(choices: Choices) -> str:
    if choices.pickup == "bridge":
        return "heard at the bridge"
    heard = f"heard at {choices.listen:.2f}"
    if choices.stereo:
        heard += f" (left) and {choices.listen_right:.2f} (right)"
    return f"{heard}, velocity" if choices.pickup == "velocity" else heard


def _line(name: str, text: str, example: str) -> QLineEdit:
    edit = QLineEdit(text)
    edit.setAccessibleName(name)
    edit.setToolTip(f"{name}: one or more, comma-separated, for example {example}" if example else name)
    if example:
        edit.setPlaceholderText(f"for example {example}")
    return edit


def _words(text: str) -> list[str]:
    return [word for word in text.replace(";", ",").split(",") if word.strip()]


def _several_or(text: str, present: float) -> str:
    """A list of more than one as it was typed, else the present value."""
    return text if len(_words(text)) > 1 else f"{present:g}"


def _numbers(name: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in _words(text))
    except ValueError as error:
        raise ValueError(f"{name}: comma-separated numbers, not {text!r}") from error
