"""A row of buttons of which one is down."""

from __future__ import annotations

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.views.controls.segments import Segments


def test_only_another_choice_by_the_user_is_reported(qtbot: QtBot) -> None:
    segments = Segments("Shown", [("model", "Model", ""), ("truth", "Truth", ""), ("error", "Error", "")])
    qtbot.addWidget(segments)
    reported: list[str] = []
    segments.chosen.connect(reported.append)
    model, truth, _ = segments._group.buttons()
    for button in (model, truth, truth):
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert (segments.key, reported) == ("truth", ["truth"])
    segments.show_key("error")
    assert (segments.key, reported) == ("error", ["truth"])
