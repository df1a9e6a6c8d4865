"""What the window says while it cannot be played yet."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from app.window.main_window import COMPILING, LOADING, MainWindow


@pytest.mark.parametrize(("whole", "words"), [(True, LOADING), (False, COMPILING)])
def test_it_says_whether_the_sound_engine_has_to_be_compiled(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, whole: bool, words: str
) -> None:
    monkeypatch.setattr("engine.kernels.cache.is_whole", lambda: whole)
    window = MainWindow()
    qtbot.addWidget(window)
    assert words in [label.text() for label in window.findChildren(QLabel)]
