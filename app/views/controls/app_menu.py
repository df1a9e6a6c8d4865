"""The window's actions: one table of menus, words and shortcuts, and the menu that is made of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMenu, QToolButton, QWidget

from app.views.controls.parts import tool_button
from app.views.look import Look
from engine.plain_text import one_line

THEMES = {"system": "Follow system", "dark": "Dark", "light": "Light"}
LONGEST_STEP = 60  # characters
SIZES_PERCENT = (100, 115, 125, 150)
KEY_NAMES = {"Return": "Enter", "PgUp": "Page up", "PgDown": "Page down"}  # as tooltips call them


@dataclass(frozen=True)
class MenuEntry:
    """An action: its name in the code, its words in the menu, its shortcut, and its effect for the help."""

    name: str
    text: str
    key: str = ""
    does: str = ""

    @property
    def key_name(self) -> str:
        return KEY_NAMES.get(self.key, self.key)


# A shortcut works in the whole window. Enter is not the menu's: it presses the button that Tab went to, else plucks.
MENUS: dict[str, tuple[MenuEntry, ...]] = {
    "&File": (
        MenuEntry("open", "Open …", "Ctrl+O", "open a MIDI file, instrument, preset, scale or sound"),
        MenuEntry("recent", "Recent files"),
        MenuEntry("record", "Record", "Ctrl+R", "record what is played; again: end the recording and save it"),
        MenuEntry("takes", "Takes and metronome …", "Ctrl+Shift+R", "takes: play, name, export; count-in, metronome"),
        MenuEntry("export", "Export …", "Ctrl+E", "export WAV or FLAC"),
        MenuEntry(
            "sampler", "Export for samplers …", "Ctrl+Shift+E", "export the instrument for samplers (SFZ, SoundFont)"
        ),
        MenuEntry("plugin", "Export plug-in …"),
        MenuEntry("copy", "Copy the last note as a file", "Ctrl+Shift+C", "copy the last note as a WAV file"),
        MenuEntry("reveal", "Show the saved file in its folder"),
        MenuEntry("quit", "Quit", "Ctrl+Q", "quit"),
    ),
    "&Edit": (
        MenuEntry(
            "undo", "Undo", "Ctrl+Z", "undo: instrument and its knobs, preset, pluck, listening point, duration"
        ),
        MenuEntry("redo", "Redo", "Ctrl+Shift+Z", "redo"),
        MenuEntry("save", "Save instrument", "Ctrl+S", "save the instrument"),
        MenuEntry("save_as", "Save instrument as …", "Ctrl+Shift+S", "save the instrument as a file anywhere"),
        MenuEntry("revert", "Revert instrument"),
        MenuEntry("compare", "Hear saved instrument"),
    ),
    "&Play": (
        MenuEntry("play", "Pluck or stop", "Space", "pluck, or stop"),
        MenuEntry("pluck", "Pluck", "Return", "pluck"),
        MenuEntry("trained", "Pluck as trained", "Ctrl+Shift+P", "pluck in the middle of the preset's training"),
        MenuEntry("loop", "Loop", "Ctrl+L", "loop"),
        MenuEntry("instruments", "Instruments …", "Ctrl+I", "browse the instruments"),
        MenuEntry("browse", "Presets …", "Ctrl+P", "browse the presets"),
        MenuEntry("previous", "Previous preset", "PgUp", "previous preset"),
        MenuEntry("next", "Next preset", "PgDown", "next preset"),
        MenuEntry("switch", "Switch A and B", "B", "switch between A and B at the playhead"),
        MenuEntry("difference", "Hear the difference", "Shift+B", "hear model − truth in the Lab, and back"),
        MenuEntry("all_modes", "Play all modes", "Esc", "play all modes again"),
        MenuEntry("models", "All models on this pluck …"),
        MenuEntry("abx", "Listening test (ABX) …", "Ctrl+T", "blind listening test (ABX)"),
    ),
    "&View": (
        MenuEntry("face", "Play or Lab", "F9", "switch between the faces Play and Lab"),
        MenuEntry("keys", "Keys in Lab", "Ctrl+K", "show or hide the keys in Lab"),
        MenuEntry("motion", "Motion", "M", "show or hide the string's motion"),
        MenuEntry("envelope", "Envelope", "N", "show or hide the envelope of the motion"),
    ),
    "&Settings": (
        MenuEntry("audio", "Audio settings …", "Ctrl+,", "audio settings"),
        MenuEntry("midi", "MIDI …", "Ctrl+M", "MIDI"),
    ),
    "&Help": (
        MenuEntry("help", "Help", "F1", "help"),
        MenuEntry("menu", "Menu", "F10", "menu"),
        MenuEntry("notices", "Notices …", "F8", "notices since the start"),
        MenuEntry("about", "About Learned Strings"),
    ),
}
ENTRIES = {entry.name: entry for entries in MENUS.values() for entry in entries}
LOOK_MENU = "&View"  # has the theme and the text size too
LONGEST_FILE = 60  # characters of a recent file, and of its folder


class AppMenu(QMenu):
    """The menu of the app: emits `look_asked`, shows `show_look`. `action`: each QAction by the name of its entry."""

    look_asked = Signal(str, object)  # a field of `Look` and its new value
    recent_asked = Signal(object)  # the Path of a recent file

    def __init__(self, window: QWidget | None = None) -> None:
        super().__init__(window)
        self._looks: dict[tuple[str, object], QAction] = {}  # field of `Look` and its value -> the entry for it
        self.action: dict[str, QAction] = {}
        for title, entries in MENUS.items():
            menu = self.addMenu(title)
            for entry in entries:
                plucks = entry.key == "Return"
                action = menu.addAction(f"{entry.text}\t{entry.key_name}" if plucks else entry.text)
                self.action[entry.name] = action
                if not plucks:
                    action.setShortcut(QKeySequence(entry.key))
                    action.setAutoRepeat(False)
            if title == LOOK_MENU:
                menu.addSeparator()
                self._add_looks(menu, "Theme", "theme", {name: theme for theme, name in THEMES.items()})
                self._add_looks(menu, "Text size", "size_percent", {f"{p} %": p for p in SIZES_PERCENT})
        self._recent = QMenu(self)
        self.action["recent"].setMenu(self._recent)
        if window is not None:
            window.addActions(list(self.action.values()))  # or their shortcuts would wait for the menu

    def show_look(self, look: Look) -> None:
        for (field, value), action in self._looks.items():
            action.setChecked(getattr(look, field) == value)

    def show_recent(self, files: Sequence[Path]) -> None:
        """List the recent files, the latest first."""
        self._recent.clear()
        self.action["recent"].setEnabled(bool(files))
        for number, file in enumerate(files, 1):
            name, folder = (one_line(text, LONGEST_FILE).replace("&", "&&") for text in (file.name, file.parent.name))
            action = self._recent.addAction(f"&{number % 10}  {name}\t{folder}")
            action.triggered.connect(lambda _=False, file=file: self.recent_asked.emit(file))

    def show_steps(self, undo: str, redo: str) -> None:
        """Show the steps that undo and redo would change; "" where there is nothing to."""
        for name, step in (("undo", undo), ("redo", redo)):
            words = f": {one_line(step, LONGEST_STEP)}".replace("&", "&&") if step else ""
            self.action[name].setText(f"{ENTRIES[name].text}{words}")

    def _add_looks(self, above: QMenu, title: str, field: str, values: dict[str, object]) -> None:
        """Add a menu of the values of a field of `Look`, by their words, of which one is checked."""
        menu = above.addMenu(title)
        group = QActionGroup(menu)
        for text, value in values.items():
            action = self._looks[field, value] = QAction(text, group, checkable=True)
            action.triggered.connect(lambda _=False, value=value: self.look_asked.emit(field, value))
            menu.addAction(action)


def menu_button(menu: QMenu) -> QToolButton:
    button = tool_button("☰", "Menu", "Open, record, export, instruments, settings, theme, text size and help (F10)")
    button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
    button.setMenu(menu)
    return button
