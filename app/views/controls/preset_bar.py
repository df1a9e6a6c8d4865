"""The choice of a preset: previous, next, its name, which opens the browser, and its facts in a line.

Previous and next go through the browser's list. While that is filtered, a button beside them says so and clears it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtWidgets import QHBoxLayout

from app.views.controls.choosers import ChoiceBar
from app.views.controls.elided_label import ElidedLabel
from app.views.controls.parts import NO_MARGINS, filled

if TYPE_CHECKING:
    from app.presets.library import PresetEntry


class PresetBar(ChoiceBar):
    """The bar of presets; `card`, the line of facts, is placed by the window."""

    def __init__(self) -> None:
        super().__init__("preset", "Reading presets …", (" (Page up)", " (Page down)", " (Ctrl+P)"))
        self.name.setMinimumWidth(100)
        self.name.setMaximumWidth(560)
        self.card = ElidedLabel(objectName="faint")
        row = filled(QHBoxLayout(self), self.previous, self.name, self.following, self.filtered, None, spacing=6)
        row.setContentsMargins(NO_MARGINS)
        row.setStretchFactor(self.name, 1000)  # takes the room first, up to its maximum width

    def set_chosen(self, entry: PresetEntry | None, favourite: bool = False) -> None:
        """Show the chosen preset; None: there is no preset."""
        from app.views.dialogs.preset_card import (  # brings the engine, which the first paint does not wait for
            preset_card,
            preset_summary,
        )

        self.show_name(entry.title if entry else "No preset found", "★  " if favourite else "")
        self.card.say(*(preset_summary(entry) if entry else [""]))
        self.card.setToolTip(preset_card(entry) if entry else "")
