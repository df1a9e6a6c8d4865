from __future__ import annotations

import json

import pytest

from training.cli import console


def test_progress_off_a_terminal_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    monkeypatch.setattr(console.time, "monotonic", lambda: now[0])
    with console.progress("work") as report:
        for second in range(31):
            now[0] = float(second)
            report(second / 60, f"step {second}")
    assert capsys.readouterr().err.splitlines() == [
        "learned-strings: work: 17%, 50 s left step 10",
        "learned-strings: work: 33%, 40 s left step 20",
        "learned-strings: work: 50%, 30 s left step 30",
    ]


def test_progress_on_a_terminal_is_a_bar(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with console.progress("work") as report:
        report(0.5, "half", left_s=90)
    found = capsys.readouterr()
    assert found.out == ""
    assert "work" in found.err


def test_progress_shows_a_files_name_as_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with console.progress("[/b].mid by [red]") as report:
        report(0.5, "[/i]")
    assert "[/b].mid by [red]" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.025, "25 ms"),
        (0.25, "0.25 s"),
        (1 / 3, "0.333 s"),
        (1.0, "1 s"),
        (8.24, "8.24 s"),
        (200, "3 min 20 s"),
        (7500, "2 h 5 min"),
        (59.99, "1 min 0 s"),
        (31.9, "32 s"),
    ],
)
def test_durations_are_words(seconds: float, text: str) -> None:
    assert console.duration(seconds) == text


def test_json_is_valid_for_any_number(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_json({"a": [float("inf"), float("nan"), 1.5], "b": (1, None)})
    assert json.loads(capsys.readouterr().out) == {"a": [None, None, 1.5], "b": [1, None]}


def test_a_table_keeps_a_long_cell_on_its_line(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_table(("a", "b"), [("x" * 300, 1234.5678), ("y", None)])
    lines = capsys.readouterr().out.splitlines()
    assert any("x" * 300 in line and "1235" in line for line in lines)
    assert any("y" in line and "-" in line for line in lines)
