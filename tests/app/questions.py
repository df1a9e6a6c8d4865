"""Answers to the questions of the app, by keys or by clicks."""

from collections.abc import Iterator
from contextlib import contextmanager

from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QMessageBox

_expected = 0  # blocks of `answered` that are open


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

    global _expected
    timer = QTimer(interval=20)
    timer.timeout.connect(look)
    timer.start()
    _expected += 1
    try:
        yield asked
    finally:
        _expected -= 1
        timer.stop()
    assert left == []


@contextmanager
def none_unanswered() -> Iterator[None]:
    """Within, a question outside of `answered` is an error, not a test that waits for ever."""
    show = QMessageBox.exec

    def shown(box: QMessageBox) -> int:
        if not _expected:
            raise AssertionError(f"a question that nobody answers: {box.windowTitle()}: {box.text()}")
        return show(box)

    QMessageBox.exec = shown  # type: ignore[method-assign, assignment]
    try:
        yield
    finally:
        QMessageBox.exec = show  # type: ignore[method-assign]
