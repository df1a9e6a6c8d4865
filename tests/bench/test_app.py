from __future__ import annotations

import math

import pytest

from app.session.choices import Choices
from app.window.settings import Settings
from tests.bench.start import Starts


def test_bench_app_reports_every_figure_with_its_target(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    starts = Starts((1.0, 1.5, 1.2), (3.0, 3.3, 2.9))
    monkeypatch.setattr("tests.bench.app.measure_starts", lambda count, report: starts)
    for name, value in (("SETTLING_S", 0.1), ("SIZE", (900, 600)), ("PICTURE_S", 0.5)):
        monkeypatch.setattr(f"tests.bench.app.{name}", value)
    monkeypatch.setattr("tests.bench.app.Settings", lambda: Settings(choices=Choices(seconds=0.5)))
    found = bench("app", "--seconds", 0.3, "--starts", 3)
    figures = {figure["name"]: figure for figure in found["figures"]}
    assert figures["start to the first window"]["value"] == 1.2
    assert figures["start to the first window"]["worst"] == 1.5
    assert figures["start to the first playable pluck"]["value"] == 3.0
    assert {"picture while playing", "the window while playing", "the window with nothing playing"} <= set(figures)
    assert all(math.isfinite(figure["value"]) and figure["target"] >= 0 for figure in figures.values())
    assert figures["picture while playing"]["value"] > 0
    assert found["size"] == [900, 600]
    assert found["views"] == ["spectrum", "waveform"]
