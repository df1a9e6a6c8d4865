"""The presets in bar and browser: filter, favourites, previous and next."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from app.presets.library import Library
from app.session.choices import Session
from app.views.controls.browser_rows import BrowserRow
from app.views.dialogs.preset_card import preset_browser, preset_row
from app.window.browsing import BrowserDesk
from app.window.main_window import MainWindow
from engine.folders import user_folder


class PresetDesk(BrowserDesk):
    """A desk of presets; see `BrowserDesk`."""

    def __init__(
        self, window: MainWindow, session: Session, library: Library, favourites: Iterable[str] = ()
    ) -> None:
        super().__init__(window, window.presets, preset_browser(window), favourites)
        self._session, self._library, self._bar = session, library, window.presets
        self._known = set(library.names)
        self._bar.step_asked.connect(self.step)
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
