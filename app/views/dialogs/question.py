"""Questions: for a text, or before work is lost. No key answers with the loss: a click does, or Tab to a button."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QInputDialog, QMessageBox, QWidget

from engine.plain_text import one_line
from engine.schema import explained

Roles = QMessageBox.ButtonRole


def ask(parent: QWidget, title: str, question: str, stays: str, loses: str, keeps: str = "") -> str:
    """Return the words of the button that was pressed.

    Args:
        stays: changes nothing; Escape and the window's cross press it.
        loses: the work is lost.
        keeps: the work is kept, and what was asked for is done; Enter presses it. "": Enter presses `stays`.
    """
    box = QMessageBox(QMessageBox.Icon.Question, title, question, parent=parent)
    box.setTextFormat(Qt.TextFormat.PlainText)  # it may quote a file's name
    box.addButton(loses, Roles.DestructiveRole)
    stay = box.addButton(stays, Roles.RejectRole)
    box.setEscapeButton(stay)
    box.setDefaultButton(box.addButton(keeps, Roles.AcceptRole) if keeps else stay)
    box.exec()
    pressed = box.clickedButton()
    return stays if pressed is None else pressed.text()  # None: the app ends


def ask_text(parent: QWidget | None, title: str, question: str, text: str, do: Callable[[str], object]) -> None:
    """Ask for a text and do what it is for; again, with the reason, where `do` raises ValueError."""
    reason = ""
    while True:
        text, typed_text = QInputDialog.getText(parent, title, f"{reason}{question}", text=text)
        if not typed_text:
            return
        try:
            do(text)
            return
        except ValueError as error:
            reason = f"{one_line(explained(error))}.\n\n"
