"""Shares of sounds that are kept and refused: notes as users record them, and sounds that are no note of a string.

A sound is refused before the fit, or by the verdict on the fit. Fits take seconds, so only some sounds may be fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tests.bench.recordings.sounds import Case, Recordings, cases, is_judged
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
    """What became of a case, and why."""

    case: Case
    end: str
    reason: str = ""


def outcome(case: Case, fitted: bool) -> Outcome:
    """Examine a case, and learn it where it is `fitted`, as the command does."""
    try:
        found = examined(*case.sound)
    except RecordingError as error:
        return Outcome(case, REFUSED, str(error))
    if found.refusals:
        return Outcome(case, REFUSED, ", ".join(each.kind for each in found.refusals))
    if not fitted:
        return Outcome(case, PASSED)
    assert found.series is not None
    learned = fit_note(found.note, found.series)
    report = report_of(found.note, learned, physics_of(learned))
    verdict = verdict_of(found.note, found.series, learned, report)
    return Outcome(case, KEPT if verdict.found else NOT_FOUND, verdict.words)


def outcomes(
    recordings: Recordings,
    count: int,
    every: int,
    *,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Outcome]:
    """The outcomes of judged recordings and seeds.

    Args:
        every: all that is no note and passes the gate is fitted, and one of so many notes; 0: nothing is.
    """
    judged = {name: sound for name, sound in recordings.items() if is_judged(name)}
    found: list[Outcome] = []
    for case in cases(judged, count, JUDGED_SEED):
        found.append(outcome(case, every > 0 and (not case.is_note or len(found) % every == 0)))
        progress(min(0.99, len(found) / (16 * len(judged) + 5 * count)))
    return found


def rows(found: list[Outcome]) -> list[tuple[str, int, int, int, int, int]]:
    """By kind, and of all notes and all others: how many, refused by the gate, fitted, string not found, kept."""
    table = []
    for is_note, total in ((True, "all notes"), (False, "all others")):
        ours = [each for each in found if each.case.is_note == is_note]
        for kind in [*sorted({each.case.kind for each in ours}), total]:
            ends = [each.end for each in ours if kind in (each.case.kind, total)]
            fitted = ends.count(KEPT) + ends.count(NOT_FOUND)
            table.append((kind, len(ends), ends.count(REFUSED), fitted, ends.count(NOT_FOUND), ends.count(KEPT)))
    return table


def as_data(found: list[Outcome]) -> list[dict[str, str | bool]]:
    """Each case as plain data."""
    return [
        {
            "base": each.case.base,
            "kind": each.case.kind,
            "note": each.case.is_note,
            "end": each.end,
            "why": each.reason,
        }
        for each in found
    ]
