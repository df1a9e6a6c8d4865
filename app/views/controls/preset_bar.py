"""The choice of a preset: previous, next, its name, which opens the browser, and its facts in a line.

Previous and next go through the browser's list. While that is filtered, a button beside them says so and clears it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.views.controls.choosers import FilterButton, NameButton
from app.views.controls.elided_label import ElidedLabel
from app.views.controls.parts import NO_MARGINS, filled, tool_button

if TYPE_CHECKING:
    from app.presets.library import PresetEntry


class PresetBar(QWidget):
    """The bar of presets; `card`, the line of facts, is placed by the window."""

    browse_asked = Signal()
    step_asked = Signal(int)
    all_asked = Signal()  # clear the browser's filter

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        tip = "Previous preset in the browser's list (Page up)"
        previous = tool_button("◀", "Previous preset", tip, "narrow", lambda: self.step_asked.emit(-1))
        tip = "Next preset in the browser's list (Page down)"
        following = tool_button("▶", "Next preset", tip, "narrow", lambda: self.step_asked.emit(1))
        tip = "Browse the presets (Ctrl+P)"
        self.name = NameButton("Reading presets …", tip, self.browse_asked, narrowest=100, widest=560)
        self.filtered = FilterButton("presets", self.all_asked)
        self.card = ElidedLabel(objectName="faint")
        row = filled(QHBoxLayout(self), previous, self.name, following, self.filtered, None, spacing=6)
        row.setContentsMargins(NO_MARGINS)
        row.setStretchFactor(self.name, 1000)  # takes the room first, up to its maximum width

    def set_chosen(self, entry: PresetEntry | None, favourite: bool = False) -> None:
        """Show the chosen preset; None: there is no preset."""
        from app.views.dialogs.preset_card import (  # brings the engine, which the first paint does not wait for
            preset_card,
            preset_summary,
        )

        title = entry.title if entry else "No preset found"
        self.name.setText(f"{'★  ' if favourite else ''}{title}   ▾".replace("&", "&&"))
        self.name.setAccessibleName(f"Preset: {title}")
        self.card.say(*(preset_summary(entry) if entry else [""]))
        self.card.setToolTip(preset_card(entry) if entry else "")
