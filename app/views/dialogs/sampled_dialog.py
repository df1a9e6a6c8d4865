"""The dialog that exports the patch as an instrument for samplers: size first, then progress, then the result.

It does not block the window: several minutes are for playing.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from shutil import disk_usage

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QWidget

from app.export.files import ExportError
from app.export.sampled.choices import SampledChoices
from app.export.sampled.job import SampledReport, export_sampled, kept_samples, note_renderer
from app.export.sampled.plan import SampledPlan
from app.export.sampled.words import (
    SMALLEST_TOLD_DB,
    counted,
    megabytes,
    needed_bytes,
    notes,
    number_of,
    pitch_words,
    size_words,
)
from app.instrument.bodies import body_digest
from app.instrument.effects import body_problem
from app.patches.patch import Patch
from app.presets.library import PresetEntry
from app.shared.worker import Job
from app.views.controls.parts import label
from app.views.dialogs.job_dialog import JobDialog
from app.views.dialogs.sampled_form import SampledForm
from engine.presets import PresetError, load_preset, preset_digest
from engine.result_file import explain

SETTLE_MS = 150  # after the last change: a knob that is turned changes the patch at each step
RESUMES = "A cancelled export keeps its samples, and continues from there the next time."


class SampledDialog(JobDialog):
    """Follows the patch (`show_patch`) until it begins; remembers its last state in `choices`.

    Args:
        preset: the model that plays the patch.
    """

    def __init__(
        self, patch: Patch, preset: PresetEntry, choices: SampledChoices, parent: QWidget | None = None
    ) -> None:
        super().__init__("Export instrument", 620, parent, "You can play on meanwhile.")
        self._patch, self._preset = patch, preset
        self._digest = ""
        self.what = label()
        self.form = SampledForm(patch, choices)
        self.choices = self.form.choices
        self.size_text = label(selectable=True)
        self.size_text.setMinimumHeight(36)  # of two lines
        self._lay_out((self.what, self.form, self.size_text), (self.form,), state_height=52)
        self._settled = QTimer(self, singleShot=True, interval=SETTLE_MS)
        self._settled.timeout.connect(self._update)
        self.form.changed.connect(self._settled.start)
        self.show_patch(patch, preset)
        self._update()

    def show_patch(self, patch: Patch, preset: PresetEntry) -> None:
        """Another patch, or the same that was turned; an export that has begun continues with what it began with."""
        if preset != self._preset or not self._digest:
            try:
                self._digest = preset_digest(preset.path)
            except (OSError, PresetError):  # reported when it is to be played
                self._digest = ""
        self._patch, self._preset = patch, preset
        if not self._job.busy:
            problem = body_problem(patch)
            self.what.setText(f"{patch.name}, played by {preset.title}" + (f"\n{problem}" if problem else ""))
            self.form.show_patch(patch, self.form.keys())
            self._settled.start()

    def _show_choices(self) -> None:
        self.show_patch(self._patch, self._preset)  # as it has been turned meanwhile
        self._update()

    def _plan(self) -> SampledPlan:
        body_sha256 = body_digest(self._patch.body.name)
        return replace(self.form.plan(), preset_sha256=self._digest, body_sha256=body_sha256)

    def _update(self) -> None:
        """What would be written. Nothing is, until it begins."""
        self._settled.stop()
        if self._job.busy:
            return
        self.show_folder.hide()
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
        soundfont = out.suffix.lower() == ".sf2"
        short = f"; {megabytes(free)} are free there" if needed_bytes(plan, soundfont) > free else ""
        pitch = pitch_words(plan.pitch_error_cents)
        self.size_text.setText(f"{counted(plan)}, {size_words(plan, soundfont)}{short}; {pitch}")
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
        self._update()  # of choices that have not settled
        if not self.save.isEnabled():
            return
        plan, out, preset = self._plan(), self.form.out, self._preset.path

        def work(job: Job) -> SampledReport:
            render = note_renderer(load_preset(preset), plan.source)
            return export_sampled(plan, out, render, progress=job.progress)

        self._run(
            work,
            lambda report: self._tell_saved(plan, report),
            lambda: self._tell_cancelled(plan, out),
            out.parent,
            "Loading the model …",
        )

    def _tell_cancelled(self, plan: SampledPlan, out: Path) -> None:
        try:
            kept = kept_samples(plan, out)
        except ExportError as error:
            self._end(str(error), failed=True)
            return
        told = f"{kept} of {len(plan.zones)} samples are kept; export again to continue from there."
        self._end(f"Cancelled; {told if kept else 'nothing was written.'}")

    def _tell_saved(self, plan: SampledPlan, report: SampledReport) -> None:
        kept = report.samples - report.rendered
        samples = f"{number_of(report.rendered, 'sample')} rendered, {kept} kept, {megabytes(report.size_bytes)}"
        alike = ", as loud as the patch" if abs(report.gain_db) < SMALLEST_TOLD_DB else ""
        level = f"peak {report.peak_db:.1f} dBFS{alike}"
        lines = [f"Saved {report.path} ({samples}, {level}, {pitch_words(plan.pitch_error_cents)})."]
        for note in notes(plan, report, "Dry leaves"):
            lines.append(f"{note[0].upper()}{note[1:]}.")
        self._end("\n".join(lines), saved=True)
