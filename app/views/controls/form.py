"""Parts of a dialog's form: labels of one width, rows, number boxes, and the choice of a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from PySide6.QtCore import QStandardPaths, Qt, Signal
from PySide6.QtWidgets import QCheckBox, QFileDialog, QFormLayout, QHBoxLayout, QLayout, QLineEdit, QWidget

from app.views import theme
from app.views.controls.parts import NO_MARGINS, filled, tool_button
from app.views.controls.plain import Label

Rows = Mapping[str, QWidget | QLayout]
LABEL_WIDTH = 104
FILTERS = {
    ".wav": "WAV (*.wav)",
    ".sfz": "SFZ (*.sfz)",
    ".sf2": "SoundFont 2 (*.sf2)",
    ".clap": "CLAP (*.clap)",
    ".vst3": "VST3 (*.vst3)",
    ".lv2": "LV2 (*.lv2)",
}


def filled_form(form: QFormLayout, rows: Rows) -> QFormLayout:
    """The form with rows, by their labels; all are of one width, so that the forms of a dialog are aligned."""
    form.setContentsMargins(NO_MARGINS)
    for name, row in rows.items():
        title = Label(name, minimumHeight=28)
        title.setFixedWidth(theme.px(LABEL_WIDTH))
        title.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        form.addRow(title, row)
    return form


def row_of(*widgets: QWidget) -> QHBoxLayout:
    """Side by side, with empty space at the end."""
    return filled(QHBoxLayout(), *widgets, None, margins=NO_MARGINS)


def check_box(text: str, on: bool, tip: str) -> QCheckBox:
    box = QCheckBox(text)
    box.setChecked(on)
    box.setMinimumHeight(28)
    box.setToolTip(tip)
    return box


class FilePicker(QWidget):
    """The path of a file that will be written; a name is suggested until the user gives one.

    Attributes:
        suffix: of the file, one of FILTERS; a name without it gets it.
    """

    changed = Signal()

    def __init__(self, folder: str, tip: str, suffix: str = ".wav") -> None:
        super().__init__()
        music = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.MusicLocation)
        self._folder = folder or (music if music and Path(music).is_dir() else str(Path.home()))
        self.suffix = suffix
        self._named_by_user = False
        self.edit = QLineEdit()
        self.edit.setAccessibleName("File")
        self.edit.setToolTip(tip)
        self.edit.textEdited.connect(self._name_edited)
        row = row_of(tool_button("Browse …", tip="Choose the file", pressed=self.browse))
        row.insertWidget(0, self.edit, 100)
        self.setLayout(row)

    @property
    def folder(self) -> str:
        return str(Path(self.edit.text().strip()).parent)

    def follow(self, folder: str) -> None:
        """Suggest names in this folder from now on, where another file was saved; keep a name that was given."""
        self._folder = folder
        typed = self.edit.text().strip()
        if typed:
            self.edit.setText(str(Path(folder) / Path(typed).name))

    @property
    def path(self) -> Path:
        """Raise ValueError: no name is given."""
        path = Path(self.edit.text().strip())
        if not path.name:
            raise ValueError("file: choose where it is written")
        return path if path.suffix.lower() == self.suffix else path.with_name(path.name + self.suffix)

    def suggest(self, name: str) -> None:
        """Set a name with its suffix, unless the user has given one; that gets the suffix of the format."""
        typed = self.edit.text().strip()
        if not self._named_by_user:
            self.edit.setText(str(Path(self._folder) / name))
        elif Path(typed).suffix.lower() in FILTERS:
            self.edit.setText(str(Path(typed).with_suffix(self.suffix)))

    def browse(self) -> None:
        path, _ = QFileDialog.getSaveFileName(self, "Save as", self.edit.text(), FILTERS[self.suffix])
        if path:
            self.edit.setText(path)
            self.edit.setText(str(self.path))
            self._name_edited()

    def _name_edited(self) -> None:
        self._named_by_user = True
        self.changed.emit()
