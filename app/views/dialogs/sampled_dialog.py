"""The dialog that exports the patch as an instrument for samplers: size first, then progress, then the result.

It does not block the window: several minutes are for playing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import disk_usage

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QDialog, QHBoxLayout, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.export.files import ExportError
from app.export.sampled.choices import SampledChoices
from app.export.sampled.job import SampledReport, export_sampled, kept_samples, note_renderer
from app.export.sampled.plan import SampledPlan
from app.export.sampled.words import SMALLEST_TOLD_DB, counted, largest_bytes, megabytes, notes, number_of
from app.instrument.bodies import body_digest
from app.instrument.effects import body_problem
from app.patches.patch import Patch
from app.presets.library import PresetEntry
from app.shared.durations import duration
from app.shared.whole_file import explain
from app.views.controls.parts import label as wrapped
from app.views.dialogs.export_job import ExportJob
from app.views.dialogs.sampled_form import SampledForm
from engine.presets import PresetError, load_preset, preset_digest

RESUMES = "A cancelled export keeps its samples, and goes on from there the next time."


class SampledDialog(QDialog):
    """Follows the patch (`show_patch`) until it begins; remembers its last state in `choices`.

    Args:
        preset: the model that plays the patch.
    """

    def __init__(
        self, patch: Patch, preset: PresetEntry, choices: SampledChoices, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export instrument")
        self.setMinimumWidth(620)
        self._patch, self._preset = patch, preset
        self._digest = ""
        self._job: ExportJob | None = None
        self._out = Path()
        self.form = SampledForm(patch, choices)
        self.choices = self.form.choices
        self._lay_out()
        self.form.changed.connect(self._update)
        self.show_patch(patch, preset)

    def show_patch(self, patch: Patch, preset: PresetEntry) -> None:
        """Another patch, or the same that was turned; an export that has begun goes on with what it began with."""
        if preset != self._preset or not self._digest:
            try:
                self._digest = preset_digest(preset.path)
            except (OSError, PresetError):  # told when it is to be played
                self._digest = ""
        self._patch, self._preset = patch, preset
        if self._job is None:
            self.form.show_patch(patch, self.form.keys())
            self._update()

    def _lay_out(self) -> None:
        self.what = wrapped()
        self.size_text = wrapped(selectable=True)
        self.size_text.setMinimumHeight(18)
        self.state = wrapped("faint", RESUMES, selectable=True)
        self.state.setMinimumHeight(52)
        self.state.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.bar = QProgressBar(maximum=1000)
        self.bar.setAccessibleName("Progress")
        self.show_folder = QPushButton("Show in folder")
        self.show_folder.setToolTip("Open the folder of the instrument")
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
        for part in (self.what, self.form, self.size_text):
            column.addWidget(part)
        column.addWidget(self.bar)
        column.addWidget(self.state)
        column.addStretch(1)
        column.addLayout(buttons)
        self.bar.hide()
        self.show_folder.hide()

    def _plan(self) -> SampledPlan:
        body_sha256 = body_digest(self._patch.body.name)
        return replace(self.form.plan(), preset_sha256=self._digest, body_sha256=body_sha256)

    def _update(self) -> None:
        """What would be written. Nothing is, until it begins."""
        if self._job is not None:
            return
        self.show_folder.hide()
        problem = body_problem(self._patch)
        self.what.setText(f"{self._patch.name}, played by {self._preset.title}" + (f"\n{problem}" if problem else ""))
        try:
            plan, out = self._plan(), self.form.out
            kept, free = kept_samples(plan, out), disk_usage(out.parent).free
        except (ValueError, ExportError) as error:
            self._refuse(str(error))
            return
        except OSError as error:
            self._refuse(explain(self.form.out.parent, error))
            return
        there = out.is_file()
        size = largest_bytes(plan, out.suffix.lower() == ".sf2")
        short = f"; {megabytes(free)} are free there" if size > free else ""
        self.size_text.setText(f"{counted(plan)}, at most {megabytes(size)}{short}")
        self.save.setText("Replace" if there else "Continue" if kept else "Export")
        self.save.setEnabled(True)
        self._say(f"{kept} of {len(plan.zones)} samples are there already, and are kept." if kept else RESUMES)

    def _refuse(self, why: str) -> None:
        self.size_text.setText("")
        self.save.setText("Export")
        self.save.setEnabled(False)
        self._say(why, failed=True)

    # Work

    def _start(self) -> None:
        plan, out, preset = self._plan(), self.form.out, self._preset.path
        self._out = out

        def work(tell: Callable[..., None], cancelled: Callable[[], bool]) -> SampledReport:
            render = note_renderer(load_preset(preset), plan.source)
            return export_sampled(plan, out, render, progress=tell, cancelled=cancelled)

        self.show_folder.hide()
        self._job = ExportJob(work)
        self._job.progressed.connect(self._tell_progress)
        self._job.finished.connect(lambda report: self._tell_saved(plan, report))
        self._job.failed.connect(lambda message: self._end(message, failed=True))
        self._job.cancelled.connect(lambda: self._tell_cancelled(plan))
        for part in (self.form, self.save):
            part.setEnabled(False)
        self.close_button.setText("Cancel")
        self.bar.setValue(0)
        self.bar.show()
        self._say("Loading the model …")
        self._job.start()

    def _tell_progress(self, share: float, text: str, left_s: float | None) -> None:
        self.bar.setValue(round(1000 * share))
        left = "" if left_s is None else f", about {duration(left_s)} left"
        self._say(f"{text}{left}. You can play on meanwhile.")

    def _tell_cancelled(self, plan: SampledPlan) -> None:
        self._wait()
        try:
            kept = kept_samples(plan, self._out)
        except ExportError as error:
            self._end(str(error), failed=True)
            return
        told = f"{kept} of {len(plan.zones)} samples are kept; export again to go on from there."
        self._end(f"Cancelled; {told if kept else 'nothing was written.'}")

    def _tell_saved(self, plan: SampledPlan, report: SampledReport) -> None:
        kept = report.samples - report.rendered
        samples = f"{number_of(report.rendered, 'sample')} rendered, {kept} kept, {megabytes(report.size_bytes)}"
        alike = ", as loud as the patch" if abs(report.gain_db) < SMALLEST_TOLD_DB else ""
        level = f"peak {report.peak_db:.1f} dBFS{alike}"
        lines = [f"Saved {report.path} ({samples}, {level})."]
        for note in notes(plan, report, "Dry leaves"):
            lines.append(f"{note[0].upper()}{note[1:]}.")
        self._end("\n".join(lines), saved=True)

    def _wait(self) -> None:
        if self._job is not None:
            self._job.wait()
            self._job = None

    def _end(self, text: str, failed: bool = False, saved: bool = False) -> None:
        self._wait()
        self.bar.hide()
        self.form.setEnabled(True)
        self.close_button.setText("Close")
        self.show_patch(self._patch, self._preset)  # as it has been turned meanwhile
        self._say(text, failed)
        self.show_folder.setVisible(saved)

    def _say(self, text: str, failed: bool = False) -> None:
        self.state.setObjectName("warning" if failed else "faint")
        self.state.style().polish(self.state)
        self.state.setText(text)

    def _open_folder(self) -> None:
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._out.parent))):
            self._say(f"No file manager was found here; the folder is {self._out.parent}.")

    def _cancel_or_close(self) -> None:
        if self._job is not None:
            self._job.cancel()
        else:
            self.accept()

    def reject(self) -> None:
        self._cancel_or_close()

    def abandon(self) -> None:
        """Closes it, and waits for an export that has begun; samples that are whole are kept."""
        if self._job is not None:
            self._job.blockSignals(True)  # nobody is there to be told
            self._job.cancel()
        self._wait()
        self.accept()
