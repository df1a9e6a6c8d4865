"""The view of the error over time keeps every error on its axis."""

from __future__ import annotations

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from app.presets.library import Library
from app.session.choices import Session
from app.window.panels.error_time import ErrorTimePanel


@pytest.mark.parametrize("error", [3e-8, 1e-4, 0.5, 40.0])
def test_an_error_of_any_size_is_in_view(qtbot: QtBot, error: float) -> None:
    view = ErrorTimePanel(Session(), Library([]))
    qtbot.addWidget(view)
    view._stored_errors = {"mae": 5e-5}
    time_s = np.linspace(0.0, 2.0, 9)
    view.show_curves(time_s, {name: np.full(9, error) for name in ("rmse", "mae")} | {"level_db": np.zeros(9)})
    low, high = view.plot.getPlotItem().vb.viewRange()[1]
    assert low < np.log10(error) < high
