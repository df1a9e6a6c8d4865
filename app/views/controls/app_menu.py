"""The window's menu: theme, UI scale, undo, and the dialogs without a button in the header."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu, QToolButton, QWidget

from app.views.controls.parts import tool_button
from app.views.look import Look
from engine.plain_text import one_line

THEMES = {"system": "Follow system", "dark": "Dark", "light": "Light"}
LONGEST_STEP = 60  # characters
SIZES_PERCENT = (100, 115, 125, 150)


class AppMenu(QMenu):
    """Emits `look_asked`; shows `show_look`. `asked`: for each action the name of the window's signal to emit."""

    look_asked = Signal(str, object)  # a field of `Look` and its new value

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._choices: dict[tuple[str, object], QAction] = {}
        self._add_choices("Theme", "theme", {name: theme for theme, name in THEMES.items()})
        self._add_choices("UI scale (after restart)", "size_percent", {f"{p} %": p for p in SIZES_PERCENT})
        self.addSeparator()
        self._undo, self._redo = self.addAction("Undo"), self.addAction("Redo")
        self.addSeparator()
        self.asked = {self._undo: "undo_asked", self._redo: "redo_asked"} | {
            self.addAction(text): signal
            for text, signal in (
                ("Show or hide instrument\tCtrl+K", "instrument_asked"),
                ("Export instrument …\tCtrl+Shift+E", "sampled_asked"),
                ("Audio settings …\tCtrl+,", "audio_asked"),
                ("MIDI …\tCtrl+M", "midi_asked"),
                ("Notices …\tF8", "notices_asked"),
                ("Help\tF1", "help_asked"),
                ("About Learned Strings", "about_asked"),
                ("Quit\tCtrl+Q", "quit_asked"),
            )
        }

    def show_look(self, look: Look) -> None:
        for (field, value), action in self._choices.items():
            action.setChecked(getattr(look, field) == value)

    def show_steps(self, undo: str, redo: str) -> None:
        """What undo and redo would change; "" where there is nothing to."""
        for action, what, step, keys in (
            (self._undo, "Undo", undo, "Ctrl+Z"),
            (self._redo, "Redo", redo, "Ctrl+Shift+Z"),
        ):
            name = f": {one_line(step, LONGEST_STEP)}".replace("&", "&&") if step else ""
            action.setText(f"{what}{name}\t{keys}")
            action.setEnabled(bool(step))

    def _add_choices(self, title: str, field: str, values: dict[str, object]) -> None:
        menu = self.addMenu(title)
        group = QActionGroup(menu)
        for text, value in values.items():
            action = menu.addAction(text)
            action.setCheckable(True)
            action.triggered.connect(lambda _=False, value=value: self.look_asked.emit(field, value))
            group.addAction(action)
            self._choices[field, value] = action


def menu_button(menu: QMenu) -> QToolButton:
    """The button in the header that opens the menu."""
    button = tool_button("☰", "Menu", "Theme, UI scale, undo, export instrument, audio, MIDI, notices, help")
    button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
    button.setMenu(menu)
    return button
