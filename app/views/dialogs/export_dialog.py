"""The export dialog: what to save and how; then progress, which can be cancelled, and the result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QCloseEvent, QDesktopServices
from PySide6.QtWidgets import (
    QDialog,
    QHBoxLayout,
    QProgressBar,
    QPushButton,
    QTabBar,
    QVBoxLayout,
    QWidget,
)

from app.export.batch import INDEX, BatchRow, run_batch
from app.export.choices import ExportChoices
from app.export.files import WavReport
from app.presets.library import PresetEntry
from app.session.choices import Choices
from app.shared.durations import duration
from app.views.controls.plain import Label
from app.views.dialogs.chosen_sound import export_chosen
from app.views.dialogs.export_job import ExportJob, Work
from app.views.dialogs.export_pages import BatchPage, SoundPage, as_heard
from app.views.dialogs.sound_form import SoundForm

_RECIPE_NOTE = "Each file stores its settings: drop it on the window to restore its preset and pluck."


class ExportDialog(QDialog):
    """Offers first what is heard, and remembers its last state in `export_choices`.

    Args:
        entries: the presets of a batch; `choices.preset` is among them.
    """

    def __init__(
        self,
        entries: Sequence[PresetEntry],
        choices: Choices,
        export: ExportChoices,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export WAV")
        self.setMinimumWidth(680)
        choices, export = as_heard(entries, choices, export)
        self._preset = next(entry for entry in entries if entry.name == choices.preset)
        self._choices, self._export = choices, export
        self._job: ExportJob | None = None
        self._shown_folder = Path()
        self.sound = SoundPage(self._preset, choices, export)
        self.batch = BatchPage(entries, choices, export)
        self.form = SoundForm(export, self._preset.info.rate_hz)
        self._lay_out()
        for part in (self.sound, self.batch, self.form):
            part.changed.connect(self._update)
        self.tabs.currentChanged.connect(self._turn)
        self.batch.hide()
        self._update()

    def export_choices(self) -> ExportChoices:
        """The dialog's state."""
        folder = str(Path(self.sound.path.text()).parent)
        more = {"folder": folder, "source": self.sound.source.currentData(), "batch": self.batch.choices()}
        return ExportChoices.model_validate({**self._export.model_dump(), **self.form.choices(), **more})

    def _lay_out(self) -> None:
        self.tabs = QTabBar()
        self.tabs.setAccessibleName("What to export")
        self.tabs.setToolTip("One pluck, or many")
        self.tabs.addTab("This pluck")
        self.tabs.addTab("Batch")
        self.tabs.setDrawBase(False)
        self.tabs.setExpanding(False)
        self.state = Label(_RECIPE_NOTE)
        self.state.setObjectName("faint")
        self.state.setWordWrap(True)
        self.state.setMinimumHeight(34)
        self.state.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.bar = QProgressBar(maximum=1000)
        self.bar.setAccessibleName("Progress")
        self.show_folder = QPushButton("Show in folder")
        self.show_folder.setToolTip("Open the folder of the saved files")
        self.show_folder.clicked.connect(self._open_folder)
        self.save = QPushButton("Export", default=True)
        self.save.setObjectName("primary")
        self.save.setToolTip("Render and save")
        self.save.clicked.connect(self._start)
        self.close_button = QPushButton("Close")
        self.close_button.setToolTip("Close, or cancel the rendering (Escape)")
        self.close_button.clicked.connect(self._cancel_or_close)
        buttons = QHBoxLayout()
        buttons.addWidget(self.show_folder)
        buttons.addStretch(1)
        buttons.addWidget(self.close_button)
        buttons.addWidget(self.save)
        column = QVBoxLayout(self)
        column.setSpacing(12)
        for part in (self.tabs, self.sound, self.batch, self.form):
            column.addWidget(part)
        column.addStretch(1)
        column.addWidget(self.bar)
        column.addWidget(self.state)
        column.addLayout(buttons)
        self.bar.hide()
        self.show_folder.hide()

    @property
    def _is_batch(self) -> bool:
        return self.tabs.currentIndex() == 1

    def _turn(self) -> None:
        """To the other page."""
        self.sound.setVisible(not self._is_batch)
        self.batch.setVisible(self._is_batch)
        self._say(_RECIPE_NOTE)
        self._update()
        self.adjustSize()

    def _update(self) -> None:
        if self._job is not None:
            return
        export = self.export_choices()
        self.sound.suggest_name(export.rate_hz)
        self.form.show_difference("difference" in (export.batch.sources if self._is_batch else (export.source,)))
        if not self._is_batch:
            there = any(path.is_file() for path in self.sound.paths().values())
            self.save.setText("Replace" if there else "Export")
            self.save.setEnabled(bool(self.sound.path.text().strip()))
            return
        try:
            files = self.batch.plan(export).files
        except ValueError as error:
            self.save.setText("Export")
            self.save.setEnabled(False)
            self._say(str(error), failed=True)
        else:
            self.save.setText(f"Export {files} file{'s' if files > 1 else ''}")
            self.save.setEnabled(True)
            self._say(f"{_RECIPE_NOTE} {INDEX} lists them with peaks and errors.")

    # Work

    def _start(self) -> None:
        export = self.export_choices()
        self.show_folder.hide()
        if self._is_batch:
            plan = self.batch.plan(export)
            self._shown_folder = plan.folder
            self._run(lambda tell, cancelled: run_batch(plan, tell, cancelled), self._tell_batch)
            return
        preset, choices, paths = self._preset, self._choices, self.sound.paths()
        self._shown_folder = next(iter(paths.values())).parent

        def work(tell: Callable[..., None], cancelled: Callable[[], bool]) -> list[WavReport]:
            return export_chosen(preset, choices, export, paths, lambda share: tell(share, "Rendering"), cancelled)

        self._run(work, self._tell_sound)

    def _run(self, work: Work, told: Callable[..., None]) -> None:
        self._job = ExportJob(work)
        self._job.progressed.connect(self._tell_progress)
        self._job.finished.connect(told)
        self._job.failed.connect(lambda message: self._end(message, failed=True))
        self._job.cancelled.connect(self._tell_cancelled)
        for part in (self.tabs, self.sound, self.batch, self.form, self.save):
            part.setEnabled(False)
        self.close_button.setText("Cancel")
        self.bar.setValue(0)
        self.bar.show()
        self._say("Rendering …")
        self._job.start()

    def _tell_progress(self, share: float, text: str, left_s: float | None) -> None:
        self.bar.setValue(round(1000 * share))
        left = "" if left_s is None else f", about {duration(left_s)} left"
        self._say(f"{text}{left}")

    def _tell_cancelled(self) -> None:
        kept = "finished files are kept; export again to resume." if self._is_batch else "no file was written."
        self._end(f"Cancelled; {kept}")

    def _tell_sound(self, reports: list[WavReport]) -> None:
        lines = []
        for report in reports:
            level = f"peak {report.peak_db:.1f} dBFS, {report.clipped} clipped"
            lines.append(f"Saved {report.path} ({report.seconds:.2f} s, {level}).")
        if past_s := max(report.past_training_s for report in reports):
            lines.append(f"The last {past_s:.2f} s lie past the model's training; a marker says where it ends.")
        if not reports[0].decayed:
            lines.append("Not decayed at the maximum length: faded out there.")
        if any(report.clipped for report in reports):
            lines.append("Clipped: lower the amplitude, normalise, or choose floating point.")
        self._end("\n".join(lines), saved=True)

    def _tell_batch(self, rows: list[BatchRow]) -> None:
        counts = Counter(row.status for row in rows)
        text = f"{counts['written']} files written, {counts['kept']} kept, {counts['failed']} failed."
        clipped = sum(row.clipped or 0 for row in rows)
        peaks = [row.peak_db for row in rows if row.peak_db is not None]
        level = f" Loudest peak {max(peaks):.1f} dBFS, {clipped} samples clipped." if peaks else ""
        messages = list(dict.fromkeys(row.message for row in rows if row.message))
        failed = f"\n{messages[0]}" + (f"\n… {INDEX} has the others" if len(messages) > 1 else "") if messages else ""
        self._end(f"{text}{level}{failed}", failed=bool(messages), saved=True)

    def _end(self, text: str, failed: bool = False, saved: bool = False) -> None:
        if self._job is not None:
            self._job.wait()
            self._job = None
        self.bar.hide()
        for part in (self.tabs, self.sound, self.batch, self.form, self.save):
            part.setEnabled(True)
        self.close_button.setText("Close")
        self._update()
        self._say(text, failed)
        self.show_folder.setVisible(saved)

    def _say(self, text: str, failed: bool = False) -> None:
        self.state.setObjectName("warning" if failed else "faint")
        self.state.style().polish(self.state)
        self.state.setText(text)

    def _open_folder(self) -> None:
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._shown_folder))):
            self._say(f"No file manager was found here; the folder is {self._shown_folder}.")

    def _cancel_or_close(self) -> None:
        if self._job is not None:
            self._job.cancel()
        else:
            self.accept()

    def reject(self) -> None:
        self._cancel_or_close()

    def closeEvent(self, event: QCloseEvent) -> None:
        if self._job is not None:
            self._job.cancel()
            self._job.wait()
        super().closeEvent(event)
