"""The button that opens the menu says what is in it."""

from __future__ import annotations

from pytestqt.qtbot import QtBot

from app.views.controls.app_menu import AppMenu, menu_button


def test_the_tip_names_what_the_menu_opens(qtbot: QtBot) -> None:
    menu = AppMenu()
    button = menu_button(menu)
    qtbot.addWidget(menu)
    qtbot.addWidget(button)
    tip = button.toolTip().lower()
    for action in menu.asked:
        words = action.text().split("\t")[0].rstrip(" …").lower()
        if "…" in action.text():
            assert words.removesuffix(" settings") in tip, words
