"""The export dialog: a page for each kind of export, then progress, which can be cancelled, and the result.

It does not block the window: several minutes are for playing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QHBoxLayout, QTabBar, QVBoxLayout, QWidget

from app.export.job import EXPECTED, ExportJob
from app.views.controls.parts import filled, push_button, show_kind
from app.views.dialogs.export_pages import (
    PAGES,
    ExportPage,
    Kind,
    ModelsPage,
    NotePage,
    PerformancePage,
    PluginPage,
    Remembered,
    SamplerPage,
    WavForm,
)
from app.views.dialogs.question import ask
from app.views.dialogs.work_dialog import WorkDialog
from app.views.file_manager import reveal
from app.views.file_places import FilePlaces
from engine.whole_file import WriteError

KINDS = tuple(PAGES)
SETTLE_MS = 150  # after the last change: a knob that is turned changes the instrument at each step
MEANWHILE = "You can play on meanwhile."
REPLACE = "Replace"  # the button's word where a file of this name is there
CONTINUE, CANCEL = "Continue", "Cancel export"


class ExportDialog(WorkDialog):
    """The dialog of exports. It follows what the window plays (`show_subjects`) until an export begins.

    A subject is what one kind of export would write, such as the last note. An offer is what the button would do.

    Attributes:
        save: the button that starts.
    """

    exported = Signal(object)  # the job that has ended well
    ended = Signal(bool)  # a job, well or not; the dialog shows its result by then

    def __init__(self, remembered: Remembered, places: FilePlaces, parent: QWidget | None = None) -> None:
        export, sampled = remembered
        super().__init__("Export", 680, "export", EXPECTED, parent)
        self._job: ExportJob | None = None  # the latest, under way or ended
        self._subjects: Mapping[Kind, Any] = {}  # by kind; None or left out: there is nothing to export
        self._places = places
        self.wav = WavForm(export)
        self.note, self.performance = NotePage(export, self.wav, places), PerformancePage(self.wav, places)
        self.models, self.sampler = ModelsPage(export, self.wav, places), SamplerPage(sampled, places)
        self.plugin = PluginPage(places)
        pages = self.note, self.performance, self.models, self.sampler, self.plugin
        self.pages: dict[Kind, ExportPage] = dict(zip(KINDS, pages, strict=True))
        self.tabs = QTabBar(drawBase=False, expanding=False)
        self.tabs.setAccessibleName("What to export")
        self.tabs.setToolTip("A note, what was recorded, or the instrument for samplers or as a plug-in")
        self._settled = QTimer(self, singleShot=True, interval=SETTLE_MS)  # runs from each change of a choice
        self._settled.timeout.connect(self._show_offer)
        self._lay_out()
        for page in self.pages.values():
            self.tabs.addTab(page.title)
            page.changed.connect(self._settled.start)
        self.wav.changed.connect(self._settled.start)
        self.tabs.currentChanged.connect(self._turn_page)

    def _lay_out(self) -> None:
        self.state.setMinimumHeight(52)
        self.state.setAlignment(Qt.AlignmentFlag.AlignTop)
        tip = "Show what was saved in the file manager"
        self.show_folder = push_button("Show in folder", tip, pressed=self._reveal)
        tip = "Render and save"
        self.save = push_button("Export", tip, kind="primary", pressed=self._start, autoDefault=True)
        self.close_button = push_button("Close", "Close (Escape)", pressed=self._close_or_cancel)
        buttons = filled(QHBoxLayout(), self.show_folder, None, self.close_button, self.save)
        self._choosers = (self.tabs, *self.pages.values(), self.wav)  # disabled while an export is under way
        filled(QVBoxLayout(self), *self._choosers, None, self.bar, self.state, buttons, spacing=12)
        self.show_folder.hide()

    @property
    def kind(self) -> Kind:
        return KINDS[self.tabs.currentIndex()]

    @property
    def page(self) -> ExportPage:
        return self.pages[self.kind]

    @property
    def job(self) -> ExportJob | None:
        """The job under way."""
        return self._job if self.background.busy else None

    def choices(self) -> Remembered:
        """The choices of all pages, to be remembered."""
        matched = {"level_match": self.models["level_match"].isChecked()}
        return self.note.choices().model_copy(update=matched), self.sampler.choices()

    def open_at(self, kind: Kind) -> None:
        """Show a page, unless an export is under way, and bring the dialog to the front."""
        if self.job is None:
            self.tabs.setCurrentIndex(KINDS.index(kind))
            self._turn_page()
        self.show()
        self.raise_()
        self.activateWindow()

    def show_subjects(self, subjects: Mapping[Kind, Any]) -> None:
        """Show the subjects that there are now, by kind; an export that has begun keeps its own."""
        self._subjects = subjects
        if self.job is None:
            for kind, page in self.pages.items():
                page.show_subject(subjects.get(kind))
            self._settled.start()

    def _turn_page(self) -> None:
        """Show the page of the chosen tab alone, the form for sound files where it belongs to it, and the offer."""
        for page in self.pages.values():
            page.setVisible(page is self.page)
        self.wav.setVisible(self.page.writes_wav)
        self.wav.note.setVisible(self.page is self.note)  # of the rate of its model
        self.setWindowTitle(self.page.window_title)
        self._show_offer()
        self.adjustSize()

    def _show_offer(self) -> None:
        """Show what would be written, or why nothing can be, with the button disabled. Write nothing."""
        self._settled.stop()
        if self.job is not None:
            return
        self.show_folder.hide()
        try:
            text, words = self.page.offer()
        except (ValueError, WriteError) as error:
            self._show_text(str(error), failed=True)
            self.save.setEnabled(False)
            return
        self.save.setText(text)
        self.save.setEnabled(True)
        for set_for_enter in (self.save.setDefault, self.save.setAutoDefault):
            set_for_enter(text != REPLACE)  # Enter replaces no file
        self._show_text(words)

    # Work

    def _start(self) -> None:
        """Begin the export that is offered; not where only now the button came to say "Replace"."""
        words = self.save.text()
        self._show_offer()  # of choices that have not settled
        if not self.save.isEnabled() or (self.save.text() == REPLACE != words):
            return
        self._job = job = self.page.job()
        for part in (*self._choosers, self.save):
            part.setEnabled(False)
        self.close_button.setText("Cancel")
        self._show_text("Rendering …")
        self.begin(lambda work: job.run(work.progress), self._show_finished)
        if (parent := self.parentWidget()) is not None:
            parent.window().activateWindow()  # whose keys play on

    def progress_words(self, text: str, left: str) -> str:
        return f"{text or 'Rendering'}{left and f', {left}'}. {MEANWHILE}"

    def _show_finished(self, words: str) -> None:
        assert self._job is not None
        self._places.remember(self.page.file.kind, self._job.file.parent)
        self.exported.emit(self._job)
        self._end(words)
        self.show_folder.show()
        self.ended.emit(True)

    def show_failure(self, message: str) -> None:
        self._end(message, failed=True)
        self.ended.emit(False)

    def show_cancelled(self) -> None:
        assert self._job is not None
        self._end(f"Cancelled; {self._job.cancelled}")
        self.ended.emit(False)

    def _end(self, text: str, failed: bool = False) -> None:
        """Show the result in words, and let another export be chosen, of what is played by now."""
        self.bar.hide()
        for part in (*self._choosers, self.save):
            part.setEnabled(True)
        self.close_button.setText("Close")
        self.show_subjects(self._subjects)  # as they are by now
        self._show_offer()
        self._show_text(text, failed)

    def _show_text(self, text: str, failed: bool = False) -> None:
        show_kind(self.state, "warning" if failed else "faint")
        self.state.setText(text)

    def _reveal(self) -> None:
        assert self._job is not None
        reveal(self._job.file, self._show_text)

    def done(self, result: int) -> None:
        """Close the dialog. A job under way is cancelled and waited for; what is whole is kept."""
        self.background.close(None)
        super().done(result)

    def reject(self) -> None:
        """Escape, or the window's cross: asks before it ends an export."""
        question = "An export is under way; only whole files are kept."
        if self.job is None:
            self.accept()
        elif ask(self, "Cancel the export?", question, CONTINUE, CANCEL) == CANCEL:
            self.background.stop()

    def _close_or_cancel(self) -> None:
        if self.job is None:
            self.accept()
        else:
            self.background.stop()
