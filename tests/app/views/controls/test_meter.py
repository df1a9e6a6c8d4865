"""The meter is painted when its bar is another one, and not sixty times a second."""

from __future__ import annotations

import pytest
from pytestqt.qtbot import QtBot

from app.views.controls.meter import LIMIT_HOLD_TICKS, Meter


@pytest.fixture
def meter(qtbot: QtBot) -> Meter:
    made = Meter()
    qtbot.addWidget(made)
    made.resize(made.sizeHint())
    return made


def test_a_level_that_falls_slowly_is_painted_once_a_pixel(meter: Meter, monkeypatch: pytest.MonkeyPatch) -> None:
    painted: list[float] = []
    level_db = -10.0
    meter.show_level(level_db, False)
    monkeypatch.setattr(meter, "update", lambda: painted.append(level_db))
    while level_db > -20:
        level_db -= 0.11
        meter.show_level(level_db, False)
    pixels = meter._pixels(-10.0) - meter._pixels(level_db)
    assert len(painted) == pixels
    assert 10 < pixels < 20


def test_the_light_is_painted_when_it_comes_and_when_it_goes(meter: Meter, monkeypatch: pytest.MonkeyPatch) -> None:
    painted: list[bool] = []
    monkeypatch.setattr(meter, "update", lambda: painted.append(meter.limit_light))
    for limiting in (True, True, *[False] * (2 * LIMIT_HOLD_TICKS)):
        meter.show_level(-60.0, limiting)
    assert len(painted) == 2
