"""The export dialog: what to save and how; then progress, which can be cancelled, and the result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtWidgets import QTabBar, QWidget

from app.export.batch import INDEX, BatchRow, run_batch
from app.export.choices import ExportChoices
from app.export.files import WavReport
from app.presets.library import PresetEntry
from app.session.choices import Choices
from app.views.dialogs.chosen_sound import export_chosen
from app.views.dialogs.export_pages import BatchPage, SoundPage, as_heard
from app.views.dialogs.job_dialog import JobDialog
from app.views.dialogs.sound_form import SoundForm

_RECIPE_NOTE = "Each file stores its settings: drop it on the window to restore its preset and pluck."


class ExportDialog(JobDialog):
    """Offers first the source that is heard, and remembers its last state in `export_choices`.

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
        super().__init__("Export WAV", 680, parent)
        choices, export = as_heard(entries, choices, export)
        self._preset = next(entry for entry in entries if entry.name == choices.preset)
        self._choices, self._export = choices, export
        self.sound = SoundPage(self._preset, choices, export)
        self.batch = BatchPage(entries, choices, export)
        self.form = SoundForm(export, self._preset.info.rate_hz)
        self.tabs = QTabBar()
        self.tabs.setAccessibleName("What to export")
        self.tabs.setToolTip("One pluck, or many")
        self.tabs.addTab("This pluck")
        self.tabs.addTab("Batch")
        self.tabs.setDrawBase(False)
        self.tabs.setExpanding(False)
        choosers = (self.tabs, self.sound, self.batch, self.form)
        self._lay_out(choosers, choosers, state_height=34)
        self._say(_RECIPE_NOTE)
        for part in (self.sound, self.batch, self.form):
            part.changed.connect(self._show_choices)
        self.tabs.currentChanged.connect(self._turn)
        self.batch.hide()
        self._show_choices()

    def export_choices(self) -> ExportChoices:
        """The dialog's state."""
        folder = str(Path(self.sound.path.text()).parent)
        more = {"folder": folder, "source": self.sound.source.currentData(), "batch": self.batch.choices()}
        return ExportChoices.model_validate({**self._export.model_dump(), **self.form.choices(), **more})

    @property
    def _is_batch(self) -> bool:
        return self.tabs.currentIndex() == 1

    def _turn(self) -> None:
        """To the other page."""
        self.sound.setVisible(not self._is_batch)
        self.batch.setVisible(self._is_batch)
        self._say(_RECIPE_NOTE)
        self._show_choices()
        self.adjustSize()

    def _show_choices(self) -> None:
        if self._job.busy:
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
        if self._is_batch:
            plan = self.batch.plan(export)
            self._run(lambda job: run_batch(plan, job.progress), self._tell_batch, self._tell_cancelled, plan.folder)
            return
        preset, choices, paths = self._preset, self._choices, self.sound.paths()

        self._run(
            lambda job: export_chosen(preset, choices, export, paths, job.progress),
            self._tell_sound,
            self._tell_cancelled,
            next(iter(paths.values())).parent,
        )

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
