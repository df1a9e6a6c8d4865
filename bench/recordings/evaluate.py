"""The errors of a folder's recordings, each learned alone, with linear baselines and an unseen half.

The baselines are linear: one and two poles a partial, of the same series, without glide and without free poles. The
unseen half is the part from 1.25 s to the end of the fit, after a fit of the first 1.25 s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.compare.relative import error_to_signal
from training.cli.console import ProgressReport
from training.recording.fit import LearnedNote, fit_note
from training.recording.gate import examine
from training.recording.note import RecordingError, note_of
from training.recording.numbering import number_note
from training.recording.report import errors_of

HALF_S = 1.25


@dataclass(frozen=True)
class NoteErrors:
    """The errors of a recording; None where it was refused, or not measured.

    Attributes:
        gate: the findings, or the reason of the refusal.
        esr, late_esr, distance_db: of the own note, the second from 50 ms on, the third log spectral.
        one_pole, two_poles: ESR of linear poles for each partial.
        half, half_two_poles: ESR of the unseen half, and that of two linear poles.
    """

    recording: str
    gate: str
    esr: float | None = None
    late_esr: float | None = None
    distance_db: float | None = None
    one_pole: float | None = None
    two_poles: float | None = None
    half: float | None = None
    half_two_poles: float | None = None


@dataclass(frozen=True)
class Figure:
    """Median and 90th percentile of a figure over the recordings that have it."""

    figure: str
    median: float
    at_90_percent: float
    count: int


def measure(
    recordings: Mapping[str, tuple[NDArray[np.float64], int]], quick: bool, report: ProgressReport
) -> dict[str, Any]:
    """Learn all recordings.

    Args:
        recordings: samples and rate by name.
        quick: leaves out baselines and halves.
    """
    found = []
    for number, (name, (samples, rate_hz)) in enumerate(recordings.items()):
        report(number / len(recordings), name)
        try:
            found.append(_errors(name, samples, rate_hz, quick))
        except RecordingError as error:
            found.append(NoteErrors(name, str(error)))
    return {"recordings": tuple(found), "figures": _figures(found)}


def _errors(name: str, samples: NDArray[np.float64], rate_hz: int, quick: bool) -> NoteErrors:
    note = note_of(samples, rate_hz)
    series = number_note(note)
    findings = examine(samples, note, series)
    kinds = ", ".join(each.kind for each in findings) or "one note"
    if series is None or not series.present or any(each.refused for each in findings):
        raise RecordingError(f"refused: {kinds}")
    truth = note.fitted()
    t = np.arange(len(truth)) / note.rate_hz
    linear = partial(fit_note, note, series, free=0, glides=False)

    def error(learned: LearnedNote, begin_s: float = 0.0) -> float:
        first = round(begin_s * note.rate_hz)
        return error_to_signal(learned.render(t[first:]), truth[first:])

    errors = errors_of(truth, fit_note(note, series).render(t), note.rate_hz, note.noise_power)
    found: list[float | None] = [errors.esr, errors.esr_from_50_ms, errors.log_spectral_distance_db]
    if not quick:
        found += [error(linear(poles_a_partial=count)) for count in (1, 2)]
        if len(truth) > 1.3 * HALF_S * note.rate_hz:
            half = fit_note(note, series, seconds=HALF_S)
            linear_half = linear(seconds=HALF_S, poles_a_partial=2)
            found += [error(half, HALF_S), error(linear_half, HALF_S)]
    return NoteErrors(name, kinds, *found)


def _figures(found: Sequence[NoteErrors]) -> tuple[Figure, ...]:
    figures = []
    for each in fields(NoteErrors)[2:]:
        values = [value for one in found if (value := getattr(one, each.name)) is not None]
        if values:
            percentile = float(np.percentile(values, 90))
            figures.append(Figure(each.name, float(np.median(values)), percentile, len(values)))
    return tuple(figures)
