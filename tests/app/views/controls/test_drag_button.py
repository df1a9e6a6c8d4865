"""Pressed it is a button; dragged it takes files along, as soon as they are there, and is no click."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QDrag
from pytestqt.qtbot import QtBot

from app.views.controls.drag_button import DragButton

LEFT = Qt.MouseButton.LeftButton
FAR = QPoint(60, 10)


@pytest.fixture
def dropped(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Files of each drag that was begun."""
    found: list[list[str]] = []

    def take(drag: QDrag, actions: Qt.DropAction) -> Qt.DropAction:
        assert actions == Qt.DropAction.CopyAction  # never a move of the file
        found.append([url.toLocalFile() for url in drag.mimeData().urls()])
        return actions

    monkeypatch.setattr(QDrag, "exec", take)
    return found


@pytest.fixture
def button(qtbot: QtBot) -> DragButton:
    made = DragButton("Export")
    qtbot.addWidget(made)
    made.resize(80, 30)
    made.show()
    return made


def test_a_click_is_a_click(qtbot: QtBot, button: DragButton, dropped: list[list[str]]) -> None:
    asked: list[str] = []
    button.clicked.connect(lambda: asked.append("click"))
    button.drag_began.connect(lambda: asked.append("drag"))
    qtbot.mousePress(button, LEFT, pos=QPoint(10, 10))
    qtbot.mouseMove(button, QPoint(12, 10))
    qtbot.mouseRelease(button, LEFT, pos=QPoint(12, 10))
    assert asked == ["click"]
    assert dropped == []


def test_files_that_come_late_are_taken_by_the_next_movement(
    qtbot: QtBot, button: DragButton, dropped: list[list[str]], tmp_path: Path
) -> None:
    asked: list[str] = []
    button.clicked.connect(lambda: asked.append("click"))
    button.drag_began.connect(lambda: asked.append("began"))
    button.drag_ended.connect(lambda: asked.append("ended"))
    file = tmp_path / "a.wav"
    qtbot.mousePress(button, LEFT, pos=QPoint(10, 10))
    qtbot.mouseMove(button, FAR)
    assert (asked, dropped) == (["began"], [])
    button.carry([file])
    qtbot.mouseMove(button, FAR + QPoint(1, 0))
    assert (asked, dropped) == (["began", "ended"], [[str(file)]])
    qtbot.mouseMove(button, FAR + QPoint(2, 0))
    qtbot.mouseRelease(button, LEFT, pos=FAR)
    assert (asked, len(dropped)) == (["began", "ended"], 1)


def test_who_lets_go_before_takes_nothing(
    qtbot: QtBot, button: DragButton, dropped: list[list[str]], tmp_path: Path
) -> None:
    ended: list[None] = []
    button.drag_ended.connect(lambda: ended.append(None))
    qtbot.mousePress(button, LEFT, pos=QPoint(10, 10))
    qtbot.mouseMove(button, FAR)
    qtbot.mouseRelease(button, LEFT, pos=FAR)
    button.carry([tmp_path / "late.wav"])
    qtbot.mouseMove(button, FAR + QPoint(3, 0))
    assert len(ended) == 1
    assert dropped == []
