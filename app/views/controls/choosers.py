"""Bars that choose from a browser's list: previous, the chosen name, next, and the filter while there is one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QSizePolicy, QToolButton

from app.views.controls.elided_label import ElidedLabel
from app.views.controls.parts import NO_MARGINS, Handler, filled, tool_button

if TYPE_CHECKING:
    from app.presets.library import PresetEntry

PADDING = 26  # pixels: of the style sheet, with the borders


class NameButton(QPushButton):
    """A name that opens the browser, cut in the middle: presets of one string differ at their ends."""

    def __init__(self, text: str, tip: str, pressed: Handler) -> None:
        super().__init__()
        self.setObjectName("preset")
        self.setToolTip(tip)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setText(text)
        self.clicked.connect(pressed)

    def setText(self, text: str) -> None:
        self._full_text = text
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        cut, room = Qt.TextElideMode.ElideMiddle, self.width() - PADDING
        super().setText(self.fontMetrics().elidedText(self._full_text, cut, room, Qt.TextFlag.TextShowMnemonic))


class FilterButton(QToolButton):
    """The number of rows that pass a filter, hidden while all do; a click asks to clear it.

    Previous and next go through what is left. `what`: the rows, such as presets.
    """

    def __init__(self, what: str, pressed: Handler) -> None:
        super().__init__()
        self.setObjectName("filter")
        self.hide()
        self._what = what
        self.clicked.connect(pressed)

    def show_listed(self, listed: int, total: int) -> None:
        """Show how many rows of all pass the filter; hide the button where all do."""
        self.setVisible(listed < total)
        self.setText(f"{listed} of {total}  ✕")
        self.setAccessibleName(f"Filtered: {listed} of {total} {self._what}; clear the filter")
        self.setToolTip(
            f"{listed} of {total} {self._what} match the filter; previous and next step through these.\n"
            "Click to clear the filter"
        )


class ChoiceBar(QFrame):
    """The base of a bar, which places `previous`, `name`, `following` and `filtered`.

    Args:
        what: is chosen, in the singular.
        name: what is shown until then.
        keys: for previous, next and the browser, as tooltips end with them.
    """

    browse_asked = Signal()
    step_asked = Signal(int)  # -1: previous, 1: next
    all_asked = Signal()  # clear the browser's filter

    def __init__(self, what: str, name: str, keys: tuple[str, str, str] = ("", "", "")) -> None:
        super().__init__()
        self._what = what.capitalize()
        before, behind, browse = keys
        self.previous, self.following = (
            tool_button(
                sign,
                f"{word} {what}",
                f"{word} {what} in the browser's list{key}",
                "narrow",
                lambda _=False, step=step: self.step_asked.emit(step),
            )
            for sign, word, key, step in (("◀", "Previous", before, -1), ("▶", "Next", behind, 1))
        )
        self.name = NameButton(name, f"Browse the {what}s{browse}", self.browse_asked)
        self.filtered = FilterButton(f"{what}s", self.all_asked)

    def show_name(self, name: str, mark: str = "", state: str = "") -> None:
        """Show the chosen name behind a mark; `state`: what that means, for a screen reader."""
        self.name.setText(f"{mark}{name}   ▾".replace("&", "&&"))
        self.name.setAccessibleName(f"{self._what}: {name}{state}")


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
