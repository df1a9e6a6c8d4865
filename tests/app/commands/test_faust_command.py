"""The command that writes a patch as a Faust program."""

from __future__ import annotations

from pathlib import Path


def test_the_command_writes_it(run, folder: Path) -> None:
    found = run("faust", "Concert harp", "--out", folder / "harp.dsp", "--modes", 20)
    assert found.status == 0
    assert found.out == f"{folder / 'harp.dsp'}: 20 modes\n"
    assert "damper = 0;" in (folder / "harp.dsp").read_text(encoding="utf-8")
    missing = run("faust", "No such instrument", "--out", folder / "a.dsp")
    assert missing.status == 1 and "No such instrument" in missing.err
    assert not (folder / "a.dsp").exists()
