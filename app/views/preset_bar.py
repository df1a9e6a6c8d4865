"""Which preset: previous, next, its name, which opens the browser, and what the preset says of itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QSizePolicy, QWidget

from app.views.parts import tool_button

if TYPE_CHECKING:
    from app.library import PresetEntry


class PresetBar(QWidget):
    """See the module."""

    browse_asked = Signal()
    step_asked = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        previous = tool_button("◀", "Previous preset", "Previous preset of the browser's list (Page up)")
        following = tool_button("▶", "Next preset", "Next preset of the browser's list (Page down)")
        previous.clicked.connect(lambda: self.step_asked.emit(-1))
        following.clicked.connect(lambda: self.step_asked.emit(1))
        self.name = QPushButton("no preset found")
        self.name.setObjectName("preset")
        self.name.setMinimumWidth(180)
        self.name.setMaximumWidth(420)
        self.name.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.name.clicked.connect(self.browse_asked)
        self.card = QLabel()  # placed by the window
        self.card.setObjectName("faint")
        self.card.setWordWrap(True)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        row.addWidget(previous)
        row.addWidget(self.name, 1000)  # all of the room, up to its greatest width
        row.addWidget(following)
        row.addStretch(1)

    def set_chosen(self, entry: PresetEntry | None, favourite: bool = False) -> None:
        from app.views.preset_card import preset_card, preset_summary  # the engine with them: not for the first sight

        title = entry.info.title if entry else "no preset found"
        self.name.setText(f"{'★  ' if favourite else ''}{title}   ▾".replace("&", "&&"))
        self.name.setAccessibleName(f"Preset: {title}")
        self.name.setToolTip("Browse the presets (Ctrl+P)")
        self.card.setText(preset_summary(entry) if entry else "")
        self.card.setToolTip(preset_card(entry) if entry else "")
