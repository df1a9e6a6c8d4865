"""Small widgets that several views are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

from PySide6.QtCore import QEvent, QMargins, Qt, SignalInstance
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QBoxLayout,
    QComboBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QPlainTextEdit,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.views.controls.elided_label import ElidedLabel
from app.views.controls.plain import Label

Box = TypeVar("Box", bound=QBoxLayout)
Button = TypeVar("Button", bound=QAbstractButton)
Handler = Callable[..., object] | SignalInstance
ENTER_KEYS = (Qt.Key.Key_Return, Qt.Key.Key_Enter)
NO_MARGINS = QMargins()
SMALL = "padding: 2px 8px; border-radius: 4px;"  # of controls above a view


def tool_button(
    text: str, name: str = "", tip: str = "", kind: str = "", pressed: Handler | None = None, **properties: Any
) -> QToolButton:
    """A flat button.

    Args:
        name: what a screen reader says where the text is a symbol.
        kind: its name in the style sheet.
        properties: further ones of Qt.
    """
    return _prepared(QToolButton(**properties), text, name or text, tip, kind, pressed)


def push_button(
    text: str, tip: str = "", name: str = "", kind: str = "", pressed: Handler | None = None, **properties: Any
) -> QPushButton:
    """A button that Enter presses only where it has the focus; arguments as of `tool_button`."""
    properties = {"autoDefault": False, **properties}
    return _prepared(QPushButton(**properties), text, name, tip, kind, pressed)


def _prepared(button: Button, text: str, name: str, tip: str, kind: str, pressed: Handler | None) -> Button:
    """The button with its text, names, tooltip and handler; arguments as of `tool_button`."""
    button.setText(text)
    button.setAccessibleName(name)
    button.setToolTip(tip)
    button.setObjectName(kind)
    if pressed is not None:
        button.clicked.connect(pressed)
    return button


def filled(
    layout: Box, *parts: QWidget | QLayout | None, spacing: int | None = None, margins: QMargins | None = None
) -> Box:
    """The layout, with parts in their order; None is empty space that grows."""
    for part in parts:
        if isinstance(part, QWidget):
            layout.addWidget(part)
        elif part is None:
            layout.addStretch(1)
        else:
            layout.addLayout(part)
    if spacing is not None:
        layout.setSpacing(spacing)
    if margins is not None:
        layout.setContentsMargins(margins)
    return layout


def combo_box(
    name: str,
    entries: Iterable[tuple[str, object]],
    chosen: object = None,
    tip: str = "",
    picked: Callable[[Any], object] | None = None,
) -> QComboBox:
    """A combo box of (text, data); the entry whose data is `chosen` is selected, else the first.

    `picked` is called with the data of the entry that the user picks.
    """
    box = QComboBox()
    box.setAccessibleName(name)
    box.setToolTip(tip)
    refill(box, entries, chosen)
    if picked is not None:
        box.activated.connect(lambda row: picked(box.itemData(row)))
    return box


def refill(box: QComboBox, entries: Iterable[tuple[str, object]], chosen: object) -> None:
    """List other entries in a combo box, as of `combo_box`."""
    listed = list(entries)
    box.clear()
    for text, data in listed:
        box.addItem(text, data)
    box.setCurrentIndex(next((row for row, (_, data) in enumerate(listed) if data == chosen), 0))


def show_kind(widget: QWidget, kind: str) -> None:
    """Give a widget another kind of the style sheet."""
    if widget.objectName() != kind:
        widget.setObjectName(kind)
        widget.style().unpolish(widget)
        widget.style().polish(widget)


def faint(text: str = "") -> QLabel:
    return Label(text, objectName="faint")


def words_label() -> ElidedLabel:
    """A faint line that takes the room there is and is cut where that is too little."""
    words = ElidedLabel(objectName="faint")
    words.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
    return words


def keeps_keys(event: QEvent, *keys: Qt.Key) -> bool:
    """Accept the override of a shortcut on one of these, so that the widget gets the key.

    Returns True if it was one.
    """
    if event.type() == QEvent.Type.ShortcutOverride and isinstance(event, QKeyEvent) and event.key() in keys:
        event.accept()
        return True
    return False


def lay_out_view(
    view: QWidget,
    before: Sequence[QWidget],
    words: QWidget,
    behind: Sequence[QWidget],
    *below: QWidget,
    top: int = 2,
    gap: int = 4,
) -> None:
    """A row of small controls with words between them; beneath, the rest, of which the last takes all other room.

    `top` and `gap`: pixels above the row, and below it.
    """
    for control in (*before, *behind):
        if isinstance(control, QComboBox | QToolButton) and not control.styleSheet():
            control.setStyleSheet(SMALL)
    row = filled(QHBoxLayout(), *before, words, *behind, spacing=8, margins=QMargins(4, 0, 4, 0))
    row.setStretchFactor(words, 1)
    column = filled(QVBoxLayout(view), row, spacing=gap, margins=QMargins(0, top, 0, 0))
    for part in below:
        column.addWidget(part, int(part is below[-1]))


def lay_out_alone(view: QWidget, part: QWidget) -> None:
    """Lay out one part that takes all room."""
    filled(QVBoxLayout(view), part, margins=NO_MARGINS)


def scrolled(part: QWidget) -> QScrollArea:
    """A part as wide as its place, which scrolls where it is higher."""
    area = QScrollArea(widgetResizable=True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setWidget(part)
    return area


def read_only_text(name: str, text: str = "") -> QPlainTextEdit:
    """Lines that can be selected; `name` is what a screen reader says."""
    box = QPlainTextEdit(text, readOnly=True, tabChangesFocus=True)
    box.setAccessibleName(name)
    return box


def vertical_rule() -> QFrame:
    line = QFrame()
    line.setObjectName("rule")
    line.setFixedWidth(1)
    return line


def label(kind: str = "", text: str = "", selectable: bool = False) -> QLabel:
    """Text that wraps; `kind` is a name in the style sheet ("faint", "warning")."""
    text_label = Label(text, objectName=kind, wordWrap=True)
    if selectable:
        text_label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return text_label
