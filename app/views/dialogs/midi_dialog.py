"""MIDI: which input, what notes do, and which controller sets what. It stays open while notes are played."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from PySide6.QtCore import QMargins, Signal
from PySide6.QtWidgets import QComboBox, QDialog, QGridLayout, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.instruments.instrument import Instrument
from app.playing.midi import MidiChoices
from app.shared.parameters import LEARNABLE, modulated_by
from app.views.controls.form import Form
from app.views.controls.parts import combo_box, faint, filled, label, push_button, refill, scrolled, show_kind
from app.views.controls.plain import Label
from engine.parameters import OF_INSTRUMENTS

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
CHANNELS_TIP = "Whether the MIDI channel of a note says on which string it is played"
WHEEL_TIP = "What the modulation wheel changes while you play"
OF_THE_INSTRUMENT = "It belongs to the instrument and is saved with it"


class MidiDialog(QDialog):
    """Gestures emit signals; `show_…` shows what became of them.

    To learn is to assign a MIDI controller to a field, a knob of instrument or window: the next one that is moved.
    """

    port_chosen = Signal(str)  # "": none
    notes_chosen = Signal(str)
    learn_asked = Signal(str)  # a field
    forget_asked = Signal(str)
    instrument_turned = Signal(str, object)  # a field of the instrument, and its value

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("MIDI")
        self.setMinimumWidth(460)
        tip = "The MIDI keyboard, or the port of another program, whose notes are played"
        self._inputs = combo_box("MIDI input", [], tip=tip, picked=self.port_chosen.emit)
        tip = "Velocity always sets how hard the string is plucked"
        self._notes = combo_box("MIDI notes control", NOTE_MODES, tip=tip, picked=self.notes_chosen.emit)
        turnable = [(_capital(knob.name), knob.id) for knob in modulated_by("wheel")]
        self._of_instrument: dict[str, QComboBox] = {}  # field of the instrument -> its box
        for field, name, entries, tip in (
            ("mode", "Channels", CHANNELS, CHANNELS_TIP),
            ("bend_semitones", "Bend range", map(_bend, BENDS), OF_INSTRUMENTS["bend_semitones"].tip),
            ("bend_by", "Pitch bend changes", BENDS_BY, BEND_TIP),
            ("mod_wheel", "Modulation wheel", (("Nothing", "none"), *turnable), WHEEL_TIP),
        ):
            picked = partial(self.instrument_turned.emit, field)
            self._of_instrument[field] = combo_box(name, entries, tip=f"{tip}.\n{OF_THE_INSTRUMENT}", picked=picked)
        self._problem = label("warning", selectable=True)
        self._rows: dict[str, tuple[QLabel, QPushButton, QPushButton]] = {}  # field -> its controller, Learn, Forget
        form = Form()
        for box in (self._inputs, self._notes, *self._of_instrument.values()):
            form.row("Input" if box is self._inputs else box.accessibleName(), box)
        rows = QWidget()
        rows.setLayout(self._build_rows())
        close = push_button("Close", "Close the dialog; MIDI plays on (Escape)", pressed=self.reject)
        last = filled(QHBoxLayout(), None, close)
        parts = form, self._problem, faint("CONTROLLERS"), scrolled(rows), last
        column = filled(QVBoxLayout(self), *parts, spacing=12, margins=QMargins(18, 16, 18, 16))
        column.setStretch(3, 1)
        self.show_inputs([], "", "")

    def _build_rows(self) -> QGridLayout:
        """Build a row for each field of LEARNABLE: its name, its controller, and buttons to learn or forget it."""
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        grid.setVerticalSpacing(6)
        for row, field in enumerate(LEARNABLE):
            name = _learnable_name(field)
            taught = Label()
            learn = push_button("Learn", name=f"Assign a controller to {name}", checkable=True)
            forget = push_button("Forget", f"Unassign {name}", f"Unassign {name}")
            for button, signal in ((learn, self.learn_asked), (forget, self.forget_asked)):
                button.clicked.connect(lambda _=False, signal=signal, field=field: signal.emit(field))
            for place, widget in enumerate((Label(_capital(name)), taught, learn, forget)):
                grid.addWidget(widget, row, place)
            self._rows[field] = taught, learn, forget
        return grid

    def show_inputs(self, names: Sequence[str], open_name: str, problem: str) -> None:
        """Show the inputs that are connected, and the one that is open; `problem`: why nothing can be, or ""."""
        none = "None" if names else "No MIDI input found"
        refill(self._inputs, [(none, ""), *((name, name) for name in names)], open_name)
        self._inputs.setEnabled(bool(names))
        self.show_problem(problem)
        for field, (_, learn, _) in self._rows.items():
            learn.setEnabled(not problem)
            learn.setToolTip(problem or f"Click, then move a control to assign it to {_learnable_name(field)}")

    def show_instrument(self, instrument: Instrument | None) -> None:
        """Show the use that the played instrument makes of channels and wheels; None: there is none."""
        for field, box in self._of_instrument.items():
            box.setEnabled(instrument is not None)
            if instrument is not None:
                value = getattr(instrument, field)
                if field == "bend_semitones" and box.findData(value) < 0:
                    box.addItem(*_bend(value))
                box.setCurrentIndex(max(0, box.findData(value)))

    def show_problem(self, text: str) -> None:
        self._problem.setText(text)
        self._problem.setVisible(bool(text))

    def show_choices(self, choices: MidiChoices, learning: str | None) -> None:
        """Show what notes do, the controllers, and the field that waits for one."""
        self._notes.setCurrentIndex(max(0, self._notes.findData(choices.notes)))
        for field, (taught, learn, forget) in self._rows.items():
            waits, number = field == learning, choices.controllers.get(field)
            taught.setText("Move a control …" if waits else "–" if number is None else f"Controller {number}")
            show_kind(taught, "" if waits or number is not None else "faint")
            learn.setChecked(waits)
            forget.setEnabled(number is not None)


def _bend(semitones: float) -> tuple[str, float]:
    return f"± {semitones:g} semitone{'' if semitones == 1 else 's'}", semitones


def _learnable_name(field: str) -> str:
    name = LEARNABLE[field].name
    return f"instrument: {name}" if field in OF_INSTRUMENTS else name


def _capital(name: str) -> str:
    return name[:1].upper() + name[1:]
