"""The export of the patch for samplers: its dialog, which does not block the window."""

from __future__ import annotations

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from app.export.sampled.choices import SampledChoices
from app.patches.patch import Patch
from app.presets.library import Library, PresetEntry
from app.session.choices import Session
from app.views.dialogs.sampled_dialog import SampledDialog


class SampledExport(QObject):
    """Lives as long as the window; `told` has notices for the user."""

    told = Signal(str)

    def __init__(self, session: Session, library: Library, choices: SampledChoices, window: QWidget) -> None:
        super().__init__(window)
        self._session, self._library, self._window = session, library, window
        self._choices = choices
        self.dialog: SampledDialog | None = None

    @property
    def choices(self) -> SampledChoices:
        """The dialog's choices, to be saved."""
        return self._choices if self.dialog is None else self.dialog.choices()

    def open(self) -> None:
        """Opens the dialog, or brings it to the front."""
        if self.dialog is None:
            if (played := self._played()) is None:
                self.told.emit("There is no patch to export: choose one first.")
                return
            self.dialog = SampledDialog(*played, self._choices, self._window)
            self.dialog.finished.connect(self._ended)
        self.dialog.show()
        self.dialog.raise_()
        self.dialog.activateWindow()

    def choices_changed(self, names: frozenset[str]) -> None:
        if self.dialog is not None and "patch" in names and (played := self._played()) is not None:
            self.dialog.show_patch(*played)

    def close(self) -> None:
        """Ends an export that has begun; its samples are kept. May be called again."""
        if self.dialog is not None:
            self.dialog.accept()

    def _played(self) -> tuple[Patch, PresetEntry] | None:
        patch = self._session.choices.patch
        entry = None if patch is None else self._library.find(patch.preset)
        return None if patch is None or entry is None else (patch, entry)

    def _ended(self) -> None:
        assert self.dialog is not None
        self._choices = self.dialog.choices()
        self.dialog.deleteLater()
        self.dialog = None
