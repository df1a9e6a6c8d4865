from __future__ import annotations

import threading
import warnings
from random import Random

import pytest
from PySide6.QtCore import qWarning

from app.bench.random_changes import Repertoire, random_change
from app.bench.soak import collected_faults
from app.session import Choices, Session

REPERTOIRE = Repertoire(("first", "second"), ("spectrum", "partials"), ("waveform", "compare"))


def test_a_short_soak_plucks_and_reports(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.bench.soak.EVERY_S", 0.1)
    found = bench("soak", "--minutes", 0.03, "--seed", 3)
    assert found["faults"] == []
    assert found["threads_left"] == []
    assert found["plucks"] > 2
    assert found["end_mib"] > 0
    assert found["drift_mib"] >= 0
    assert found["seed"] == 3


def test_random_changes_are_allowed_and_touch_everything() -> None:
    random, session = Random(1), Session()
    touched: set[str] = set()
    session.changed.connect(lambda names: touched.update(names))
    for _ in range(500):
        session.update(**random_change(random, session.choices, REPERTOIRE))
    assert touched == set(Choices.model_fields)


def test_the_same_seed_changes_the_same() -> None:
    def some(seed: int) -> list[object]:
        random = Random(seed)
        return [random_change(random, Choices(), REPERTOIRE) for _ in range(20)]

    assert some(5) == some(5)
    assert some(5) != some(6)


def test_faults_are_collected_once_each_with_their_number() -> None:
    def fail() -> None:
        raise ArithmeticError("a slip")

    with collected_faults() as faults:
        for _ in range(2):
            thread = threading.Thread(target=fail)
            thread.start()
            thread.join()
        qWarning("odd")
        warnings.warn("careful", stacklevel=1)
    told = sorted(faults.items(), key=lambda fault: -fault[1])
    assert told[0][1] == 2
    assert "ArithmeticError: a slip" in told[0][0]
    assert any(text == "Qt: odd" for text in faults)
    assert any("careful" in text for text in faults)
