"""The presets in bar and browser: filter, favourites, previous and next."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QObject, QUrl, Signal
from PySide6.QtGui import QDesktopServices

from app.presets.filter import PresetFilter
from app.presets.library import Library
from app.session.choices import Session
from app.views.controls.preset_bar import PresetBar
from app.views.dialogs.preset_browser import PresetBrowser
from engine.folders import user_folder


class PresetDesk(QObject):
    """Lives in the window's thread, as long as the window.

    Attributes:
        favourites: names of presets, also of presets whose files are missing at present.
    """

    pluck_asked = Signal()
    told = Signal(str)  # a notice for the user

    def __init__(
        self,
        session: Session,
        library: Library,
        bar: PresetBar,
        browser: PresetBrowser,
        favourites: Iterable[str] = (),
    ) -> None:
        super().__init__(browser)
        self.favourites = set(favourites)
        self._session, self._library, self._bar, self.browser = session, library, bar, browser
        self._filter = PresetFilter()
        self._known = set(library.names)
        bar.step_asked.connect(self.step)
        bar.browse_asked.connect(self.toggle)
        bar.all_asked.connect(browser.clear_filter)
        browser.opened.connect(self._reload)
        browser.filter_changed.connect(self._apply)
        browser.chosen.connect(lambda name: session.update(preset=name))
        browser.favourite_asked.connect(self.toggle_favourite)
        browser.pluck_asked.connect(self.pluck_asked)
        browser.folder_asked.connect(self._open_folder)
        library.changed.connect(self._library_changed)
        self._show()

    def toggle(self) -> None:
        """Opens the browser, or closes it."""
        if self.browser.isVisible():
            self.browser.dismiss()
        else:
            self.browser.show_over()

    def step(self, step: int) -> None:
        """To the next or previous preset of the filtered list, going round; from outside, to its first or last."""
        names = [entry.name for entry in self._filter.applied(self._library.entries, self.favourites)]
        chosen = self._session.choices.preset
        if names:
            here = names.index(chosen) if chosen in names else -1
            place = (here + step) % len(names) if here >= 0 else (0 if step > 0 else -1)
            self._session.update(preset=names[place])

    def toggle_favourite(self, name: str) -> None:
        self.favourites ^= {name}
        self._show()

    def choice_changed(self) -> None:
        """To be called when another preset is chosen."""
        name = self._session.choices.preset
        self._bar.set_chosen(self._library.find(name), name in self.favourites)
        self.browser.set_chosen(name)

    def _apply(self, wanted: PresetFilter) -> None:
        self._filter = wanted
        self._show()

    def _library_changed(self) -> None:
        """Shows what there is now; a filter that hides an added preset is cleared."""
        added, self._known = set(self._library.names) - self._known, set(self._library.names)
        self._show()
        for name in added:
            self.browser.reveal(name)

    def _reload(self) -> None:
        """Reads the folders again: the user may have added files."""
        for problem in self._library.refresh():
            self.told.emit(problem)

    def _show(self) -> None:
        entries = self._library.entries
        self.browser.set_kinds(
            sorted({entry.info.model for entry in entries}), sorted({entry.info.rate_hz for entry in entries})
        )
        listed = self._filter.applied(entries, self.favourites)
        chosen = self._session.choices.preset
        self.browser.show_entries(listed, self.favourites, chosen, len(entries), str(user_folder()))
        self._bar.set_chosen(self._library.find(chosen), chosen in self.favourites)
        self._bar.set_listed(len(listed), len(entries))

    def _open_folder(self) -> None:
        folder = user_folder()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self.told.emit(
                f"{folder}: cannot be created ({error.strerror}); choose another with LEARNED_STRINGS_PRESETS."
            )
            return
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder))):
            self.told.emit(f"No file manager was found here; your own presets are in {folder}.")
