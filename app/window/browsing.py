"""The choice among rows by a bar and a browser: favourites, previous and next, the user's folder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from PySide6.QtCore import QObject, QUrl
from PySide6.QtGui import QDesktopServices

from app.views.controls.browser import Browser
from app.views.controls.browser_rows import BrowserRow
from app.views.controls.preset_bar import PresetBar
from app.views.instrument.patch_bar import PatchBar
from app.window.main_window import MainWindow


class BrowserDesk(QObject):
    """A desk that lives in the window's thread, as long as the window.

    Attributes:
        favourites: names of rows, also of those whose files are missing at present.
    """

    def __init__(
        self, window: MainWindow, bar: PresetBar | PatchBar, browser: Browser, favourites: Iterable[str]
    ) -> None:
        super().__init__(window)
        self._notices = window.notices
        self._bar_filter = bar.filtered
        self.browser, self.favourites = browser, set(favourites)
        bar.browse_asked.connect(self.toggle)
        bar.all_asked.connect(browser.clear_filter)
        browser.opened.connect(self.reload)
        browser.listed_changed.connect(self._show_listed)
        browser.chosen.connect(self.choose)
        browser.favourite_asked.connect(self.toggle_favourite)
        browser.folder_asked.connect(self._open_folder)

    @property
    def chosen(self) -> str:
        """The name of the row that is loaded; "": none."""
        raise NotImplementedError

    def choose(self, name: str) -> None:
        """Load a row."""
        raise NotImplementedError

    def reload(self) -> None:
        """Read the folders again: the user may have added files."""
        raise NotImplementedError

    def _rows(self) -> Sequence[BrowserRow]:
        """The rows that there are now."""
        raise NotImplementedError

    def _folder(self) -> Path:
        """The folder of the user's own files."""
        raise NotImplementedError

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
        """Step to the next or previous one of the filtered list, going round.

        A step from outside leads to its first or last.
        """
        names, name = self.browser.listed, self.chosen
        if names:
            index = names.index(name) if name in names else -1
            self.choose(names[(index + step) % len(names) if index >= 0 else (0 if step > 0 else -1)])

    def toggle_favourite(self, name: str) -> None:
        self.favourites ^= {name}
        self.show_rows()

    def _open_folder(self) -> None:
        folder = self._folder()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            remedy = "choose another with LEARNED_STRINGS_PRESETS"
            self._notices.report(f"{folder}: cannot be created ({error.strerror}); {remedy}.")
            return
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder))):
            self._notices.report(f"No file manager was found here; your own {self.browser.what} are in {folder}.")
