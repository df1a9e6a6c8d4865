"""The choice of an instrument: previous, next, its name, which opens the browser.

Beside it are save, rename and revert, its macros, body and room. Below them is its state: a
Scala scale, octave and velocity of the computer's keys, the number of voices, and recording.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QLabel,
    QMenu,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
)

from app.instruments.instrument import Instrument, Macro
from app.instruments.scales import SCALES
from app.instruments.tuning import TuningChoice
from app.shared.parameters import MACROS
from app.views.controls.choosers import ChoiceBar
from app.views.controls.knob import NARROW_WIDTH, Knob
from app.views.controls.number_box import say_above
from app.views.controls.overflow import Overflow
from app.views.controls.parts import (
    NO_MARGINS,
    combo_box,
    faint,
    filled,
    refill,
    show_kind,
    tool_button,
    vertical_rule,
    words_label,
)
from app.views.controls.plain import Label, SteadyLabel, plain_tip
from app.views.instrument.takes_menu import TakesMenu
from engine.parameters import OF_INSTRUMENTS
from engine.plain_text import one_line

BODY_LETTERS = 8  # width of the box of bodies, in letters X
ROOMY_MACROS = 6  # with more, knobs are narrow; with six or more, a tight bar has no number of voices
NARROW_NAME, NARROWEST_NAME = 180, 120  # pixels: least width of the name; with more than ROOMY_MACROS
LONGEST_SCALE_NAME = 120  # characters
SCALE_LETTERS, TIGHT_LETTERS = 18, 8  # most of the scale's name on its button; in a tight bar
EQUAL_STEPS = "Twelve equal steps"
INSTANT = QToolButton.ToolButtonPopupMode.InstantPopup
SAID_MS = 2_500  # a text that says why the octave stops or moves
COMPARE_TIP = (
    "While this is on, keys play the instrument as it was saved; the knobs keep your changes. Any change ends it"
)
AMP = ("amp.drive_db", "amp.tone_db")
MIXES = (*AMP, "body.mix", "room.mix", "level_db")


class InstrumentBar(ChoiceBar):
    """Gestures emit signals; setters show what became of them.

    A macro is a knob of the instrument's own, which turns one or more of its fields. An instrument is tuned where it
    has a Scala scale or a keyboard mapping.
    """

    save_asked = Signal()
    rename_asked = Signal()
    revert_asked = Signal()
    compare_asked = Signal(bool)  # whether keys are to play the saved instrument
    record_asked = Signal()  # begin or end
    scale_asked = Signal(str)  # one of SCALES; "": twelve equal steps, without a keyboard mapping
    scala_file_asked = Signal()
    octave_asked = Signal(int)  # up or down by so many
    macro_turned = Signal(int, float)  # its number from 0, its value 0 … 1
    changed = Signal(str, float)  # a field of an instrument and its new value
    body_chosen = Signal(str)  # its name; "": none

    def __init__(self) -> None:
        super().__init__("instrument", "No instrument")
        self.setAccessibleName("Instrument")
        self._macros: tuple[Macro, ...] = ()  # of the instrument that is shown
        # compact: little width; tight: even less, which is compact too; tuned: by a Scala scale or keyboard mapping
        self._compact = self._tight = self._tuned = False
        self._words: tuple[object, ...] = ()  # what is shown by `_show_words`; empty: nothing is
        self._comparing = False  # whether keys play the instrument as it was saved
        self._shows_macros = True  # False: all knobs of the string are shown in their place
        self.knobs = {field: Knob(OF_INSTRUMENTS[field], width=NARROW_WIDTH, low=True) for field in MIXES}
        for field, knob in self.knobs.items():
            knob.value_asked.connect(partial(self.changed.emit, field))
        self.macros = [Knob(macro, width=NARROW_WIDTH, low=True) for macro in MACROS.values()]
        for number, knob in enumerate(self.macros):
            knob.value_asked.connect(partial(self.macro_turned.emit, number))
            knob.hide()
        self._before_macros = vertical_rule()  # left of the macros, shown with them
        self._before_macros.hide()
        macros = filled(QHBoxLayout(), *self.macros, spacing=0)
        row = filled(QHBoxLayout(self), spacing=8, margins=NO_MARGINS)
        filled(row, self._build_words(), self._before_macros, macros, vertical_rule(), self._build_sound())
        row.setStretch(0, 1)

    def _build_words(self) -> QVBoxLayout:
        """Build the row of name, category and buttons, above the row of the state."""
        self.name.setMaximumWidth(320)
        self.category = Label(objectName="badge", toolTip="The instrument's category", visible=False)
        tip = "Save the instrument; a factory one under a name of your own"
        self.save = tool_button("Save", "Save the instrument", tip, "small", self.save_asked)
        tip = "Give your instrument another name"
        self.rename = tool_button("Rename …", "Rename the instrument", tip, "small", self.rename_asked)
        tip = "Go back to the instrument as it was saved (undo brings your changes back)"
        self.revert = tool_button("Revert", "Revert the instrument", tip, "small", self.revert_asked)
        self.compare = tool_button(
            "Compare", "Hear the saved instrument", COMPARE_TIP, "small", self.compare_asked, checkable=True
        )
        self.more = Overflow("the instrument")
        buttons = self.save, self.rename, self.revert, self.compare
        for button in buttons:
            button.setEnabled(False)
        above = filled(QHBoxLayout(), spacing=6)
        filled(above, self.previous, self.name, self.following, self.category, None, *buttons, self.more)
        above.setStretchFactor(self.name, 1000)
        return filled(QVBoxLayout(), above, self._build_state(), spacing=4)

    def _build_state(self) -> QHBoxLayout:
        """Build the row of note, scale, octave and velocity, voices, and recording."""
        self.note = words_label()
        self._build_scales()
        tip = "The computer's keys play an octave lower (Z)"
        self._lower = tool_button("−", "Octave down", tip, "chip", lambda: self.octave_asked.emit(-1))
        tip = "The computer's keys play an octave higher (X)"
        self._higher = tool_button("+", "Octave up", tip, "chip", lambda: self.octave_asked.emit(1))
        self.octave = faint()
        self.velocity = SteadyLabel("velocity 127")
        self.voices = SteadyLabel("0 voices")
        for words, tip in (
            (self.octave, "The lowest C on the computer's keys; C4 is middle C (Z, X)"),
            (self.velocity, "How hard the computer's keys strike, 1 … 127 (1 … 9; C softer, V harder)"),
            (self.voices, "Number of strings that ring"),
        ):
            words.setObjectName("faint")
            words.setToolTip(tip)
            words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.voices.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.record = tool_button("", kind="record", pressed=self.record_asked, checkable=True)
        tip = "Takes: play, name, export or delete each. Count-in and metronome (Ctrl+Shift+R)"
        self.takes_button = tool_button("Takes  ▾", "Takes, count-in and metronome", tip, "small", popupMode=INSTANT)
        self.takes = TakesMenu(self.takes_button)
        self.takes_button.setMenu(self.takes)
        keys = self._lower, self.octave, self._higher, self.velocity
        row = filled(QHBoxLayout(), self.filtered, self.note, self.scale, *keys, self.voices, spacing=8)
        filled(row, self.record, self.takes_button)
        row.setStretchFactor(self.note, 1)
        self.show_octave(3, 3, 3)
        self.show_velocity(90)
        self.show_recording(None)
        self.show_note("")
        return row

    def _build_scales(self) -> None:
        """Make the menu of scales: what is chosen is checked, and on the button."""
        self.scale = tool_button("", kind="small", popupMode=INSTANT)
        self._scales = QMenu(self.scale)
        for name, text in {"": "", **SCALES}.items():
            action = self._scales.addAction(name or EQUAL_STEPS)
            action.setCheckable(True)
            action.setData(text)
            action.triggered.connect(partial(self.scale_asked.emit, name))
        self._scales.addSeparator()
        self._scales.addAction("Scala file …", self.scala_file_asked.emit)
        self.scale.setMenu(self._scales)
        self._show_scale(TuningChoice())

    def _build_sound(self) -> QHBoxLayout:
        """Build the box of bodies and the knobs of MIXES: amplifier, mixes of body and room, level."""
        tip = "The body of the instrument, which colours the sound of the strings"
        self.body = combo_box("Body", [("No body", "")], tip=tip, picked=self.body_chosen.emit)
        self.body.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.body.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.body.setMinimumContentsLength(BODY_LETTERS)
        column = filled(QVBoxLayout(), spacing=3)
        column.addWidget(Label("BODY TYPE", objectName="knob"), alignment=Qt.AlignmentFlag.AlignHCenter)
        return filled(QHBoxLayout(), filled(column, self.body, None), *self.knobs.values(), spacing=0)

    # What is shown

    def set_compact(self, compact: bool, tight: bool = False) -> None:
        """Set the bar for a panel with little width; `tight`: with even less, where some buttons are in `more`."""
        self._compact, self._tight = compact, tight
        self._show_scale(self._tuning)
        self._share_width()

    def _share_width(self) -> None:
        """Show the buttons and words that fit; the menu of `more` has the others.

        In a tight bar the number of voices gives way to the scale of a tuned instrument, or to six or more macros.
        """
        many = len(self._macros) > ROOMY_MACROS
        close = self._compact or many
        roomy = not self._tuned and len(self._macros) < ROOMY_MACROS
        fits: dict[QToolButton | QLabel, bool] = {
            self.rename: not self._tight,
            self.revert: not self._tight,
            self.compare: not self._tight or self._comparing,
            self.category: not close,
            self.scale: self._tuned or not self._tight,
            self.takes_button: not self._tight,
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
        chosen = self.body.currentData() or ""
        refill(self.body, [("No body", ""), *((title, name) for name, title in bodies if name)], chosen)
        self._show_body(chosen)

    def show_instrument(self, instrument: Instrument, own: bool, changed: bool = False) -> None:
        """Show an instrument; `own`: it is the user's and can be renamed; `changed`: it differs from its file."""
        words = instrument.name, instrument.description, instrument.category, own, changed, instrument.tuning
        if words != self._words:
            self._words = words
            self._show_words(instrument, own, changed)
        self._show_macros(instrument.macros)
        for field, knob in self.knobs.items():
            knob.set_value(instrument.value(field))
        self.knobs["amp.tone_db"].setEnabled(instrument.amp.drive_db > 0)
        self.knobs["body.mix"].setEnabled(bool(instrument.body.name))
        if self.body.currentData() != instrument.body.name:
            self._show_body(instrument.body.name)

    def _show_words(self, instrument: Instrument, own: bool, changed: bool) -> None:
        """Show name, category and tuning of an instrument, and what can be done with it; see `show_instrument`."""
        self.show_name(instrument.name, *(("●  ", ", changed") if changed else ()))
        tip = f"{instrument.name}{' (changed)' if changed else ''}\n{instrument.description}".strip()
        self.name.setToolTip(plain_tip(f"{tip}\nClick to browse the instruments"))
        self.category.setText(instrument.category)
        for button in (self.save, self.revert, self.compare):
            button.setEnabled(changed)
        self.rename.setEnabled(own)
        self._show_scale(instrument.tuning)
        self._share_width()

    def show_comparing(self, comparing: bool) -> None:
        """Show if keys play the instrument as it was saved."""
        self.compare.setChecked(comparing)  # a click has checked it, though there may be nothing to compare with
        if comparing != self._comparing:
            self._comparing = comparing
            self._share_width()

    def show_macros(self, shown: bool) -> None:
        """Show the macros; else, with all knobs of the string, what they turn: the mixes of body and room."""
        self._shows_macros = shown
        self._share_knobs()

    def _show_macros(self, macros: tuple[Macro, ...]) -> None:
        """Show the values of macros on their knobs; names and tooltips only where these differ from before."""
        before, self._macros = self._macros, macros
        for knob, macro in zip(self.macros, macros, strict=False):
            knob.set_value(macro.value)
        if _names(before) != (names := _names(macros)):
            for knob, (name, turned) in zip(self.macros, names, strict=False):
                knob.set_name(name, f"{name}: changes {', '.join(turned)}")
            self._share_knobs()
            self._share_width()

    def _share_knobs(self) -> None:
        """Show one knob for every value: of a mix that is a macro's only target, the macro's, while macros are shown.

        The amplifier's knobs are hidden then; they are shown with all knobs of the string.
        """
        for number, knob in enumerate(self.macros):
            knob.setVisible(self._shows_macros and number < len(self._macros))
        self._before_macros.setVisible(self._shows_macros and bool(self._macros))
        alone = {macro.targets[0].field for macro in self._macros if len(macro.targets) == 1}
        for field, knob in self.knobs.items():
            knob.setVisible(not (self._shows_macros and (field in alone or field in AMP)))

    def _show_scale(self, tuning: TuningChoice) -> None:
        """Show what tunes the instrument: the name of a scale, and a keyboard mapping in the tool-tip."""
        scaled, mapped = bool(tuning.scale.strip()), bool(tuning.keymap.strip())
        name = (_scale_name(tuning.scale) or "Scala") if scaled else EQUAL_STEPS
        self._tuning, self._tuned = tuning, scaled or mapped
        for action in self._scales.actions():
            action.setChecked(action.data() == tuning.scale)
        room = TIGHT_LETTERS if self._tight else SCALE_LETTERS
        short = name if len(name) <= room else f"{name[: room - 1].rstrip()}…"
        self.scale.setText(f"{short if self._tuned else 'Scale'}  ▾".replace("&", "&&"))
        self.scale.setAccessibleName(f"Scale: {name}")
        mapping = ["A Scala keyboard mapping says which key plays which step, and gives the reference pitch"] * mapped
        lines = [f"Scale: {name}", *mapping, "Choose a scale, or a Scala file; one can be dropped, too"]
        self.scale.setToolTip(plain_tip("\n".join(lines)))
        show_kind(self.scale, "solo" if self._tuned else "small")

    def _show_body(self, name: str) -> None:
        """Select a body by its name, "" for none; one that is not listed, as its file is missing, is added."""
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
        """Show the octave of the lowest C on the computer's keys; `lowest`, `highest`: those where a key sounds."""
        self.octave.setText(f"octave C{octave}")
        self._lower.setEnabled(octave > lowest)
        self._higher.setEnabled(octave < highest)

    def say_octave(self, text: str) -> None:
        """Show above the octave, for SAID_MS, why it is what it is."""
        if self.octave.isVisible():
            say_above(self.octave, text, SAID_MS)

    def show_velocity(self, velocity: int) -> None:
        self.velocity.setText(f"velocity {velocity}")

    def show_pitches(self, pitches: bool) -> None:
        """Show octave and velocity of the computer's keys; hide them while these keys play no pitches."""
        for widget in (self._lower, self.octave, self._higher, self.velocity):
            widget.setVisible(pitches)

    def show_recording(self, seconds: float | None) -> None:
        """Show the seconds that it has been recording, below 0 in the count-in; None: it is not."""
        button = self.record
        button.setChecked(seconds is not None)
        if seconds is None:
            text, name, tip = "●  Record", "Record what is played", "Record what is played (Ctrl+R)"
        else:
            whole = math.floor(seconds)
            time = f"{whole // 60}:{whole % 60:02d}" if whole >= 0 else f"−{-whole}"
            text, name, tip = f"■  {time}", "End recording", "End the recording and save it"
        button.setText(text)
        button.setAccessibleName(name)
        button.setToolTip(tip)

    def popup_takes(self) -> None:
        """Open the menu of takes, also where its button has no room."""
        self.takes.popup(self.record.mapToGlobal(self.record.rect().bottomLeft()))

    def show_note(self, text: str) -> None:
        self.note.say(text)
        self.note.setToolTip(plain_tip(text))


def _scale_name(scale: str) -> str:
    """The name of a scale: the first line of a .scl file's text that is no comment.

    It is "" where that line is empty.
    """
    lines = (line for line in scale.splitlines() if not line.startswith("!"))
    return one_line(next(lines, ""), LONGEST_SCALE_NAME)


def _names(macros: tuple[Macro, ...]) -> list[tuple[str, list[str]]]:
    """The names of macros, each with those of the parameters that it turns."""
    return [(macro.name, [OF_INSTRUMENTS[target.field].name for target in macro.targets]) for macro in macros]
