"""A dialog's form: rows of controls, each declared once with the field of choices that it stands for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from PySide6.QtCore import Qt, Signal, SignalInstance
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QSizePolicy,
    QWidget,
)

from app.views import theme
from app.views.controls.number_box import CountBox, NumberBox
from app.views.controls.parts import NO_MARGINS, combo_box, filled, tool_button
from app.views.controls.plain import Label
from app.views.file_places import FileKind, FilePlaces

Part = TypeVar("Part", bound=QWidget)
LABEL_WIDTH = 104  # pixels, at least
FILTERS = {
    ".wav": "WAV (*.wav)",
    ".flac": "FLAC (*.flac)",
    ".sfz": "SFZ (*.sfz)",
    ".sf2": "SoundFont 2 (*.sf2)",
    ".clap": "CLAP (*.clap)",
    ".vst3": "VST3 (*.vst3)",
    ".lv2": "LV2 (*.lv2)",
    ".png": "PNG (*.png)",
    ".svg": "SVG (*.svg)",
    ".csv": "CSV (*.csv)",
}


class Form(QWidget):
    """Rows of controls under names of one width. The control of a field is `form[field]`.

    Args:
        choices: has the values that controls begin with, by field.
        tips: of the controls, by field.
    """

    changed = Signal()  # a control

    def __init__(self, choices: object = None, tips: Mapping[str, str] | None = None) -> None:
        super().__init__()
        self._choices, self._tips = choices, tips or {}
        self._controls: dict[str, Any] = {}  # by field
        self.rows = QFormLayout(self)
        self.rows.setContentsMargins(NO_MARGINS)
        self.rows.setLabelAlignment(Qt.AlignmentFlag.AlignRight)

    def __getitem__(self, field: str) -> Any:
        return self._controls[field]

    def row(self, name: str, *parts: QWidget | None) -> QHBoxLayout:
        """Add a row of parts side by side. A text or a file takes the room that is left; None is empty space."""
        row = row_of(*parts)
        title = Label(name, minimumHeight=28, minimumWidth=theme.px(LABEL_WIDTH))
        title.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.rows.addRow(title, row)
        return row

    def combo(self, field: str, name: str, entries: Iterable[tuple[str, object]]) -> QComboBox:
        box = combo_box(name, entries, getattr(self._choices, field, None), self._tips[field])
        return self._known(field, box, box.currentIndexChanged)

    def check(self, field: str, text: str) -> QCheckBox:
        box = check_box(text, getattr(self._choices, field), self._tips[field])
        return self._known(field, box, box.toggled)

    def number(self, field: str, name: str, limits: tuple[float, float], *form: Any, **more: Any) -> NumberBox:
        """A field for a number; `form` and `more` as of `NumberBox`."""
        box = NumberBox(name, limits, getattr(self._choices, field, 0), self._tips[field], *form, **more)
        return self._known(field, box, box.valueChanged)

    def count(self, field: str, name: str, most: int) -> CountBox:
        box = CountBox(name, most, getattr(self._choices, field), self._tips[field])
        return self._known(field, box, box.valueChanged)

    def file_picker(self, places: FilePlaces, kind: FileKind) -> FilePicker:
        """The choice of the file that is written, which is no field."""
        picker = FilePicker(places, kind, self._tips["file"])
        picker.changed.connect(self.changed)
        return picker

    def values(self) -> dict[str, Any]:
        """The values of all controls, by field."""
        return {field: value_of(control) for field, control in self._controls.items()}

    def _known(self, field: str, control: Part, change: SignalInstance) -> Part:
        self._controls[field] = control
        change.connect(self.changed)
        return control


def value_of(control: QWidget) -> Any:
    """The value that is chosen in a control of a form."""
    if isinstance(control, QComboBox):
        return control.currentData()
    return control.isChecked() if isinstance(control, QCheckBox) else control.value()  # type: ignore[attr-defined]


def row_of(*parts: QWidget | None) -> QHBoxLayout:
    """Side by side, as `Form.row`; with empty space at the end where nothing takes it."""
    row = filled(QHBoxLayout(), *parts, margins=NO_MARGINS)
    takers = [part for part in parts if part is None or _takes_room(part)]
    for part in takers:
        if part is not None:
            row.setStretchFactor(part, 1)
    if not takers:
        row.addStretch(1)
    return row


def _takes_room(part: QWidget) -> bool:
    expands = part.sizePolicy().horizontalPolicy() == QSizePolicy.Policy.Expanding
    return expands or (isinstance(part, QLabel) and part.wordWrap())


def check_box(text: str, on: bool, tip: str) -> QCheckBox:
    box = QCheckBox(text)
    box.setChecked(on)
    box.setMinimumHeight(28)
    box.setToolTip(tip)
    return box


class FilePicker(QWidget):
    """The path of a file that will be written; a name is suggested until the user gives one.

    Attributes:
        places, kind: where it is suggested.
        suffix: of the file, one of FILTERS, which a name without it gets; "": it is a folder.
    """

    changed = Signal()

    def __init__(self, places: FilePlaces, kind: FileKind, tip: str, suffix: str = ".wav") -> None:
        super().__init__()
        self.places, self.kind = places, kind
        self.suffix = suffix
        self._named_by_user = False  # so that no name is suggested any more
        self.edit = QLineEdit()
        self.edit.setAccessibleName("File")
        self.edit.setToolTip(tip)
        self.edit.textEdited.connect(self._name_edited)
        row = row_of(tool_button("Browse …", tip="Choose the file", pressed=self.browse))
        row.insertWidget(0, self.edit, 100)
        self.setLayout(row)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)

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
            self.edit.setText(str(self.places.folder(self.kind) / name))
        elif Path(typed).suffix.lower() in FILTERS:
            self.edit.setText(str(Path(typed).with_suffix(self.suffix)))

    def browse(self) -> None:
        """Ask for the file, or for the folder in which one of the present name is made; nothing if cancelled."""
        named = Path(self.edit.text().strip()).name
        path: Path | None
        if self.suffix:
            suggested = self.path if named else Path(f"untitled{self.suffix}")
            path = self.places.ask_to_save(self, self.kind, "Save as", FILTERS[self.suffix], suggested)
        else:  # a folder that is made in the chosen one
            folder = self.places.ask_folder(self, self.kind, "Save in")
            path = folder and folder / named
        if path is not None:
            self.edit.setText(str(path))
            self._name_edited()

    def _name_edited(self) -> None:
        self._named_by_user = True
        self.changed.emit()
