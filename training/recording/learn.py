"""One note, from samples to all that is learned of it: what a window's dialog and the command call."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.recording.fit import FREE_POLES, LearnedNote, fit_note
from training.recording.gate import Finding, examine
from training.recording.note import FIT_LASTS_S, Note, RecordingError, note_of
from training.recording.numbering import Series, number_note
from training.recording.physics import Kind, Physics, Strung, physics_of, strung
from training.recording.preset import Source
from training.recording.report import Report, report_of

Array = NDArray[np.float64]
Progress = Callable[[float], None]


class Refused(RecordingError):
    """The gate's refusal: each reason in words, with what to do."""

    def __init__(self, findings: tuple[Finding, ...]) -> None:
        super().__init__("; ".join(f"{each.reason}: {each.remedy}" for each in findings))
        self.findings = findings


@dataclass(frozen=True)
class Learned:
    """All that is learned of one recording.

    Attributes:
        findings: what the gate found, and was overruled on.
    """

    source: Source
    note: Note
    series: Series
    fitted: LearnedNote
    physics: Physics
    strung: Strung
    report: Report
    findings: tuple[Finding, ...]
    seconds: float


@dataclass(frozen=True)
class Examined:
    """A recording before it is learned: its note, its series of partials, and what speaks against it."""

    note: Note
    series: Series | None
    findings: tuple[Finding, ...]


def examined(samples: Array, rate_hz: int) -> Examined:
    """Examines a recording, as `learn` does first.

    Raises:
        RecordingError: it is no recording of one note in any case.
    """
    note = note_of(samples, rate_hz)
    series, peaks = number_note(note)
    return Examined(note, series, examine(samples, note, series, peaks))


def learn(
    samples: Array,
    rate_hz: int,
    source: Source,
    *,
    kind: Kind = "guitar",
    length_m: float | None = None,
    gauge_mm: float | None = None,
    anyway: bool = False,
    fit_s: float = FIT_LASTS_S,
    progress: Progress = lambda share: None,
) -> Learned:
    """Learns a recording.

    Args:
        samples: (frames,) or (frames, channels), ±1 being full scale.
        anyway: whether it continues where the gate refuses.
        progress: is called with the share that is done; may raise, to cancel.

    Raises:
        RecordingError: nothing can be learned from it.
        Refused: the gate says that it is not one note of a string.
    """
    started = time.monotonic()
    found = examined(samples, rate_hz)
    note, series, findings = found.note, found.series, found.findings
    progress(0.05)
    if findings and not anyway:
        raise Refused(findings)
    if series is None or not series.present:
        raise RecordingError("it has no partials; record one plucked note")
    fitted = fit_note(
        note, series, seconds=fit_s, free=FREE_POLES, progress=lambda share: progress(0.05 + 0.85 * share)
    )
    physics = physics_of(fitted)
    chosen = strung(physics, kind, length_m, gauge_mm)
    report = report_of(note, fitted, physics)
    progress(1.0)
    return Learned(source, note, series, fitted, physics, chosen, report, findings, time.monotonic() - started)
