from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QApplication

from tests.bench.cli import main


@pytest.fixture(autouse=True)
def undressed(qapp: QApplication) -> Iterator[None]:
    """The application as it was: a benchmark's window wears the theme."""
    sheet = qapp.styleSheet()
    yield
    qapp.setStyleSheet(sheet)


@pytest.fixture
def small_presets(qapp: QApplication, small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The presets, replaced by two small ones; no others of this machine."""
    folder = tmp_path / "presets"
    folder.mkdir()
    for name in ("first", "second"):
        shutil.copy(small_preset, folder / f"{name}.safetensors")
    monkeypatch.setattr("app.presets.library.SHIPPED", folder)
    monkeypatch.setattr("app.presets.library.user_folder", lambda: tmp_path / "none")


@dataclass(frozen=True)
class Outcome:
    """Exit status and output of a benchmark's command line."""

    status: int
    out: str
    err: str


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    """Run a benchmark's command line in this process."""

    def run(*words: object) -> Outcome:
        capsys.readouterr()
        status = main([str(word) for word in words])
        return Outcome(status, *capsys.readouterr())

    return run


@pytest.fixture
def bench(small_presets: None, capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Run a benchmark by its command; what it prints as JSON."""

    def bench(*words: object) -> Any:
        status = main([*map(str, words), "--json"])
        out, err = capsys.readouterr()
        assert status == 0, err or out
        return json.loads(out)

    return bench
