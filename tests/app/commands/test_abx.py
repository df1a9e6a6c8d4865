from __future__ import annotations

from pathlib import Path

from app.analysis.abx.record import HeardPluck, HeardSource, HeardThrough, make_record, save_record
from app.analysis.abx.text import as_text
from app.analysis.abx.trials import Run


def test_show_prints_the_record_and_refuses_a_broken_one(run, folder: Path) -> None:
    source = HeardSource(label="Model", preset="nylon", preset_sha256="0f" * 32, gain_db=0)
    pluck = HeardPluck(position=0.35, amplitude_mm=4, shape="gaussian", width=0.06, listen=0.37, seconds=2)
    through = HeardThrough(device="D", host_api="H", rate_hz=48_000, volume_db=0, restart_at_switch=True)
    test = Run(seed=1, planned=1).auditioned("X").answered("A", 1.0)
    record = make_record(test, source, source, pluck, through)
    path = save_record(folder, record)
    shown = run("abx", "show", path)
    assert (shown.status, shown.err) == (0, "")
    assert shown.out == as_text(record)
    path.write_bytes(path.read_bytes()[:-20])
    assert "not a JSON file, or cut short" in run("abx", "show", path).failure
    assert "No such file" in run("abx", "show", folder / "none.json").failure
