"""Small widgets that several views are made of."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QFrame, QLabel, QToolButton


def tool_button(text: str, name: str = "", tip: str = "") -> QToolButton:
    """A flat button; `name` is what a screen reader says where the text is a sign."""
    button = QToolButton()
    button.setText(text)
    button.setAccessibleName(name or text)
    button.setToolTip(tip)
    return button


def combo_box(name: str, entries: Iterable[tuple[str, object]], chosen: object = None) -> QComboBox:
    """A list of (text, data) with the entry of data `chosen` on top."""
    box = QComboBox()
    box.setAccessibleName(name)
    for text, data in entries:
        box.addItem(text, data)
    box.setCurrentIndex(max(0, box.findData(chosen)))
    return box


def vertical_rule() -> QFrame:
    line = QFrame()
    line.setObjectName("rule")
    line.setFixedWidth(1)
    return line


def label(kind: str = "", text: str = "", selectable: bool = False) -> QLabel:
    """Text that wraps; `kind` is a name in the style sheet ("faint", "warning")."""
    made = QLabel(text)
    made.setObjectName(kind)
    made.setWordWrap(True)
    if selectable:
        made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return made
