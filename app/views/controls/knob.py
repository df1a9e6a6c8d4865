"""A rotary knob: drag, wheel, keys or typing; double-click goes back to its default."""

from __future__ import annotations

import math

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QInputEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QWheelEvent,
)
from PySide6.QtWidgets import QLineEdit, QSizePolicy, QToolTip, QWidget

from app.shared.typed_number import SIGNS, begins_number, typed_number, typed_value
from app.views import theme
from app.views.controls.number_box import refusal, say_above
from app.views.controls.parts import ENTER_KEYS, keeps_keys
from app.views.controls.plain import plain_tip
from app.views.painting import set_ink, write
from engine.parameters import Parameter

SWEEP_DEGREES = 270
WIDTH, NARROW_WIDTH = 62, 52  # pixels, as the next two
HEIGHT, LOW_HEIGHT = 82, 60
DRAG_PIXELS = 180  # for the whole range
FINE = 0.1  # with Shift
COARSE = 10  # of Page up and Page down

_STEPS = {
    Qt.Key.Key_Up: 1,
    Qt.Key.Key_Right: 1,
    Qt.Key.Key_Down: -1,
    Qt.Key.Key_Left: -1,
    Qt.Key.Key_PageUp: COARSE,
    Qt.Key.Key_PageDown: -COARSE,
}
_PLACES = (Qt.Key.Key_Home, Qt.Key.Key_End, Qt.Key.Key_Delete)  # the least, the most, the default


class _Editor(QLineEdit):
    """A field for a typed number; Enter and Escape, which are shortcuts of the window, are its own.

    A key that no number with this unit has gives it up, and goes to the window: it plays.
    """

    given_up = Signal()

    def __init__(self, start: str, unit: str, prefix: str, parent: QWidget) -> None:
        super().__init__(start, parent)
        self._unit, self._prefix = unit, prefix  # that may be typed with the number; "": none

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ShortcutOverride and isinstance(event, QKeyEvent) and self._is_alien(event):
            event.ignore()
            return True
        return keeps_keys(event, *ENTER_KEYS, Qt.Key.Key_Escape) or super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Give the field up by Escape or by a key that no number has, which then goes to the window."""
        if event.key() == Qt.Key.Key_Escape:
            self.given_up.emit()
        elif self._is_alien(event):
            self.given_up.emit()
            event.ignore()
        else:
            super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """End typing also where only the first digit was typed, which Qt does not count as an edit."""
        super().focusOutEvent(event)
        if event.reason() not in (Qt.FocusReason.ActiveWindowFocusReason, Qt.FocusReason.PopupFocusReason):
            self.editingFinished.emit()

    def _is_alien(self, event: QKeyEvent) -> bool:
        """Return True if a key, as a letter, makes no number with the text before the cursor."""
        modifiers = event.modifiers() & (Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier)
        if modifiers or not event.text().isprintable() or event.text() in SIGNS:  # "" is in it
            return False
        before = self.text()[: self.selectionStart() if self.hasSelectedText() else self.cursorPosition()]
        return not begins_number(before + event.text(), self._unit, self._prefix)


class Knob(QWidget):
    """Gestures emit `value_asked` and change nothing; the owner sets the new value with `set_value`.

    A figure is what the value amounts to in the present string, as "72.3 N". It may be shown in the value's place.

    Args:
        width: in pixels, by the longest name or value.
        low: smaller, for rows of many knobs.
    """

    value_asked = Signal(float)
    figure_asked = Signal(float)  # a number that was typed where a figure is shown
    drag_started = Signal()
    drag_ended = Signal()

    def __init__(
        self, parameter: Parameter, parent: QWidget | None = None, width: int = WIDTH, low: bool = False
    ) -> None:
        super().__init__(parent)
        self.parameter, self.default = parameter, parameter.default  # to which a double-click resets
        self._value = parameter.default
        self._dragged_at: QPointF | None = None  # of the mouse, at its last move; None: it does not drag
        self._dragged_share = 0.0  # of the range, 0 … 1; may go past the ends, so that the way back is as long
        self._editor: QLineEdit | None = None  # the field of a number that is being typed; None: none is
        self._width, self._low = width, low
        self._figure = self._why_barred = self._tip = ""  # "": the value is shown; it is free; no tip of its own
        self._stays = False  # keyboard focus stays here after typing, as keys have brought it
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        self.set_name(parameter.label, parameter.tip)

    def set_name(self, name: str, tip: str = "") -> None:
        """Set the label and the tooltip, shown as plain text: both may come from a file."""
        self._name, self._tip = name, tip
        self.setAccessibleName(name)
        self._tell()

    @property
    def value(self) -> float:
        return self._value

    def set_value(self, value: float) -> None:
        if value != self._value:
            self._value = value
            self._tell()

    @property
    def text(self) -> str:
        return self.parameter.shown(self._value)

    def show_figure(self, figure: str) -> None:
        """Show what the value amounts to, with its unit, in its place; "" shows the value again.

        The value itself is in the tooltip, and `figure_asked` reports a typed number.
        """
        if figure != self._figure:
            self._figure = figure
            self._tell()

    def set_barred(self, why: str) -> None:
        """Grey the knob out and say why in the tooltip; "" frees it."""
        if why != self._why_barred:
            self._why_barred = why
            self.setEnabled(not why)
            self._tell()

    def _tell(self) -> None:
        """Say its state to the eye, in the tooltip and to a screen reader."""
        both = f"{self._figure} ({self.text})" if self._figure else self.text
        self.setAccessibleDescription(both)
        hands = "Drag, wheel or arrow keys; Shift for fine steps; type a number; double-click resets"
        lines = [self._tip or self._name, self._why_barred or hands]
        if self._figure and not self._why_barred:
            lines.insert(1, f"Now {both}")
        self.setToolTip(plain_tip("\n".join(lines)))
        self.update()

    def sizeHint(self) -> QSize:
        return QSize(theme.px(self._width), theme.px(LOW_HEIGHT if self._low else HEIGHT))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.StyleChange:  # text of another size
            self.updateGeometry()

    def set_narrow(self, narrow: bool) -> None:
        """Set the width for a window with little room, or the usual one."""
        self._width = NARROW_WIDTH if narrow else WIDTH
        self.updateGeometry()
        self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._dragged_at = event.position()
            self._dragged_share = self.parameter.share(self._value)
            self.drag_started.emit()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._dragged_at is None:
            return
        self._dragged_share += (self._dragged_at.y() - event.position().y()) / DRAG_PIXELS * _fineness(event)
        self._dragged_at = event.position()
        self.value_asked.emit(self.parameter.value(self._dragged_share))
        say_above(self, self.accessibleDescription())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._dragged_at is not None and event.button() == Qt.MouseButton.LeftButton:
            self._dragged_at = None
            QToolTip.hideText()
            self.drag_ended.emit()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.value_asked.emit(self.default)

    def wheelEvent(self, event: QWheelEvent) -> None:
        notches = (event.angleDelta().y() or event.angleDelta().x()) / 120
        self.value_asked.emit(self.parameter.stepped(self._value, notches * _fineness(event)))
        event.accept()

    def event(self, event: QEvent) -> bool:
        """Keep Page up and Page down, which are shortcuts of the window, while the knob has the focus."""
        return keeps_keys(event, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown) or super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Ask for a step by arrows, an end or the default by Home, End, Delete; begin to type by a digit or sign."""
        steps = _STEPS.get(Qt.Key(event.key()))
        places = dict(zip(_PLACES, (*self.parameter.limits, self.default), strict=True))
        if steps is not None:
            self.value_asked.emit(self.parameter.stepped(self._value, steps * _fineness(event)))
        elif event.key() in places:
            self.value_asked.emit(places[Qt.Key(event.key())])
        elif event.text() and event.text() in SIGNS:
            self._type(event.text())
        else:
            super().keyPressEvent(event)

    def focusInEvent(self, event: QFocusEvent) -> None:
        """Remember whether keys brought the focus: then it stays here when a number was typed."""
        reason = Qt.FocusReason
        if event.reason() in (reason.TabFocusReason, reason.BacktabFocusReason, reason.ShortcutFocusReason):
            self._stays = True
        elif event.reason() == reason.MouseFocusReason:
            self._stays = False
        super().focusInEvent(event)

    def _type(self, start: str) -> None:
        """Open a field over the knob's value, which begins with the character that was typed."""
        unit, prefix = self.parameter.typed_unit, self.parameter.prefix
        if self._figure:
            unit, prefix = self.parameter.figure_unit or "", ""
        editor = _Editor(start, unit, prefix, self)
        editor.setGeometry(2, self.height() - theme.px(24) - 2, self.width() - 4, theme.px(24))
        editor.setAccessibleName(f"{self._name}, typed")
        editor.show()
        editor.setFocus()
        editor.editingFinished.connect(self._take_typed)
        editor.given_up.connect(self._give_up)
        self._editor = editor

    def _take_typed(self) -> None:
        """Close the field and ask for its number: a figure, or a value, limited to the range; refuse other texts."""
        if self._editor is None:
            return
        text = self._editor.text()
        self._close_editor()
        unit = self.parameter.figure_unit or ""
        value = typed_number(text, unit) if self._figure else typed_value(self.parameter, text)
        if value is None:
            say_above(self, refusal(text, self._figure or self.text))
        elif self._figure:
            self.figure_asked.emit(value)
        else:
            clamped = self.parameter.clamped(value)
            self.value_asked.emit(clamped)
            if clamped != value:
                end = "At most" if value > clamped else "At least"
                say_above(self, f"{end} {self.parameter.shown(clamped)}")

    def _give_up(self) -> None:
        if self._editor is not None:
            self._close_editor()  # first: a change of the focus hides every tip
            say_above(self, f"{self._figure or self.text} is kept")

    def _close_editor(self) -> None:
        """End typing. The focus returns to playing, or to the knob where keys had brought it there."""
        if self._editor is not None:
            editor, self._editor = self._editor, None
            if editor.hasFocus():
                (self if self._stays else self.window()).setFocus()
            editor.deleteLater()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the name above, the dial with its pointer, and below it the figure or the value."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        scale = theme.present.scale  # all of it grows with the text
        painter.scale(scale, scale)
        width, height = self.width() / scale, self.height() / scale
        ink = QColor(theme.TEXT if self.isEnabled() else theme.DISABLED)
        if self.hasFocus():
            painter.setPen(QPen(theme.translucent(theme.TEXT, 150), 1.5))
            painter.drawRoundedRect(QRectF(1, 1, width - 2, height - 2), 6, 6)
        middle, radius = (QPointF(width / 2, 29), 13.0) if self._low else (QPointF(width / 2, 38), 18.0)
        ring = QRectF(middle.x() - radius, middle.y() - radius, 2 * radius, 2 * radius)
        start = 90 + SWEEP_DEGREES / 2
        share = self.parameter.share(self._value)
        painter.setPen(QPen(QColor(theme.LINE), 4, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawArc(ring, round(start * 16), -SWEEP_DEGREES * 16)
        painter.setPen(QPen(ink, 4, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawArc(ring, round(start * 16), -round(SWEEP_DEGREES * share * 16))
        angle = math.radians(start - SWEEP_DEGREES * share)
        direction = QPointF(math.cos(angle), -math.sin(angle))
        set_ink(painter, fill=theme.LINE if self.hasFocus() else theme.RAISED)
        painter.drawEllipse(middle, radius - 5, radius - 5)
        painter.setPen(QPen(ink, 2, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawLine(middle + direction * 5, middle + direction * (radius - 6))
        small = theme.small_font(9 if self._low or self._width == NARROW_WIDTH else 10, grows=False)
        above = QRectF(0, 0 if self._low else 3, width, 14)
        write(painter, above, self._name.upper(), theme.TEXT if self.hasFocus() else theme.FAINT, small, room=width)
        foot = QRectF(0, height - (17 if self._low else 23), width, 18)
        write(painter, foot, self._figure or self.text, ink, theme.small_font(10 if self._low else 12, grows=False))


def _fineness(event: QInputEvent) -> float:
    return FINE if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1.0
