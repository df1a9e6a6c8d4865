"""The menu says what would be undone, and the key what was."""

from __future__ import annotations

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QToolTip
from pytestqt.qtbot import QtBot

from app.session.choices import Choices
from app.window.controller import Controller

CONTROL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


def actions(controller: Controller) -> list[QAction]:
    menu = controller.window.menu
    menu.aboutToShow.emit()
    return [menu.action["undo"], menu.action["redo"]]


def test_the_menu_names_both_steps_and_takes_them(controller: Controller) -> None:
    assert [each.text() for each in actions(controller)] == ["Undo", "Redo"]
    controller.patches.choose("classical_guitar")
    controller.session.update(position=0.77)
    undo, redo = actions(controller)
    assert undo.text() == "Undo: pluck position"
    undo.trigger()
    assert controller.session.choices.position != 0.77
    undo, redo = actions(controller)
    assert undo.text() == "Undo: instrument Classical guitar"
    assert redo.text() == "Redo: pluck position"
    redo.trigger()
    assert controller.session.choices.position == 0.77


def test_the_key_says_what_it_has_done(qtbot: QtBot, controller: Controller) -> None:
    qtbot.waitUntil(controller.window.isActiveWindow)
    controller.session.update(width=0.2)
    for modifiers, reported in (
        (CONTROL, "Undone: pluck width"),
        (CONTROL, "Nothing to undo"),
        (CONTROL | SHIFT, "Redone: pluck width"),
    ):
        qtbot.keyClick(controller.window, Qt.Key.Key_Z, modifiers)
        assert QToolTip.text() == reported


def test_a_drag_whose_release_was_lost_takes_no_later_changes(qtbot: QtBot, controller: Controller) -> None:
    """As where a dialog takes the mouse: another widget, or none, hears that the button is up."""
    history, session = controller.history, controller.session
    knob = controller.window.transport.knobs["position"]
    middle = knob.rect().center()
    qtbot.mousePress(knob, Qt.MouseButton.LeftButton, pos=middle)
    for pixels in (4, 8):  # one step
        qtbot.mouseMove(knob, middle - QPoint(0, pixels))
    assert history.undo_words == "pluck position"
    dragged = session.choices.position
    assert dragged != Choices().position
    qtbot.mouseRelease(controller.window, Qt.MouseButton.LeftButton)
    session.update(amplitude_mm=7.0)
    session.update(width=0.2)
    for words in ("pluck width", "amplitude", "pluck position"):
        assert history.undo_words == words
        history.undo()
    assert not history.undo_words
    assert session.choices.position == Choices().position
