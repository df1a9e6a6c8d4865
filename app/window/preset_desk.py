"""The presets in bar and browser: filter, favourites, previous and next."""

from __future__ import annotations

from collections.abc import Iterable

from app.presets.library import Library
from app.session.choices import Session
from app.views.controls.browser import Browser
from app.views.controls.preset_bar import PresetBar
from app.views.dialogs.preset_card import preset_row
from app.window.browsing import BrowserDesk
from engine.folders import user_folder


class PresetDesk(BrowserDesk):
    """A desk of presets; see `BrowserDesk`."""

    def __init__(
        self,
        session: Session,
        library: Library,
        bar: PresetBar,
        browser: Browser,
        favourites: Iterable[str] = (),
    ) -> None:
        super().__init__(
            browser,
            lambda: [preset_row(entry) for entry in library.entries],
            lambda: session.choices.preset,
            lambda name: session.update(preset=name),
            user_folder,
            favourites,
        )
        self._library, self._bar = library, bar
        self._known = set(library.names)
        bar.step_asked.connect(self.step)
        bar.browse_asked.connect(self.toggle)
        bar.all_asked.connect(browser.clear_filter)
        browser.opened.connect(self._reload)
        browser.listed_changed.connect(self._show_bar)
        library.changed.connect(self._library_changed)
        self.show()

    def choice_changed(self) -> None:
        """Show the chosen preset; to be called when another one is chosen."""
        self._show_bar()
        self.show_chosen()

    def _show_bar(self) -> None:
        name, browser = self._chosen(), self.browser
        self._bar.set_chosen(self._library.find(name), name in self.favourites)
        self._bar.filtered.show_listed(len(browser.listed), browser.total)

    def _library_changed(self) -> None:
        """Show what there is now; a filter that hides an added preset is cleared."""
        added, self._known = set(self._library.names) - self._known, set(self._library.names)
        self.show()
        for name in added:
            self.browser.reveal(name)

    def _reload(self) -> None:
        """Read the folders again: the user may have added files."""
        for problem in self._library.refresh():
            self.reported.emit(problem)
