"""Answers to the questions of the app, by keys or by clicks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QMessageBox


@contextmanager
def answered(*answers: str | Qt.Key) -> Iterator[list[str]]:
    """Within, questions get these answers: a key, or a click on the button of these words. Yields their titles."""
    asked: list[str] = []
    left = list(answers)

    def look() -> None:
        box = QApplication.activeModalWidget()
        if not isinstance(box, QMessageBox):
            return
        asked.append(box.windowTitle())
        answer = left.pop(0) if left else Qt.Key.Key_Escape
        if isinstance(answer, Qt.Key):
            QTest.keyClick(box.focusWidget() or box, answer)
        else:
            next(each for each in box.findChildren(QAbstractButton) if each.text() == answer).click()

    timer = QTimer(interval=20)
    timer.timeout.connect(look)
    timer.start()
    yield asked
    timer.stop()
    assert left == []
