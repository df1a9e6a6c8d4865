"""The A/B comparison: two slots, which one is heard, and what each holds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction, QActionGroup, QFontMetrics
from PySide6.QtWidgets import QButtonGroup, QGridLayout, QMenu, QPushButton, QSizePolicy, QToolButton, QWidget

from app.session.choices import Choices
from app.session.monitor import Monitor
from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB
from app.views import theme
from app.views.controls.parts import push_button, show_kind, tool_button
from app.views.controls.plain import plain_tip

if TYPE_CHECKING:
    from app.presets.library import PresetEntry

SLOTS = ("a", "b")
DIFFERENCE_GAINS_DB = range(0, int(DIFFERENCE_GAIN_RANGE_DB[1]) + 1, 10)
WIDTH = 148  # this and the next two: fixed, so that a longer title moves nothing
NARROW_WIDTH = 108
TIGHT_WIDTH = 82
PADDING = 16  # pixels: of the style sheet, with the borders

_SOURCES = (
    ("model", "Model of the chosen preset"),
    ("truth", "Truth: the physics"),
    ("difference", "Difference: model − truth"),
)


class SlotButtons(QWidget):
    """A button for each slot, which makes it the heard one, and beside it a menu of the sources that it may hold.

    The slots A and B hold a source each: "model", "truth", "difference", or "preset:NAME" for another preset's model.
    """

    change_asked = Signal(str, object)  # a field of `Choices` and its new value

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._choices = Choices()
        self._width = WIDTH  # of a button, in pixels that grow with the text
        self._entries: Sequence[PresetEntry] = ()  # the presets whose models can be chosen
        self._gains_db: dict[str, float | None] = {}  # by slot, as of `show_gains`
        self._buttons: dict[str, QPushButton] = {}  # by slot
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(3)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        group = QButtonGroup(self)
        for row, slot in enumerate(SLOTS):
            button = push_button("", checkable=True)
            button.clicked.connect(lambda _=False, slot=slot: self.change_asked.emit("heard", slot))
            button.setFixedWidth(theme.px(self._width))
            group.addButton(button)
            self._buttons[slot] = button
            grid.addWidget(button, row, 0)
            grid.addWidget(self._menu_button(slot), row, 1)
        self._show()

    def set_entries(self, entries: Sequence[PresetEntry]) -> None:
        self._entries = entries
        self._show()

    def set_narrow(self, narrow: bool, tight: bool = False) -> None:
        """Set the width of the buttons for a window of little width; `tight`: narrower still, for even less."""
        self._width = TIGHT_WIDTH if tight else NARROW_WIDTH if narrow else WIDTH
        for button in self._buttons.values():
            button.setFixedWidth(theme.px(self._width))
        self._show()

    def show_choices(self, choices: Choices) -> None:
        """Show what the slots hold, and which is heard."""
        before, self._choices = self._choices, choices
        if any(getattr(before, name) != getattr(choices, name) for name in Monitor.model_fields):
            self._show()

    def show_gains(self, gains_db: dict[str, float | None]) -> None:
        """Show the gain in dB with which each slot is heard; None: not known yet."""
        if gains_db != self._gains_db:
            self._gains_db = gains_db
            self._show()

    def _show(self) -> None:
        """Show on both buttons what their slots hold, the gain, which is heard, and the tooltips."""
        for slot, button in self._buttons.items():
            source = self._choices.source_of(slot)
            title, short = self._title(source)
            gain = self._gain_text(slot)
            button.setText(self._fit_text(slot.upper(), short, gain))
            button.setAccessibleName(f"Hear {slot.upper()}: {title}")
            gain_line = f"\nPlayed with {gain or '+0.0'} dB" + (
                ", a stated gain" if source == "difference" else " to match the level of the truth"
            )
            keys = "B: switch between A and B; Shift+B: hear model − truth"
            tip = f"Hear {slot.upper()}: {title} ({keys})" + (gain_line if gain else "")
            button.setToolTip(plain_tip(tip))
            show_kind(button, theme.source_kind(source))
            button.setChecked(self._choices.heard == slot)

    def _title(self, source: str) -> tuple[str, str]:
        """The title of a source, and its wording for a button."""
        for entry in self._entries:
            if source == f"preset:{entry.name}":
                return entry.title, entry.title
        name = source.removeprefix("preset:")
        return name, "DIFF." if source == "difference" else name.upper()

    def _fit_text(self, letter: str, text: str, gain: str) -> str:
        """The text that fits a button: where room is short, the gain loses its unit, then `text` is cut."""
        metrics = QFontMetrics(theme.small_font(12, bold=True))
        room = theme.px(self._width) - PADDING
        for beside in (gain, gain.removesuffix(" dB")):
            words = "  ".join(part for part in (letter, text, beside) if part)
            if metrics.horizontalAdvance(words) <= room:
                return words
        room -= metrics.horizontalAdvance(f"{letter}    {beside}")
        cut = metrics.elidedText(text, Qt.TextElideMode.ElideMiddle, room)
        return "  ".join(part for part in (letter, cut, beside) if part)

    def _gain_text(self, slot: str) -> str:
        """The gain of a slot with its unit; "" where it is not known, or less than 0.05 dB."""
        gain_db = self._gains_db.get(slot)
        if gain_db is None or abs(gain_db) < 0.05:
            return ""
        return f"{gain_db:+.0f} dB" if self._choices.source_of(slot) == "difference" else f"{gain_db:+.1f} dB"

    def _menu_button(self, slot: str) -> QToolButton:
        """Build the button of a slot's menu, which is filled each time it opens."""
        letter = slot.upper()
        button = tool_button("▾", f"Source of {letter}", f"Source and gain of {letter}", "narrow")
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(button)
        menu.setToolTipsVisible(True)
        menu.aboutToShow.connect(lambda: self._fill(menu, slot))
        button.setMenu(menu)
        return button

    def _fill(self, menu: QMenu, slot: str) -> None:
        """Fill the menu of a slot: its source, then level match and gain of the difference, which are of both."""
        menu.clear()
        group = QActionGroup(menu)
        for source, title in _SOURCES:
            self._add(menu, group, title, slot, source)
        others = menu.addMenu("Another preset's model")
        others.setToolTipsVisible(True)
        for entry in self._entries:
            source = f"preset:{entry.name}"
            action = self._add(others, group, entry.title, slot, source)
            tip = f"Its model on the same pluck, at {entry.info.rate_hz / 1000:g} kHz"
            action.setToolTip(plain_tip(f"{tip}\n{entry.path.name}"))
        menu.addSeparator()
        match = QAction("Match levels to the truth", menu, checkable=True, checked=self._choices.level_match)
        match.toggled.connect(lambda on: self.change_asked.emit("level_match", on))
        menu.addAction(match)
        gains = menu.addMenu("Gain of the difference")
        gain_group = QActionGroup(gains)
        for gain in DIFFERENCE_GAINS_DB:
            self._add(gains, gain_group, f"+{gain} dB", "difference_gain_db", float(gain))

    def _add(self, menu: QMenu, group: QActionGroup, title: str, field: str, value: object) -> QAction:
        """Add an entry that asks for the value of a field, checked if it is the present one."""
        action = QAction(title, menu, checkable=True, checked=getattr(self._choices, field) == value)
        action.triggered.connect(lambda: self.change_asked.emit(field, value))
        group.addAction(action)
        menu.addAction(action)
        return action
