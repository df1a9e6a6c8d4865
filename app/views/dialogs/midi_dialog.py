"""MIDI: which input, what notes do, and which controller sets what. It stays open while notes are played."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QDialog,
    QFormLayout,
    QGridLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.views.controls.parts import combo_box
from app.views.controls.plain import Label

NOTE_MODES = (
    ("Play pitches of the patch", "pitch"),
    ("Set pluck position", "position"),
    ("Select preset", "preset"),
)


class MidiDialog(QDialog):
    """Gestures emit signals; `show_…` shows what became of them.

    Args:
        turned: the names of what a controller can turn, by field of `Choices`.
    """

    port_chosen = Signal(str)  # "": none
    notes_chosen = Signal(str)
    learn_asked = Signal(str)  # a field
    forget_asked = Signal(str)

    def __init__(self, turned: Mapping[str, str], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("MIDI")
        self.setMinimumWidth(460)
        self._inputs = combo_box("MIDI input", [])
        self._inputs.activated.connect(lambda row: self.port_chosen.emit(self._inputs.itemData(row)))
        self._notes = combo_box("Function of notes", NOTE_MODES)
        self._notes.setToolTip("Velocity always sets how hard the string is plucked")
        self._notes.activated.connect(lambda row: self.notes_chosen.emit(self._notes.itemData(row)))
        self._problem = Label()
        self._problem.setObjectName("warning")
        self._problem.setWordWrap(True)
        self._problem.setTextInteractionFlags(
            Qt.TextInteractionFlag.TextSelectableByMouse | Qt.TextInteractionFlag.TextSelectableByKeyboard
        )
        self._turned = turned
        self._rows: dict[str, tuple[QLabel, QPushButton, QPushButton]] = {}
        form = QFormLayout()
        for name, box in (("Input", self._inputs), ("Notes", self._notes)):
            label = Label(name)
            label.setMinimumHeight(box.sizeHint().height())  # so that it is level with its box
            form.addRow(label, box)
        column = QVBoxLayout(self)
        column.setContentsMargins(18, 16, 18, 16)
        column.setSpacing(12)
        column.addLayout(form)
        column.addWidget(self._problem)
        heading = Label("CONTROLLERS")
        heading.setObjectName("faint")
        column.addWidget(heading)
        column.addLayout(self._build_rows(turned))
        close = QPushButton("Close")
        close.setAutoDefault(False)
        close.clicked.connect(self.reject)
        column.addWidget(close, alignment=Qt.AlignmentFlag.AlignRight)
        self.set_learnable("")

    def _build_rows(self, turned: Mapping[str, str]) -> QGridLayout:
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        grid.setVerticalSpacing(6)
        for row, (field, label) in enumerate(turned.items()):
            taught = Label()
            learn, forget = QPushButton("Learn"), QPushButton("Forget")
            learn.setCheckable(True)
            learn.setAccessibleName(f"Assign a controller to {label}")
            forget.setAccessibleName(f"Unassign {label}")
            forget.setToolTip(f"Unassign {label}")
            for button, asked in ((learn, self.learn_asked), (forget, self.forget_asked)):
                button.setAutoDefault(False)
                button.clicked.connect(lambda _=False, asked=asked, field=field: asked.emit(field))
            for place, widget in enumerate((Label(label[:1].upper() + label[1:]), taught, learn, forget)):
                grid.addWidget(widget, row, place)
            self._rows[field] = taught, learn, forget
        return grid

    def show_inputs(self, names: list[str], open_name: str, problem: str) -> None:
        """The inputs that are connected, and the one that is open; `problem`: why there are none."""
        with QSignalBlocker(self._inputs):
            self._inputs.clear()
            self._inputs.addItem("None" if names else "No MIDI input found", "")
            for name in names:
                self._inputs.addItem(name, name)
            self._inputs.setCurrentIndex(max(0, self._inputs.findData(open_name)))
        self._inputs.setEnabled(bool(names))
        self.show_problem(problem)

    def set_learnable(self, why_not: str) -> None:
        """`why_not`: why no controller can be assigned, with the remedy; "" where one can."""
        for field, (_, learn, _) in self._rows.items():
            learn.setEnabled(not why_not)
            learn.setToolTip(why_not or f"Click, then move a control to assign it to {self._turned[field]}")

    def show_problem(self, text: str) -> None:
        self._problem.setText(text)
        self._problem.setVisible(bool(text))

    def show_choices(self, notes: str, controllers: Mapping[str, int], learning: str | None) -> None:
        """What notes do, the numbers of controllers by field, and the field that waits for one."""
        self._notes.setCurrentIndex(max(0, self._notes.findData(notes)))
        for field, (taught, learn, forget) in self._rows.items():
            waits, number = field == learning, controllers.get(field)
            taught.setText("Move a control …" if waits else "–" if number is None else f"Controller {number}")
            taught.setObjectName("" if waits or number is not None else "faint")
            taught.style().polish(taught)
            learn.setChecked(waits)
            forget.setEnabled(number is not None)
