"""The choice among rows by a bar and a browser: favourites, previous and next, the user's folder; of presets."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from pathlib import Path

from PySide6.QtCore import QObject

from app.presets.library import Library
from app.stage.session import Session
from app.views.controls.browser import Browser
from app.views.controls.browser_rows import BrowserRow
from app.views.controls.choosers import ChoiceBar
from app.views.dialogs.preset_card import preset_browser, preset_row
from app.views.file_manager import open_folder
from app.window.main_window import MainWindow
from engine.folders import user_folder


class BrowserDesk(QObject):
    """A desk: the controller of a browser and of the bar that opens it, for presets or instruments.

    It lives in the window's thread, as long as the window. A row is a preset or an instrument, by its name.

    Attributes:
        favourites: names of rows, also of those whose files are missing at present.
    """

    def __init__(self, window: MainWindow, bar: ChoiceBar, browser: Browser, favourites: Iterable[str]) -> None:
        super().__init__(window)
        self._notices = window.notices
        self._bar_filter = bar.filtered
        self.browser, self.favourites = browser, set(favourites)
        bar.browse_asked.connect(self.toggle)
        bar.all_asked.connect(browser.clear_filter)
        bar.step_asked.connect(self.step)
        browser.opened.connect(self.reload)
        browser.listed_changed.connect(self._show_listed)
        browser.chosen.connect(self.choose)
        browser.favourite_asked.connect(self.toggle_favourite)
        browser.folder_asked.connect(self._open_folder)

    @property
    @abstractmethod
    def chosen(self) -> str:
        """The name of the row that is loaded; "": none."""

    @abstractmethod
    def choose(self, name: str) -> None:
        """Load a row."""

    @abstractmethod
    def reload(self) -> None:
        """Read the folders again: the user may have added files."""

    @abstractmethod
    def _rows(self) -> Sequence[BrowserRow]:
        """The rows that there are now."""

    @abstractmethod
    def _folder(self) -> Path:
        """The folder of the user's own files."""

    def show_rows(self) -> None:
        """List what there is now."""
        self.browser.show_rows(self._rows(), self.favourites, self.chosen, str(self._folder()))

    def _show_listed(self) -> None:
        self._bar_filter.show_listed(len(self.browser.listed), self.browser.total)

    def toggle(self) -> None:
        """Open the browser, or close it."""
        if self.browser.isVisible():
            self.browser.dismiss()
        else:
            self.browser.show_over()

    def step(self, step: int) -> None:
        """Load the next row of the filtered list (1) or the previous (-1); the first follows the last.

        Where the loaded row is not in the list, load its first or last.
        """
        names, name = self.browser.listed, self.chosen
        if names:
            index = names.index(name) if name in names else -1
            self.choose(names[(index + step) % len(names) if index >= 0 else (0 if step > 0 else -1)])

    def toggle_favourite(self, name: str) -> None:
        self.favourites ^= {name}
        self.show_rows()

    def _open_folder(self) -> None:
        """Open the folder of the user's own files in the file manager; make it where it is not there."""
        folder = self._folder()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            remedy = "choose another with LEARNED_STRINGS_PRESETS"
            self._notices.report(f"{folder}: cannot be created ({error.strerror}); {remedy}.")
            return
        open_folder(folder, self._notices.report)


class PresetDesk(BrowserDesk):
    """A desk of presets; see `BrowserDesk`."""

    def __init__(
        self, window: MainWindow, session: Session, library: Library, favourites: Iterable[str] = ()
    ) -> None:
        super().__init__(window, window.presets, preset_browser(window), favourites)
        self._session = session
        self._library = library
        self._bar = window.presets
        self._known = set(library.names)  # at the last change, to find what was added
        library.changed.connect(self._library_changed)
        self.show_rows()

    @property
    def chosen(self) -> str:
        return self._session.choices.preset

    def choose(self, name: str) -> None:
        self._session.update(preset=name)

    def reload(self) -> None:
        for problem in self._library.refresh():
            self._notices.report(problem)

    def _rows(self) -> Sequence[BrowserRow]:
        return [preset_row(entry) for entry in self._library.entries]

    def _folder(self) -> Path:
        return user_folder()

    def choice_changed(self) -> None:
        """Show the chosen preset; to be called when another one is chosen."""
        self._show_listed()
        self.browser.set_chosen(self.chosen)

    def _show_listed(self) -> None:
        super()._show_listed()
        self._bar.set_chosen(self._library.find(self.chosen), self.chosen in self.favourites)

    def _library_changed(self) -> None:
        """Show what there is now; a filter that hides an added preset is cleared."""
        added, self._known = set(self._library.names) - self._known, set(self._library.names)
        self.show_rows()
        for name in added:
            self.browser.reveal(name)
