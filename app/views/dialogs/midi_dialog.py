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

from app.shared.parameters import OF_PATCHES
from app.views.controls.parts import combo_box, faint, label, push_button, scrolled
from app.views.controls.plain import Label

NOTE_MODES = (
    ("Notes of the instrument", "pitch"),
    ("Pluck position", "position"),
    ("Preset", "preset"),
)
CHANNELS = (("Any channel plays any key", "poly"), ("Guitar: one channel per string", "guitar"), ("MPE", "mpe"))
BENDS_BY = (
    ("Tension: the string is pulled tighter", "tension"),
    ("Length: a slide along the string", "length"),
)
BENDS = (1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 12.0, 24.0, 48.0)  # semitones
BEND_TIP = (
    "How the pitch wheel bends: a string that is pulled tighter, as by a finger on a guitar, keeps its length;\n"
    "one that is made shorter or longer, as by a slide, keeps its tension. They sound different"
)
OF_THE_PATCH = "It belongs to the instrument and is saved with it"


class MidiDialog(QDialog):
    """Gestures emit signals; `show_…` shows what became of them.

    Args:
        turned: the names of what a controller can turn, by the id of its parameter.
        wheel: names of what the modulation wheel can turn, by field of a patch.
    """

    port_chosen = Signal(str)  # "": none
    notes_chosen = Signal(str)
    learn_asked = Signal(str)  # a field
    forget_asked = Signal(str)
    patch_turned = Signal(str, object)  # a field of the patch, and its value

    def __init__(self, names: Mapping[str, str], wheel: Mapping[str, str], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("MIDI")
        self.setMinimumWidth(460)
        self._inputs = combo_box("MIDI input", [])
        self._inputs.setToolTip("The MIDI keyboard, or the port of another program, whose notes are played")
        self._inputs.activated.connect(lambda row: self.port_chosen.emit(self._inputs.itemData(row)))
        self._notes = combo_box("MIDI notes control", NOTE_MODES)
        self._notes.setToolTip("Velocity always sets how hard the string is plucked")
        self._notes.activated.connect(lambda row: self.notes_chosen.emit(self._notes.itemData(row)))
        self._channels = combo_box("Channels", CHANNELS)
        self._bends = combo_box("Bend range", [(_semitones(semitones), semitones) for semitones in BENDS])
        turnable = [(name[:1].upper() + name[1:], field) for field, name in wheel.items()]
        self._wheel = combo_box("Modulation wheel", [("Nothing", "none"), *turnable])
        self._bends_by = combo_box("Pitch bend changes", BENDS_BY)
        for box, field, tip in (
            (self._channels, "mode", "Whether the MIDI channel of a note says on which string it is played"),
            (self._bends, "bend_semitones", OF_PATCHES["bend_semitones"].tip),
            (self._bends_by, "bend_by", BEND_TIP),
            (self._wheel, "mod_wheel", "What the modulation wheel changes while you play"),
        ):
            box.setToolTip(f"{tip}.\n{OF_THE_PATCH}")
            box.activated.connect(lambda row, box=box, field=field: self.patch_turned.emit(field, box.itemData(row)))
        self._problem = label("warning", selectable=True)
        self._turned = names
        self._rows: dict[str, tuple[QLabel, QPushButton, QPushButton]] = {}
        form = QFormLayout()
        for name, box in (
            ("Input", self._inputs),
            ("MIDI notes control", self._notes),
            ("Channels", self._channels),
            ("Bend range", self._bends),
            ("Pitch bend changes", self._bends_by),
            ("Modulation wheel", self._wheel),
        ):
            title = Label(name)
            title.setMinimumHeight(box.sizeHint().height())  # so that it is level with its box
            form.addRow(title, box)
        column = QVBoxLayout(self)
        column.setContentsMargins(18, 16, 18, 16)
        column.setSpacing(12)
        column.addLayout(form)
        column.addWidget(self._problem)
        column.addWidget(faint("CONTROLLERS"))
        rows = QWidget()
        rows.setLayout(self._build_rows(names))
        column.addWidget(scrolled(rows), stretch=1)
        close = push_button("Close", "Close the dialog; MIDI plays on (Escape)")
        close.clicked.connect(self.reject)
        column.addWidget(close, alignment=Qt.AlignmentFlag.AlignRight)
        self.set_learnable("")

    def _build_rows(self, names: Mapping[str, str]) -> QGridLayout:
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        grid.setVerticalSpacing(6)
        for row, (field, name) in enumerate(names.items()):
            taught = Label()
            learn, forget = push_button("Learn"), push_button("Forget", f"Unassign {name}")
            learn.setCheckable(True)
            learn.setAccessibleName(f"Assign a controller to {name}")
            forget.setAccessibleName(f"Unassign {name}")
            for button, signal in ((learn, self.learn_asked), (forget, self.forget_asked)):
                button.clicked.connect(lambda _=False, signal=signal, field=field: signal.emit(field))
            for place, widget in enumerate((Label(name[:1].upper() + name[1:]), taught, learn, forget)):
                grid.addWidget(widget, row, place)
            self._rows[field] = taught, learn, forget
        return grid

    def show_inputs(self, names: list[str], open_name: str, problem: str) -> None:
        """Show the inputs that are connected, and the one that is open; `problem`: why there are none."""
        with QSignalBlocker(self._inputs):
            self._inputs.clear()
            self._inputs.addItem("None" if names else "No MIDI input found", "")
            for name in names:
                self._inputs.addItem(name, name)
            self._inputs.setCurrentIndex(max(0, self._inputs.findData(open_name)))
        self._inputs.setEnabled(bool(names))
        self.show_problem(problem)

    def show_patch(self, mode: str, bend_semitones: float, bend_by: str, mod_wheel: str) -> None:
        """Show the use that the played patch makes of channels and wheels."""
        if self._bends.findData(bend_semitones) < 0:
            self._bends.addItem(_semitones(bend_semitones), bend_semitones)
        for box, value in (
            (self._channels, mode),
            (self._bends, bend_semitones),
            (self._bends_by, bend_by),
            (self._wheel, mod_wheel),
        ):
            box.setCurrentIndex(max(0, box.findData(value)))

    def set_patch_turnable(self, turnable: bool) -> None:
        """Enable the controls of the patch if there is one to play."""
        for box in (self._channels, self._bends, self._bends_by, self._wheel):
            box.setEnabled(turnable)

    def set_learnable(self, why_not: str) -> None:
        """Show why no controller can be assigned, with the remedy; "" where one can."""
        for field, (_, learn, _) in self._rows.items():
            learn.setEnabled(not why_not)
            learn.setToolTip(why_not or f"Click, then move a control to assign it to {self._turned[field]}")

    def show_problem(self, text: str) -> None:
        self._problem.setText(text)
        self._problem.setVisible(bool(text))

    def show_choices(self, notes: str, controllers: Mapping[str, int], learning: str | None) -> None:
        """Show what notes do, the numbers of controllers by field, and the field that waits for one."""
        self._notes.setCurrentIndex(max(0, self._notes.findData(notes)))
        for field, (taught, learn, forget) in self._rows.items():
            waits, number = field == learning, controllers.get(field)
            taught.setText("Move a control …" if waits else "–" if number is None else f"Controller {number}")
            taught.setObjectName("" if waits or number is not None else "faint")
            taught.style().polish(taught)
            learn.setChecked(waits)
            forget.setEnabled(number is not None)


def _semitones(count: float) -> str:
    return f"± {count:g} semitone{'' if count == 1 else 's'}"
