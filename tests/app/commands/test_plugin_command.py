"""The command `plugin`: bad requests are refused in words, before anything is compiled."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.commands.cli import main


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["No such harp"], "No such harp"),
        (["Concert harp", "--for", "amiga"], "amiga"),
        (["Concert harp", "--install", "--out", "x"], "--install"),
    ],
)
def test_bad_requests_are_refused(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plugin", *words]) != 0
    assert said in capsys.readouterr().err


def test_without_a_compiler_the_extra_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr("app.export.plugin.formats.find_spec", lambda name: None)
    assert main(["plugin", "Concert harp", "--out", str(tmp_path)]) == 1
    assert "learned-strings[plugin]" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
