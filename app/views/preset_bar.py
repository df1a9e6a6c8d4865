"""Which preset: previous, next, a list to choose from, and what the preset says of itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QSizePolicy, QWidget

from app.views.parts import tool_button

if TYPE_CHECKING:
    from app.library import PresetEntry


class PresetBar(QWidget):
    """See the module."""

    preset_chosen = Signal(str)
    step_asked = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._entries: list[PresetEntry] = []
        previous = tool_button("◀", "Previous preset", "Previous preset (Page up)")
        following = tool_button("▶", "Next preset", "Next preset (Page down)")
        previous.clicked.connect(lambda: self.step_asked.emit(-1))
        following.clicked.connect(lambda: self.step_asked.emit(1))
        self._list = QComboBox()
        self._list.setAccessibleName("Preset")
        self._list.setMinimumWidth(180)
        self._list.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self._list.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._list.setMaximumWidth(420)
        self._list.setMaxVisibleItems(24)
        self._list.activated.connect(lambda row: self.preset_chosen.emit(self._entries[row].name))
        self.card = QLabel()  # placed by the window
        self.card.setObjectName("faint")
        self.card.setWordWrap(True)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        row.addWidget(previous)
        row.addWidget(self._list, 1000)  # all of the room, up to its greatest width
        row.addWidget(following)
        row.addStretch(1)

    def set_entries(self, entries: list[PresetEntry]) -> None:
        self._entries = entries
        with QSignalBlocker(self._list):
            self._list.clear()
            for row, entry in enumerate(entries):
                self._list.addItem(entry.info.title)
                self._list.setItemData(row, self._card(entry), Qt.ItemDataRole.ToolTipRole)
            if not entries:
                self._list.addItem("no preset found")
        self._list.setEnabled(bool(entries))

    def set_chosen(self, name: str) -> None:
        for row, entry in enumerate(self._entries):
            if entry.name == name:
                self._list.setCurrentIndex(row)
                self._list.setToolTip(self._card(entry))
                self.card.setText(self._summary(entry))
                self.card.setToolTip(self._card(entry))

    @staticmethod
    def _summary(entry: PresetEntry) -> str:
        info = entry.info
        parts = [
            info.model,
            f"{entry.parameters:,} parameters",
            "tension-modulated string" if info.tension_modulated else "linear string",
            f"{info.rate_hz / 1000:g} kHz, {info.modes} modes",
            f"trained on {info.horizon_s:g} s",
        ]
        if info.rel_mae is not None:
            parts.append(f"validation error {100 * info.rel_mae:.1f} %")
        return "   ·   ".join(parts)

    @staticmethod
    def _card(entry: PresetEntry) -> str:
        info = entry.info
        lines = [
            f"<b>{info.title}</b>",
            info.description,
            f"Model: {info.model}, {entry.parameters:,} parameters, initialised from {info.initialisation}",
            f"String: {'tension-modulated' if info.tension_modulated else 'linear'}, {info.modes} modes, "
            f"{info.string.length_m:g} m",
            f"Rate {info.rate_hz} Hz, trained on {info.horizon_steps} samples ({info.horizon_s:g} s), "
            f"{info.initial} initial displacements",
        ]
        audible = info.string.modes_below(info.rate_hz / 2)
        if audible < info.modes:
            lines.append(
                f"Modes {audible + 1} … {info.modes} lie above half the rate: folded back in model and truth"
            )
        if info.rel_mse is not None and info.rel_mae is not None:
            lines.append(f"Validation error: relative MSE {info.rel_mse:.4f}, relative MAE {info.rel_mae:.4f}")
        lines.append(f"Licence {info.licence}; file {entry.path.name}")
        return "<br>".join(line for line in lines if line)
