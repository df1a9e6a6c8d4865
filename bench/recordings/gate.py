"""Shares of sounds that are kept and refused: notes as users record them, and sounds that are no note of a string.

A sound is refused before the fit, or by the verdict on the fit. Fits take seconds, so only some sounds may be fitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bench.recordings.sounds import Case, Recordings, cases, is_judged
from training.cli.console import ProgressReport
from training.recording.fit import fit_note
from training.recording.learn import examined
from training.recording.note import RecordingError
from training.recording.physics import physics_of
from training.recording.report import report_of
from training.recording.verdict import verdict_of

JUDGED_SEED = 95_000  # of sounds that no threshold was set on
KEPT, REFUSED, NOT_FOUND, PASSED = "kept", "refused", "not found", "passed, not fitted"


@dataclass(frozen=True)
class Outcome:
    """The end of a case, and the reason."""

    base: str
    kind: str
    is_note: bool
    end: str
    reason: str = ""


@dataclass(frozen=True)
class KindShare:
    """The ends of a kind of sound: refused by the gate, fitted, without a string, kept."""

    kind: str
    count: int
    refused: int
    fitted: int
    no_string_found: int
    kept: int


def measure(recordings: Recordings, count: int, every: int, report: ProgressReport) -> dict[str, Any]:
    """Examine judged recordings and seeds.

    Args:
        every: all that is no note and passes the gate is fitted, and one of so many notes; 0: nothing is.
    """
    judged = {name: sound for name, sound in recordings.items() if is_judged(name)}
    found: list[Outcome] = []
    for case in cases(judged, count, JUDGED_SEED):
        fitted = every > 0 and (not case.is_note or len(found) % every == 0)
        found.append(Outcome(case.base, case.kind, case.is_note, *_end(case, fitted)))
        report(min(0.99, len(found) / (16 * len(judged) + 5 * count)))
    kinds = []
    for is_note, total in ((True, "all notes"), (False, "all others")):
        ours = [each for each in found if each.is_note == is_note]
        for kind in [*sorted({each.kind for each in ours}), total]:
            ends = [each.end for each in ours if kind in (each.kind, total)]
            fits = ends.count(KEPT) + ends.count(NOT_FOUND)
            shares = len(ends), ends.count(REFUSED), fits, ends.count(NOT_FOUND), ends.count(KEPT)
            kinds.append(KindShare(kind, *shares))
    wrong = tuple(each for each in found if each.end in ((REFUSED, NOT_FOUND) if each.is_note else (KEPT,)))
    return {"kinds": tuple(kinds), "wrong": wrong}


def _end(case: Case, fitted: bool) -> tuple[str, str]:
    """Examine a case, and learn it where it is `fitted`, as the command does."""
    try:
        found = examined(*case.sound)
    except RecordingError as error:
        return REFUSED, str(error)
    if found.refusals:
        return REFUSED, ", ".join(each.kind for each in found.refusals)
    if not fitted:
        return PASSED, ""
    assert found.series is not None
    learned = fit_note(found.note, found.series)
    report = report_of(found.note, learned, physics_of(learned))
    verdict = verdict_of(found.note, found.series, learned, report)
    return KEPT if verdict.found else NOT_FOUND, verdict.words
