"""The choice of a patch: previous, next, its name, which opens the browser.

Beside it are save, rename and revert, its macros, body and room. Below them is its state: a
Scala scale, octave and velocity of the computer's keys, the number of voices, and recording.
"""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QPoint, QRect, QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QMenu,
    QSizePolicy,
    QToolButton,
    QToolTip,
    QVBoxLayout,
    QWidget,
)

from app.patches.patch import Macro, Patch
from app.patches.tuning import TuningChoice
from app.shared.parameters import MACROS, OF_PATCHES
from app.views.controls.filter_button import FilterButton
from app.views.controls.knob import Knob
from app.views.controls.name_button import NameButton
from app.views.controls.overflow import Overflow
from app.views.controls.parts import combo_box, faint, tool_button, vertical_rule, words_label
from app.views.controls.plain import Label, SteadyLabel, plain_tip
from engine.plain_text import one_line

BODY_LETTERS = 8  # of the widest title of a body, in the width of an X
ROOMY_MACROS = 6  # more of them are drawn narrow
NARROW_NAME, NARROWEST_NAME = 180, 120  # pixels: the least, and the least with more macros
LONGEST_SCALE_NAME = 120  # characters
SAID_MS = 2_500  # a text that says why the octave stops or moves
SAID_ABOVE = 44  # pixels
COMPARE_TIP = (
    "While this is on, keys play the instrument as it was saved; the knobs keep your changes. Any change ends it"
)
AMP = ("amp.drive_db", "amp.tone_db")
MIXES = (*AMP, "body.mix", "room.mix", "level_db")


class PatchBar(QFrame):
    """Gestures emit signals; setters show what became of them."""

    previous_asked = Signal()
    next_asked = Signal()
    browse_asked = Signal()
    save_asked = Signal()
    rename_asked = Signal()
    revert_asked = Signal()
    compare_asked = Signal(bool)  # whether keys are to play the saved patch
    record_asked = Signal()  # begin or end
    recording_save_asked = Signal()  # one that is not saved yet
    recording_discard_asked = Signal()
    scala_remove_asked = Signal()  # the Scala scale and keyboard mapping of the patch
    all_asked = Signal()  # clear the browser's filter
    octave_asked = Signal(int)  # up or down by so many
    macro_turned = Signal(int, float)  # its number from 0, its value 0 … 1
    changed = Signal(str, float)  # a field of a patch and its new value
    body_chosen = Signal(str)  # its name; "": none
    drag_started = Signal()
    drag_ended = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Patch")
        self._macros: tuple[Macro, ...] = ()
        self._compact = self._tight = False
        self._shows_macros = True
        self._recorded_s: float | None = None
        self._unsaved = 0
        self.knobs = {field: Knob(OF_PATCHES[field]) for field in MIXES}
        for field, knob in self.knobs.items():
            knob.value_asked.connect(lambda value, field=field: self.changed.emit(field, value))
        self.macros = [Knob(macro) for macro in MACROS.values()]
        for number, knob in enumerate(self.macros):
            knob.value_asked.connect(lambda value, number=number: self.macro_turned.emit(number, value))
            knob.hide()
        for knob in (*self.macros, *self.knobs.values()):
            knob.set_low(True)
            knob.set_narrow(True)
            knob.drag_started.connect(self.drag_started)
            knob.drag_ended.connect(self.drag_ended)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        row.addLayout(self._build_words(), 1)
        self._before_macros = vertical_rule()
        self._before_macros.hide()
        row.addWidget(self._before_macros)
        knob_row = QHBoxLayout()
        knob_row.setSpacing(0)
        for knob in self.macros:
            knob_row.addWidget(knob)
        row.addLayout(knob_row)
        row.addWidget(vertical_rule())
        row.addLayout(self._build_sound())

    def _build_words(self) -> QVBoxLayout:
        previous = tool_button("◀", "Previous instrument", "Previous instrument in the browser's list")
        following = tool_button("▶", "Next instrument", "Next instrument in the browser's list")
        for button in (previous, following):
            button.setObjectName("narrow")
        previous.clicked.connect(self.previous_asked)
        following.clicked.connect(self.next_asked)
        self.name = NameButton("No instrument")
        self.name.setToolTip("Browse the instruments")
        self.name.setMinimumWidth(NARROW_NAME)
        self.name.setMaximumWidth(320)
        self.name.clicked.connect(self.browse_asked)
        self.category = Label()
        self.category.setObjectName("badge")
        self.category.setToolTip("The instrument's category")
        self.category.hide()
        self.save = tool_button(
            "Save", "Save the instrument", "Save the instrument; a factory one under a name of your own"
        )
        self.rename = tool_button("Rename …", "Rename the instrument", "Give your instrument another name")
        self.revert = tool_button(
            "Revert",
            "Revert the instrument",
            "Go back to the instrument as it was saved (undo brings your changes back)",
        )
        for button, signal in (
            (self.save, self.save_asked),
            (self.rename, self.rename_asked),
            (self.revert, self.revert_asked),
        ):
            button.setObjectName("small")
            button.setEnabled(False)
            button.clicked.connect(signal)
        self.compare = tool_button("Compare", "Hear the saved instrument", COMPARE_TIP)
        self.compare.setObjectName("small")
        self.compare.setCheckable(True)
        self.compare.setEnabled(False)
        self.compare.clicked.connect(self.compare_asked)
        above = QHBoxLayout()
        above.setSpacing(6)
        for widget in (previous, self.name, following, self.category):
            above.addWidget(widget, 1000 if widget is self.name else 0)
        above.addStretch(1)
        self.more = Overflow("the instrument")
        for button in (self.save, self.rename, self.revert, self.compare, self.more):
            above.addWidget(button)
        column = QVBoxLayout()
        column.setSpacing(4)
        column.addLayout(above)
        column.addLayout(self._build_state())
        return column

    def _build_state(self) -> QHBoxLayout:
        self.filtered = FilterButton("instruments")
        self.filtered.clicked.connect(self.all_asked)
        self.note = words_label()
        self.scala = tool_button("Scala  ✕", "Remove the Scala tuning of the instrument")
        self.scala.setObjectName("solo")
        self.scala.clicked.connect(self.scala_remove_asked)
        self.scala.hide()
        self._lower = lower = tool_button("−", "Octave down", "The computer's keys play an octave lower (Z)")
        self._higher = higher = tool_button("+", "Octave up", "The computer's keys play an octave higher (X)")
        lower.clicked.connect(lambda: self.octave_asked.emit(-1))
        higher.clicked.connect(lambda: self.octave_asked.emit(1))
        self.octave = faint()
        self.octave.setToolTip("The lowest C on the computer's keys; C4 is middle C (Z, X)")
        self.octave.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.velocity = SteadyLabel("velocity 127")
        self.velocity.setObjectName("faint")
        self.velocity.setToolTip("How hard the computer's keys strike, 1 … 127 (1 … 9; C softer, V harder)")
        self.velocity.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.voices = SteadyLabel("0 voices")
        self.voices.setObjectName("faint")
        self.voices.setToolTip("Number of strings that ring")
        self.voices.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.record = QToolButton()
        self.record.setCheckable(True)
        self.record.setObjectName("record")
        self.record.clicked.connect(self.record_asked)
        self._unsaved_menu = QMenu(self.record)
        for words, signal in (
            ("Save the recording …", self.recording_save_asked),
            ("Discard the recording", self.recording_discard_asked),
        ):
            self._unsaved_menu.addAction(words).triggered.connect(lambda _=False, signal=signal: signal.emit())
        for button in (lower, higher):
            button.setObjectName("chip")
        row = QHBoxLayout()
        row.setSpacing(8)
        row.addWidget(self.filtered)
        row.addWidget(self.note, 1)
        for widget in (self.scala, lower, self.octave, higher, self.velocity, self.voices, self.record):
            row.addWidget(widget)
        self.show_octave(3, 3, 3)
        self.show_velocity(90)
        self.show_recording(None)
        self.show_note("")
        return row

    def _build_sound(self) -> QHBoxLayout:
        self.body = combo_box("Body", [("No body", "")])
        self.body.setToolTip("The body of the instrument, which colours the sound of the strings")
        self.body.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.body.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.body.setMinimumContentsLength(BODY_LETTERS)
        self.body.activated.connect(lambda row: self.body_chosen.emit(str(self.body.itemData(row))))
        head = Label("BODY TYPE")
        head.setObjectName("knob")
        column = QVBoxLayout()
        column.setSpacing(3)
        column.addWidget(head, alignment=Qt.AlignmentFlag.AlignHCenter)
        column.addWidget(self.body)
        column.addStretch(1)
        row = QHBoxLayout()
        row.setSpacing(0)
        row.addLayout(column)
        for knob in self.knobs.values():
            row.addWidget(knob)
        return row

    # What is shown

    def set_compact(self, compact: bool, tight: bool = False) -> None:
        """Set the bar for a window with little room; `tight`: with very little."""
        self._compact, self._tight = compact, tight
        self._share_width()

    def _share_width(self) -> None:
        """Show what there is room for; `more` has the rest.

        Where there is very little, a tuning or a sixth macro takes the place of the number of voices.
        """
        many = len(self._macros) > ROOMY_MACROS
        close = self._compact or many
        roomy = self.scala.isHidden() and len(self._macros) < ROOMY_MACROS
        fits: dict[QToolButton | QLabel, bool] = {
            self.rename: not self._tight,
            self.revert: not self._tight,
            self.compare: not self._tight or self.compare.isChecked(),
            self.category: not close,
            self.voices: roomy or not self._tight,
        }
        for part, there in fits.items():
            part.setVisible(there and bool(part.text()))
        self.more.hold(*(part for part, there in fits.items() if not there and part.text()))
        self.name.setMinimumWidth(NARROWEST_NAME if many else NARROW_NAME)
        for knob in self.macros:
            knob.set_narrow(close)

    def set_bodies(self, bodies: Sequence[tuple[str, str]]) -> None:
        """Set the name and the title of each; "No body", of the name "", is always listed."""
        chosen_body = self.body.currentData()
        with QSignalBlocker(self.body):
            self.body.clear()
            for name, title in (("", "No body"), *(body for body in bodies if body[0])):
                self.body.addItem(title, name)
            self._show_body(chosen_body or "")

    def show_patch(self, patch: Patch, own: bool, changed: bool = False) -> None:
        """Show a patch; `own`: it is the user's and can be renamed; `changed`: it differs from the saved one."""
        mark = "●  " if changed else ""
        self.name.setText(f"{mark}{patch.name}   ▾".replace("&", "&&"))
        self.name.setAccessibleName(f"Instrument: {patch.name}{', changed' if changed else ''}")
        tip = f"{patch.name}{' (changed)' if changed else ''}\n{patch.description}".strip()
        self.name.setToolTip(plain_tip(f"{tip}\nClick to browse the instruments"))
        self.category.setText(patch.category)
        self.save.setEnabled(changed)
        self.revert.setEnabled(changed)
        self.compare.setEnabled(changed)
        self.rename.setEnabled(own)
        self._show_macros(patch.macros)
        self._show_scala(patch.tuning)
        self.knobs["amp.drive_db"].set_value(patch.amp.drive_db)
        self.knobs["amp.tone_db"].set_value(patch.amp.tone_db)
        self.knobs["amp.tone_db"].setEnabled(patch.amp.drive_db > 0)
        self.knobs["body.mix"].set_value(patch.body.mix)
        self.knobs["body.mix"].setEnabled(bool(patch.body.name))
        self.knobs["room.mix"].set_value(patch.room.mix)
        self.knobs["level_db"].set_value(patch.level_db)
        with QSignalBlocker(self.body):
            self._show_body(patch.body.name)

    def show_comparing(self, comparing: bool) -> None:
        """Show if keys play the patch as it was saved."""
        self.compare.setChecked(comparing)
        self._share_width()

    def show_macros(self, shown: bool) -> None:
        """Show the macros; else, with all knobs of the string, what they turn: the mixes of body and room."""
        self._shows_macros = shown
        self._share_knobs()

    def _show_macros(self, macros: tuple[Macro, ...]) -> None:
        for number, (knob, macro) in enumerate(zip(self.macros, macros, strict=False)):
            if number >= len(self._macros) or _named(self._macros[number]) != _named(macro):
                knob.set_name(macro.name, f"{macro.name}: changes {', '.join(_named(macro)[1])}")
            knob.set_value(macro.value)
        self._macros = macros
        self._share_knobs()
        self._share_width()

    def _share_knobs(self) -> None:
        """Every value has one knob: a mix that is a macro's only target is that macro's while macros are shown.

        The amplifier's stand with the string's.
        """
        for number, knob in enumerate(self.macros):
            knob.setVisible(self._shows_macros and number < len(self._macros))
        self._before_macros.setVisible(self._shows_macros and bool(self._macros))
        alone = {macro.targets[0].field for macro in self._macros if len(macro.targets) == 1}
        for field, knob in self.knobs.items():
            knob.setVisible(not (self._shows_macros and (field in alone or field in AMP)))

    def _show_scala(self, tuning: TuningChoice) -> None:
        """Show the part of Scala that tunes the patch; a click removes it."""
        scale, keymap = bool(tuning.scale.strip()), bool(tuning.keymap.strip())
        self.scala.setVisible(scale or keymap)
        self._share_width()
        lines = [f"Tuned by the Scala scale: {_scale_name(tuning.scale) or 'without a name'}"] if scale else []
        if keymap:
            lines.append("A Scala keyboard mapping says which key plays which step, and gives the reference pitch")
        self.scala.setToolTip(plain_tip("\n".join([*lines, "Click to go back to twelve equal steps"])))

    def _show_body(self, name: str) -> None:
        row = self.body.findData(name)
        if row < 0:  # its file is missing
            self.body.addItem(name, name)
            row = self.body.count() - 1
        self.body.setCurrentIndex(row)

    def show_voices(self, voices: int, most: int | None = None) -> None:
        """Show the number of voices that ring, and the most that may."""
        of = f" of {most}" if most is not None else ""
        self.voices.setText(f"{voices}{of} voice{'' if voices == 1 and not of else 's'}")

    def show_octave(self, octave: int, lowest: int, highest: int) -> None:
        """Show the octave of the lowest of the computer's keys, of those at which a key sounds."""
        self.octave.setText(f"octave C{octave}")
        self._lower.setEnabled(octave > lowest)
        self._higher.setEnabled(octave < highest)

    def say_octave(self, text: str) -> None:
        """Show above the octave, for SAID_MS, why it is what it is."""
        if self.octave.isVisible():
            place = self.octave.mapToGlobal(QPoint(0, -SAID_ABOVE))
            QToolTip.showText(place, plain_tip(text), self.octave, QRect(), SAID_MS)

    def show_velocity(self, velocity: int) -> None:
        """Show the velocity with which the computer's keys strike."""
        self.velocity.setText(f"velocity {velocity}")

    def show_pitches(self, pitches: bool) -> None:
        """Show octave and velocity if the computer's keys play pitches."""
        for widget in (self._lower, self.octave, self._higher, self.velocity):
            widget.setVisible(pitches)

    def show_recording(self, seconds: float | None) -> None:
        """Show the seconds that it has been recording; None: it is not."""
        self._recorded_s = seconds
        self._show_record()

    def show_unsaved(self, recordings: int) -> None:
        """Show the number of recordings that wait to be saved.

        While any does, the button saves or discards the latest.
        """
        self._unsaved = recordings
        self._show_record()

    def _show_record(self) -> None:
        seconds, button = self._recorded_s, self.record
        on, waits = seconds is not None, seconds is None and self._unsaved > 0
        button.setChecked(on)
        if seconds is not None:
            text = f"■  {int(seconds) // 60}:{int(seconds) % 60:02d}"
            name, tip = "End recording", "End the recording and save it"
        elif waits:
            text, name = "●  Unsaved  ▾", "Recording that is not saved"
            tip = "What was played is not saved yet: save it, or discard it to record again"
        else:
            text = "●  Record"
            name = "Record what is played"
            tip = "Record what is played"
        button.setText(text)
        button.setAccessibleName(name)
        button.setToolTip(tip)
        modes = QToolButton.ToolButtonPopupMode
        button.setPopupMode(modes.InstantPopup if waits else modes.DelayedPopup)
        button.setMenu(self._unsaved_menu if waits else None)  # type: ignore[arg-type]

    def show_note(self, text: str) -> None:
        """Show the thing that is missing; "" for nothing."""
        self.note.say(text)
        self.note.setToolTip(plain_tip(text))


def _scale_name(scale: str) -> str:
    """The name of a scale: the first line of a .scl file's text that is no comment.

    It is "" where that line is empty.
    """
    lines = (line for line in scale.splitlines() if not line.startswith("!"))
    return one_line(next(lines, ""), LONGEST_SCALE_NAME)


def _named(macro: Macro) -> tuple[str, list[str]]:
    """The name of a macro, and its targets in words."""
    return macro.name, [OF_PATCHES[target.field].name for target in macro.targets]
