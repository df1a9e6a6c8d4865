"""Knobs of the string: how it is built, plucked, heard and damped; and the resulting string in physical units."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from PySide6.QtCore import QMargins, QRectF, Qt, Signal
from PySide6.QtGui import QFontMetrics, QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.instruments.instrument import Instrument
from app.shared.parameters import in_group
from app.views import theme
from app.views.controls.knob import LOW_HEIGHT, NARROW_WIDTH, Knob
from app.views.controls.parts import NO_MARGINS, filled, vertical_rule
from app.views.controls.plain import Label, plain_tip
from app.views.controls.shape_box import NO_WIDTH, SHAPE_TIP, shape_box
from app.views.painting import write
from engine.parameters import DECAY, OF_INSTRUMENTS, PITCH, PLUCK, STRING, TECHNIQUE
from engine.pluck import SHAPES

HEAD_HEIGHT = 13  # pixels: of a group's heading
FACTS_HEIGHT = 16  # of the line of facts, below
SPACING = 4
WIDTHS = {  # in pixels, by the longest name or value
    "tuning.transpose": 58,
    "knobs.gauge": 56,
    "knobs.density": 68,
    "knobs.stiffness": 56,
    "pluck.width": 62,
    "pluck.width_hard": 62,
    "pluck.release_ms": 73,
    "pluck.release_hard_ms": 73,
}  # the others are narrow
NO_A4 = (
    "The Scala keyboard mapping of this instrument has a reference pitch of its own, so that A4 would change nothing"
)
NO_STRING = "This instrument has drums, and no string that this could change"
LETS_RING = "Release off (let ring)"


GROUPS = (PITCH, STRING, DECAY, PLUCK)  # in the order of the strip; the pick-up is in the transport bar
SHAPED = ("pluck.width", "pluck.width_hard")
BARRING = ("strings", "pluck", "damping", "tuning")  # parts of an instrument that may bar knobs


class Facts(QWidget):
    """A line of names and values; those that do not fit are in the tooltip alone."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._facts: dict[str, str] = {}  # name -> value with its unit
        theme.fix_size(self, height=FACTS_HEIGHT)
        self.setAccessibleName("The string under one key, as the knobs make it")

    def show_facts(self, facts: Mapping[str, str]) -> None:
        """Show facts, name and value with its unit each, in their order; all are in the tooltip."""
        if dict(facts) == self._facts:
            return
        self._facts = dict(facts)
        lines = "\n".join(f"{name} {value}" for name, value in facts.items())
        self.setAccessibleDescription(lines.replace("\n", ", "))
        self.setToolTip(plain_tip(f"{self.accessibleName()}\n{lines}"))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the facts from left to right, names faint and values bold, as far as there is room."""
        painter = QPainter(self)
        x = 2
        for name, value in self._facts.items():
            for words, ink, bold, gap in ((name, theme.FAINT, False, 5), (value, theme.TEXT, True, 20)):
                font = theme.small_font(11, bold)
                wide = QFontMetrics(font).horizontalAdvance(words)
                if x + wide > self.width() and x > 2:
                    return
                place = QRectF(x, 0, self.width() - x, self.height())
                write(painter, place, words, ink, font, Qt.AlignmentFlag.AlignVCenter)
                x += wide + gap


class StringKnobs(QWidget):
    """Gestures emit `changed`; `show_instrument` shows what became of them.

    `technique` is a group by itself, which stands elsewhere.
    """

    changed = Signal(str, object)  # a field of an instrument and its new value
    figure_asked = Signal(str, float)  # a knob's field, and the figure that it is to have, in the unit that is shown

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Knobs of the string")
        self.knobs: dict[str, Knob] = {}
        self.shape = shape_box(lambda shape: self.changed.emit("pluck.shape", shape))
        self.facts = Facts()
        self._shown: tuple[Instrument | None, Instrument | None] = None, None  # as of `show_instrument`
        row = filled(QHBoxLayout(), spacing=5)
        for number, group in enumerate(GROUPS):
            filled(row, *([vertical_rule()] if number else []), self._group(group))
        row.addStretch(1)
        self.technique = QWidget()
        filled(QHBoxLayout(self.technique), vertical_rule(), self._group(TECHNIQUE), margins=NO_MARGINS)
        filled(QVBoxLayout(self), row, self.facts, spacing=SPACING, margins=NO_MARGINS)
        # or a low window would squeeze it
        theme.fix_size(self, height=HEAD_HEIGHT + LOW_HEIGHT + SPACING + FACTS_HEIGHT)

    def _group(self, group: str) -> QVBoxLayout:
        """Build a column of a group's name above its knobs, which are added to `knobs`."""
        head = Label(group, objectName="group")
        theme.fix_size(head, height=HEAD_HEIGHT)
        row = filled(QHBoxLayout(), spacing=0)
        if group == PLUCK:
            row.addLayout(self._shape_column())
        for parameter in in_group(group):
            knob = Knob(parameter, width=WIDTHS.get(parameter.id, NARROW_WIDTH), low=True)
            knob.figure_asked.connect(partial(self.figure_asked.emit, parameter.id))
            ask = self._ask_whole if parameter.whole else self.changed.emit
            knob.value_asked.connect(partial(ask, parameter.id))
            self.knobs[parameter.id] = knob
            row.addWidget(knob)
        column = filled(QVBoxLayout(), spacing=0)
        column.addWidget(head, alignment=Qt.AlignmentFlag.AlignHCenter)
        return filled(column, row)

    def _shape_column(self) -> QVBoxLayout:
        name = Label("SHAPE", objectName="knob")
        theme.fix_size(name, height=14)  # as a knob's name
        column = filled(QVBoxLayout(), spacing=4, margins=QMargins(0, 0, 4, 0))
        column.addWidget(name, alignment=Qt.AlignmentFlag.AlignHCenter)
        return filled(column, self.shape, None)

    def _ask_whole(self, field: str, value: float) -> None:
        self.changed.emit(field, round(value))

    def show_instrument(self, instrument: Instrument, saved: Instrument | None = None) -> None:
        """Show the values of an instrument; `saved`: those that a double-click resets to."""
        before, self._shown = self._shown, (instrument, saved)
        for field, knob in self.knobs.items():
            knob.set_value(instrument.value(field))
        if saved is not None and saved is not before[1]:
            for field, knob in self.knobs.items():
                knob.default = saved.value(field)
        if before[0] is None or any(getattr(before[0], part) is not getattr(instrument, part) for part in BARRING):
            for field, knob in self.knobs.items():
                knob.set_barred(_why_barred(instrument, field))
            self.shape.setCurrentIndex(SHAPES.index(instrument.pluck.shape))
            barred = _why_barred(instrument, "pluck.shape")
            self.shape.setEnabled(not barred)
            self.shape.setToolTip(barred or SHAPE_TIP)

    def show_figures(self, figures: Mapping[str, str]) -> None:
        """Show the figures that knobs amount to in that string, by field ("knobs.tension": "72.3 N").

        The others show their values.
        """
        for field, knob in self.knobs.items():
            knob.show_figure(figures.get(field, ""))


def _why_barred(instrument: Instrument, field: str) -> str:
    """The reason why a field means nothing in this instrument; "" where it means something."""
    parameter = OF_INSTRUMENTS.get(field)  # the shape has none
    of_strings = parameter is None or (parameter.played is not None and not parameter.drums)
    if instrument.strings.kind == "drums" and of_strings:
        return NO_STRING
    if field in SHAPED and instrument.pluck.shape == "triangular":
        return NO_WIDTH
    if field == "damping.release_t60_s" and instrument.damping.let_ring:
        return LETS_RING
    if field == "tuning.a4_hz" and instrument.tuning.has_reference:
        return NO_A4
    return ""
