"""The parts that both browsers share in the window: rows, favourites, previous and next, the user's folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from PySide6.QtCore import QObject, QUrl, Signal
from PySide6.QtGui import QDesktopServices

from app.views.controls.browser import Browser
from app.views.controls.browser_rows import BrowserRow


class BrowserDesk(QObject):
    """A desk that lives in the window's thread, as long as the window.

    Args:
        rows: what there is now.
        chosen: the name of the row that is loaded; "": none.
        choose: loads one.
        folder: of the user's own files.

    Attributes:
        favourites: names of rows, also of those whose files are missing at present.
    """

    reported = Signal(str)  # a notice for the user

    def __init__(
        self,
        browser: Browser,
        rows: Callable[[], Sequence[BrowserRow]],
        chosen: Callable[[], str],
        choose: Callable[[str], None],
        folder: Callable[[], Path],
        favourites: Iterable[str],
    ) -> None:
        super().__init__(browser)
        self.browser, self.favourites = browser, set(favourites)
        self._rows = rows
        self._chosen = chosen
        self._choose = choose
        self._folder = folder
        browser.chosen.connect(choose)
        browser.favourite_asked.connect(self.toggle_favourite)
        browser.folder_asked.connect(self._open_folder)

    def show(self) -> None:
        """List what there is now."""
        self.browser.show_rows(self._rows(), self.favourites, self._chosen(), str(self._folder()))

    def show_chosen(self) -> None:
        """Show the chosen one; to be called when another one is loaded."""
        self.browser.set_chosen(self._chosen())

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
        names, name = self.browser.listed, self._chosen()
        if names:
            index = names.index(name) if name in names else -1
            self._choose(names[(index + step) % len(names) if index >= 0 else (0 if step > 0 else -1)])

    def toggle_favourite(self, name: str) -> None:
        self.favourites ^= {name}
        self.show()

    def _open_folder(self) -> None:
        folder = self._folder()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            remedy = "choose another with LEARNED_STRINGS_PRESETS"
            self.reported.emit(f"{folder}: cannot be created ({error.strerror}); {remedy}.")
            return
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder))):
            self.reported.emit(f"No file manager was found here; your own {self.browser.what} are in {folder}.")
