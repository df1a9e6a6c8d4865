"""The export of a patch for samplers, as the window runs it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.export.sampled.job import export_sampled, note_renderer
from app.export.sampled.plan import SampledPlan
from app.export.sampled.words import SMALLEST_REPORTED_DB, megabytes, notes, number_of, pitch_words
from app.shared.worker import Progress
from engine.presets import load_preset


@dataclass(frozen=True)
class SampledExport:
    """The export of an instrument for samplers. See `ExportJob`.

    Attributes:
        preset: the file of the preset that plays the patch.
    """

    plan: SampledPlan
    out: Path
    preset: Path

    @property
    def folder(self) -> Path:
        return self.out.parent

    def run(self, progress: Progress) -> str:
        progress(0.0, "Loading the model")
        plan = self.plan
        report = export_sampled(
            plan, self.out, note_renderer(load_preset(self.preset), plan.source), progress=progress
        )
        samples = f"{number_of(report.samples, 'sample')}, {megabytes(report.size_bytes)}"
        alike = ", as loud as the instrument" if abs(report.gain_db) < SMALLEST_REPORTED_DB else ""
        level = f"peak {report.peak_db:.1f} dBFS{alike}"
        lines = [f"Saved {report.path} ({samples}, {level}, {pitch_words(plan.pitch_error_cents)})."]
        lines += [f"{note[0].upper()}{note[1:]}." for note in notes(plan, report, "Dry leaves")]
        return "\n".join(lines)

    def cancelled(self) -> str:
        return "nothing was written."
