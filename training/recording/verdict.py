"""The verdict on a fit: whether one string was found in a recording.

Errors alone do not tell, for a drum is a sum of decaying poles as well. So the law of a string counts too: its loud
partials must lie where it has them, and hold the sound.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from engine.compare.relative import error_to_signal
from training.recording.fit import LearnedNote, fit_note
from training.recording.note import Note
from training.recording.numbering import PartialSeries
from training.recording.report import FitReport

MOST_ESR = 0.15  # besides the recording's noise
MOST_NOISE_ESR = 0.15
GOOD_ESR = 0.05  # up to it the linear poles may be as near
LOUD_DB = -40.0  # below the loudest partial
NEAR_CENTS = 25.0  # from the law: a partial that lies on it
PULLED_CENTS = 75.0  # so far a body pulls a partial from the law, often the loudest one
LEAST_LOUD = 2  # partials
LEAST_NEAR = 0.7  # of the loud partials
LEAST_ENERGY = 0.3  # of the recording's, in partials that belong to the law, pulled or not


@dataclass(frozen=True)
class Verdict:
    """The judgement of a learned note.

    Attributes:
        reasons: why no string was found, in words; empty: one was.
        esr, linear_esr: of the note, and of two linear poles a partial without glide and body.
        near: share of the loud partials that lie near the law.
        energy: in partials that belong to the law, pulled or not, over the recording's.
    """

    reasons: tuple[str, ...]
    esr: float
    linear_esr: float
    near: float
    energy: float

    @property
    def found(self) -> bool:
        return not self.reasons

    @property
    def words(self) -> str:
        """The verdict for people, in one line."""
        errors = f"error {self.esr:.3f}, of two linear poles a partial {self.linear_esr:.3f}"
        partials = f"{self.near:.0%} of the loud partials on its law"
        if self.found:
            return f"string found: {errors}; {partials}"
        return f"no string found: {'; '.join(self.reasons)} ({errors})"


def verdict_of(note: Note, series: PartialSeries, learned: LearnedNote, report: FitReport) -> Verdict:
    """Judge a note's fit by its errors, against a linear fit, and by its partials."""
    truth = note.fitted()
    t = np.arange(len(truth)) / note.rate_hz
    whole = max(float(truth @ truth), 1e-30)
    linear_esr = error_to_signal(fit_note(note, series, free=0, glides=False).render(t), truth)
    loud = [abs(partial.cents_from_law) < NEAR_CENTS for partial in report.partials if partial.level_db > LOUD_DB]
    of_law = {partial.number for partial in report.partials if abs(partial.cents_from_law) < PULLED_CENTS}
    sound = replace(learned, poles=tuple(pole for pole in learned.poles if pole.partial in of_law)).render(t)
    esr = report.errors.esr
    near, energy = float(np.mean(loud)) if loud else 0.0, float(sound @ sound) / whole
    reasons = []
    if esr > max(linear_esr, GOOD_ESR) or esr > MOST_ESR + min(report.errors.noise_esr, MOST_NOISE_ESR):
        reasons.append("what was learned is not the recording")
    if len(loud) < LEAST_LOUD or near < LEAST_NEAR or energy < LEAST_ENERGY:
        reasons.append("its loud partials are not those of one string")
    return Verdict(tuple(reasons), esr, linear_esr, near, energy)
