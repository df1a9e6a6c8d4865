"""A question before work is lost. No key answers it with the loss: that takes a click, or Tab to its button."""

from __future__ import annotations

from PySide6.QtWidgets import QMessageBox, QWidget

Roles = QMessageBox.ButtonRole


def ask(parent: QWidget, title: str, question: str, stays: str, loses: str, keeps: str = "") -> str:
    """Return the words of the button that was pressed.

    Args:
        stays: changes nothing; Escape and the window's cross press it.
        loses: the work is lost.
        keeps: the work is kept, and what was asked for is done; Enter presses it. "": Enter presses `stays`.
    """
    box = QMessageBox(QMessageBox.Icon.Question, title, question, parent=parent)
    box.addButton(loses, Roles.DestructiveRole)
    stay = box.addButton(stays, Roles.RejectRole)
    box.setEscapeButton(stay)
    box.setDefaultButton(box.addButton(keeps, Roles.AcceptRole) if keeps else stay)
    box.exec()
    pressed = box.clickedButton()
    return stays if pressed is None else pressed.text()  # None: the app ends
