"""The menu shows every action, and what undo and redo would change."""

from __future__ import annotations

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu
from pytestqt.qtbot import QtBot

from app.views.controls.app_menu import ENTRIES, MENUS, AppMenu


def test_every_entry_is_in_its_menu(qtbot: QtBot) -> None:
    made = AppMenu()
    qtbot.addWidget(made)
    menus = {action.text(): action.menu() for action in made.actions()}
    assert list(menus) == list(MENUS)
    for title, entries in MENUS.items():
        menu = menus[title]
        assert isinstance(menu, QMenu)
        shown: list[QAction] = menu.actions()
        assert [made.action[entry.name] for entry in entries] == shown[: len(entries)]
    assert len(made.action) == len(ENTRIES)


def test_it_says_what_undo_would_change(qtbot: QtBot) -> None:
    menu = AppMenu()
    qtbot.addWidget(menu)
    menu.show_steps("tension & length", "")
    assert menu.action["undo"].text() == "Undo: tension && length"
    assert menu.action["redo"].text() == "Redo"
