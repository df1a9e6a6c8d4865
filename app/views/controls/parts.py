"""Small widgets that several views are made of."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
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
ENTER_KEYS = (Qt.Key.Key_Return, Qt.Key.Key_Enter)


def tool_button(text: str, name: str = "", tip: str = "") -> QToolButton:
    """A flat button; `name` is what a screen reader says where the text is a symbol."""
    button = QToolButton()
    button.setText(text)
    button.setAccessibleName(name or text)
    button.setToolTip(tip)
    return button


def push_button(text: str, tip: str = "") -> QPushButton:
    """A button that Enter presses only where it has the focus."""
    button = QPushButton(text, autoDefault=False)
    button.setToolTip(tip)
    return button


def filled(layout: Box, *parts: QWidget | QLayout | None) -> Box:
    """The layout, with parts in their order; None is empty space that grows."""
    for part in parts:
        if isinstance(part, QWidget):
            layout.addWidget(part)
        elif part is None:
            layout.addStretch(1)
        else:
            layout.addLayout(part)
    return layout


def combo_box(name: str, entries: Iterable[tuple[str, object]], chosen: object = None) -> QComboBox:
    """A combo box of (text, data); the entry whose data is `chosen` is selected, else the first."""
    box = QComboBox()
    box.setAccessibleName(name)
    for text, data in entries:
        box.addItem(text, data)
    box.setCurrentIndex(max(0, box.findData(chosen)))
    return box


def faint(text: str = "") -> QLabel:
    """A line of text in the faint colour."""
    text_label = Label(text)
    text_label.setObjectName("faint")
    return text_label


def words_label() -> ElidedLabel:
    """A faint line that takes the room there is and is cut where that is too little."""
    label = ElidedLabel()
    label.setObjectName("faint")
    label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
    return label


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
    before: Iterable[QWidget],
    words: QWidget,
    behind: Iterable[QWidget],
    *below: QWidget,
    top: int = 2,
    gap: int = 4,
) -> None:
    """A row of small controls with words between them; beneath, the rest, of which the last takes all other room.

    `top` and `gap`: pixels above the row, and below it.
    """
    row = QHBoxLayout()
    row.setContentsMargins(4, 0, 4, 0)
    row.setSpacing(8)
    for control in before:
        row.addWidget(control)
    row.addWidget(words, 1)
    for control in behind:
        row.addWidget(control)
    column = QVBoxLayout(view)
    column.setContentsMargins(0, top, 0, 0)
    column.setSpacing(gap)
    column.addLayout(row)
    for part in below:
        column.addWidget(part, int(part is below[-1]))


def lay_out_alone(view: QWidget, part: QWidget) -> None:
    """Lay out one part that takes all room."""
    column = QVBoxLayout(view)
    column.setContentsMargins(0, 0, 0, 0)
    column.addWidget(part)


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
    box = QPlainTextEdit(text, readOnly=True)
    box.setAccessibleName(name)
    box.setTabChangesFocus(True)
    return box


def vertical_rule() -> QFrame:
    line = QFrame()
    line.setObjectName("rule")
    line.setFixedWidth(1)
    return line


def label(kind: str = "", text: str = "", selectable: bool = False) -> QLabel:
    """Text that wraps; `kind` is a name in the style sheet ("faint", "warning")."""
    text_label = Label(text)
    text_label.setObjectName(kind)
    text_label.setWordWrap(True)
    if selectable:
        text_label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return text_label
