from __future__ import annotations

import pytest

from app.analysis.abx.record import AbxRecord, Candidate
from app.analysis.abx.trials import ListeningTest


def finished(planned: int, right: int, answered: int | None = None) -> ListeningTest:
    """A run in which the first `right` answers are right."""
    run = ListeningTest(seed=5, planned=planned)
    for place in range(planned if answered is None else answered):
        x = run.heard_as("X")
        other = "B" if x == "A" else "A"
        run = run.auditioned("A").auditioned("X").answered(x if place < right else other)
    return run


def record_of(run: ListeningTest) -> AbxRecord:
    a, b = (
        Candidate(label=label, preset="nylon", preset_sha256="0f" * 32, gain_db=gain_db)
        for label, gain_db in (("Model", -0.5), ("Truth", 0.0))
    )
    return AbxRecord(
        a=a,
        b=b,
        pluck={"position": 0.35, "shape": "gaussian"},
        through={"device": "Headphones"},
        planned_trials=run.planned,
        seed=run.seed,
        trials=run.trials,
    )


@pytest.fixture
def record() -> AbxRecord:
    """9 right of 10."""
    return record_of(finished(10, 9))


@pytest.fixture
def stopped() -> AbxRecord:
    """Stopped after 4 of 10."""
    return record_of(finished(10, 3, answered=4))
