from __future__ import annotations

from pathlib import Path

from app.analysis.abx.record import AbxRecord, Candidate, as_text, save_record
from app.analysis.abx.trials import Run


def test_show_prints_the_result_and_refuses_a_broken_one(run, folder: Path) -> None:
    made = Candidate(label="Model", preset="nylon", preset_sha256="0f" * 32)
    test = Run(seed=1, planned=1).auditioned("X").answered("A", 1.0)
    record = AbxRecord(a=made, b=made, pluck={}, through={}, planned_trials=1, seed=1, trials=test.trials)
    path = save_record(folder, record)
    shown = run("abx", "show", path)
    assert (shown.status, shown.err) == (0, "")
    assert shown.out == as_text(record)
    path.write_bytes(path.read_bytes()[:-20])
    assert "or damaged" in run("abx", "show", path).failure
    assert "No such file" in run("abx", "show", folder / "none.json").failure
