"""Gestures on widgets, what signals report of them, and pictures of them."""

from typing import Any, TypeVar

from PySide6.QtCore import QEvent, QPoint, QPointF, Qt, SignalInstance
from PySide6.QtGui import QColor, QImage, QKeyEvent, QMouseEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

LEFT, RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton
NONE, SHIFT = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier
CONTROL = Qt.KeyboardModifier.ControlModifier
Kind = TypeVar("Kind", bound=QWidget)


def reported(*signals: SignalInstance) -> list[Any]:
    """The values of each emission from now on: the value of one argument, a tuple of several."""
    seen: list[Any] = []
    for signal in signals:
        signal.connect(lambda *values: seen.append(values[0] if len(values) == 1 else values))
    return seen


def named(root: QWidget, name: str, kind: type[Kind] = QWidget) -> Kind:  # type: ignore[assignment]
    """The widget beneath the root that has this accessible name or this text."""
    texts = {each: (each.accessibleName(), getattr(each, "text", str)()) for each in root.findChildren(kind)}
    return next(each for each, words in texts.items() if name in words)


def press_keys(widget: QWidget, *keys: Qt.Key, held: Qt.KeyboardModifier = NONE) -> None:
    for key in keys:
        QTest.keyClick(widget, key, held)


def keeps(widget: QWidget, key: Qt.Key) -> bool:
    """Return True if the widget takes the key before it can be a shortcut of the window."""
    event = QKeyEvent(QEvent.Type.ShortcutOverride, key, NONE)
    event.ignore()
    QApplication.sendEvent(widget, event)
    return event.isAccepted()


def turn_wheel(widget: QWidget, at: QPoint, turned: QPoint, held: Qt.KeyboardModifier = NONE) -> bool:
    """Turn the wheel by eighths of a degree; return True if the widget took it."""
    where, phase = QPointF(at), Qt.ScrollPhase.NoScrollPhase
    event = QWheelEvent(where, where, QPoint(), turned, Qt.MouseButton.NoButton, held, phase, False)
    QApplication.sendEvent(widget, event)
    return event.isAccepted()


def move(widget: QWidget, at: QPoint, button: Qt.MouseButton = LEFT, held: Qt.KeyboardModifier = NONE) -> None:
    """Move the pointer with a button held."""
    where = QPointF(at)
    event = QMouseEvent(QEvent.Type.MouseMove, where, widget.mapToGlobal(where), button, button, held)
    QApplication.sendEvent(widget, event)


def drag(widget: QWidget, *places: QPoint, button: Qt.MouseButton = LEFT) -> None:
    """Press at the first place, move through the others, release at the last."""
    QTest.mousePress(widget, button, NONE, places[0])
    for place in places[1:]:
        move(widget, place, button)
    QTest.mouseRelease(widget, button, NONE, places[-1])


def picture(widget: QWidget) -> QImage:
    return widget.grab().toImage()


def colour_at(image: QImage, place: QPoint | QPointF) -> QColor:
    """The colour of a picture at a place in the pixels of its widget."""
    ratio = image.devicePixelRatio()
    return image.pixelColor(round(place.x() * ratio), round(place.y() * ratio))
