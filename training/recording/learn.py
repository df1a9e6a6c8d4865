"""Notes, from samples to all that is learned of them: what a window's dialog and the command call.

Of several recordings of one instrument the first gives the string and the recorded note. Takes of its pitch share
their poles (`fit.fit_takes`), and the medians of their partials' levels. Notes of every pitch share the smooth decay.
So one take's accident does not become the instrument's.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from engine.resonators.base import Array
from engine.resonators.recorded import OF_PARTIALS, RecordedString
from training.recording.checkpoint import checkpoint_of
from training.recording.fit import LearnedNote, fit_takes
from training.recording.gate import Finding, examine
from training.recording.note import Note, RecordingError, note_of
from training.recording.numbering import PartialSeries, apart_cents, number_note
from training.recording.physics import Kind, LearnedPhysics, Strung, corrections, physics_of, strung
from training.recording.preset import Source, recorded_note, recorded_string
from training.recording.report import FitReport, figures, report_of
from training.recording.verdict import Verdict, verdict_of

Progress = Callable[[float], None]

SAME_PITCH_CENTS = 60.0  # of two recordings: below it they are takes of one note


class Refused(RecordingError):
    """The gate's refusal: each reason in words, with what to do."""

    def __init__(self, name: str, findings: tuple[Finding, ...]) -> None:
        super().__init__(f"{name}: " + "; ".join(f"{finding.reason}: {finding.remedy}" for finding in findings))


class NotFound(RecordingError):
    """A fit in which no string was found."""

    def __init__(self, name: str, verdict: Verdict) -> None:
        super().__init__(f"{name}: {verdict.words}; record one plucked note alone")


@dataclass(frozen=True)
class Learned:
    """The results learned from one recording.

    Attributes:
        strung: the string in a chosen length and gauge.
        findings: what speaks against the recording: warnings, and refusals that were overruled.
        seconds: from the call of `learn` until it was learned.
    """

    source: Source
    note: Note
    series: PartialSeries
    fitted: LearnedNote
    physics: LearnedPhysics
    strung: Strung
    report: FitReport
    verdict: Verdict
    findings: tuple[Finding, ...]
    seconds: float


@dataclass(frozen=True)
class Examined:
    """A recording before it is learned: its note, its series of partials, and what speaks against it."""

    note: Note
    series: PartialSeries | None
    findings: tuple[Finding, ...]

    @property
    def refusals(self) -> tuple[Finding, ...]:
        """The findings of which one is enough: it cannot be fitted."""
        return tuple(finding for finding in self.findings if finding.refused)


def examined(samples: Array, rate_hz: int) -> Examined:
    """Examine a recording, as `learn` does first.

    Raises:
        RecordingError: it is no recording of one note in any case.
    """
    note = note_of(samples, rate_hz)
    series = number_note(note)
    return Examined(note, series, examine(samples, note, series))


def learn(
    recordings: Sequence[tuple[Examined, Source]],
    *,
    kind: Kind = "guitar",
    length_m: float | None = None,
    gauge_mm: float | None = None,
    anyway: bool = False,
    progress: Progress = lambda share: None,
    checkpoints: Path | None = None,
) -> list[Learned]:
    """Learn recordings of one instrument: those of the first's pitch jointly, each other alone.

    Args:
        recordings: each with its file; the first gives the string.
        anyway: whether it continues where the gate refuses.
        progress: is called with the share that is done; may raise, to cancel.
        checkpoints: a folder of unfinished fits, from which the same call continues with the same result.

    Raises:
        RecordingError: nothing can be learned from one; the message names its file.
        Refused: the gate says that one cannot be fitted.
        SchemaError: a checkpoint is damaged; the message names it.
        WriteError, OSError: a checkpoint cannot be written or read.
    """
    started = time.monotonic()
    # the lead is the first recording; takes are those of its pitch, others the rest, by place in `recordings`
    notes = [usable(examined, anyway, source.name) for examined, source in recordings]
    lead = notes[0][1]
    takes = [place for place, (_, series) in enumerate(notes) if apart_cents(lead, series) < SAME_PITCH_CENTS]
    others = [place for place in range(len(notes)) if place not in takes]
    fitted: dict[int, LearnedNote] = {}
    unfinished: list[Path] = []
    for job in (takes, *([place] for place in others)):
        part = partial(_part, progress, len(fitted) / len(notes), len(job) / len(notes))
        chosen = [notes[place] for place in job]
        path = None if checkpoints is None else checkpoint_of(checkpoints, chosen)
        fitted |= dict(zip(job, fit_takes(chosen, progress=part, checkpoint=path), strict=True))
        unfinished += [path] if path is not None else []
    learned = []
    for place, (examined, source) in enumerate(recordings):
        (note, series), fit = notes[place], fitted[place]
        physics = physics_of(fit)
        string = strung(physics, kind, length_m, gauge_mm)
        report = report_of(note, fit, physics)
        verdict = verdict_of(note, series, fit, report)
        seconds = time.monotonic() - started
        learned.append(
            Learned(source, note, series, fit, physics, string, report, verdict, examined.findings, seconds)
        )
    progress(1.0)
    for path in unfinished:
        path.unlink(missing_ok=True)
    return learned


def combined(learned: Sequence[Learned], settings: dict[str, Any]) -> RecordedString:
    """The additions of all recordings to the string of the first; `settings`: of the fit, kept with them.

    Smooth decays are averaged over all. Corrections of partials are medians over takes of the first's pitch.
    """
    first = learned[0]
    note = recorded_note(first.note, first.fitted, first.source)
    first_string = recorded_string(note, first.physics, first.strung, first.source, settings, figures(first.report))
    if len(learned) == 1:
        return first_string
    hz = np.log(first_string.smooth_hz)
    smooth = [np.log(first_string.smooth_ratio)]
    same = []
    for take in learned[1:]:
        lower = first.physics.f0_hz / take.physics.f0_hz
        string = first.strung.string
        own = corrections(take.physics, replace(string, length_m=string.length_m * lower))
        smooth.append(np.interp(hz, np.log(own["smooth_hz"]), np.log(own["smooth_ratio"])))
        if abs(1200 * math.log2(lower)) < SAME_PITCH_CENTS:
            same.append(own)
    shared: dict[str, Any] = {
        name: tuple(
            float(np.median([own_value, *(take[name][place] for take in same if place < len(take[name]))]))
            for place, own_value in enumerate(getattr(first_string, name))
        )
        for name in OF_PARTIALS
    }
    return replace(first_string, smooth_ratio=tuple(np.exp(np.mean(smooth, axis=0)).tolist()), **shared)


def _part(progress: Progress, done: float, share: float, of_part: float) -> None:
    """Report a part of the work that is a `share` of all and begins at `done`; fits are 0.95 of all."""
    progress(0.95 * (done + share * of_part))


def usable(examined: Examined, anyway: bool, name: str) -> tuple[Note, PartialSeries]:
    """The note and series of what was examined. Raises Refused or RecordingError, which name its file."""
    if examined.refusals and not anyway:
        raise Refused(name, examined.refusals)
    if examined.series is None or not examined.series.present:
        raise RecordingError(f"{name}: it has no partials; record one plucked note")
    return examined.note, examined.series


def require_found(learned: Sequence[Learned]) -> None:
    """Raise NotFound, which names the file, where a fit is of no string."""
    for string in learned:
        if not string.verdict.found:
            raise NotFound(string.source.name, string.verdict)
