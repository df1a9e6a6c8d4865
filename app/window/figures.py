"""Figures, saved and copied: pictures as PNG and SVG, data as CSV. A right click, the menu key or the menu offers it.

What is saved is taken at the command: a take may grow while a file is chosen.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QPointF, Qt
from PySide6.QtGui import QContextMenuEvent, QGuiApplication, QImage, QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QAbstractScrollArea, QApplication, QMenu

from app.export.columns import Columns
from app.presets.library import Library
from app.stage.session import Session
from app.views.controls.form import FILTERS
from app.views.figure import png, svg
from app.window.exports import heard_note
from app.window.main_window import MainWindow
from app.window.panels.base import Panel
from engine.whole_file import WriteError, result_file

NOTHING = "{}: there is nothing to save yet; play a note first."
Event = QEvent.Type


class Figures(QObject):
    """The figures of all panels, with a menu each."""

    def __init__(self, window: MainWindow, session: Session, library: Library) -> None:
        super().__init__(window)
        self._window, self._session, self._library = window, session, library
        self._panels: dict[QObject, Panel] = {}  # by what the pointer or the keyboard is on
        self._menus: dict[Panel, QMenu] = {}
        self._pressed = QPointF()
        window.menu.aboutToShow.connect(self._offer_shown)

    def add(self, panel: Panel) -> None:
        """Offer what a panel shows."""
        figure = panel.figure
        menu = self._menus[panel] = QMenu(panel.title, figure)
        for words, do in (
            ("Save picture as PNG …", lambda: self._save(panel, ".png", png(figure))),
            ("Save picture as SVG …", lambda: self._save(panel, ".svg", svg(figure))),
            ("Copy picture", lambda: self._copy_picture(panel)),
            ("Save data as CSV …", partial(self._with_data, panel, self._save_data)),
            ("Copy data as CSV", partial(self._with_data, panel, self._copy_data)),
        ):
            menu.addAction(words).triggered.connect(lambda _=False, do=do: do())
        for part in (figure, *([figure.viewport()] if isinstance(figure, QAbstractScrollArea) else [])):
            self._panels[part] = panel
            part.installEventFilter(self)

    def _offer_shown(self) -> None:
        """Show the menus of the figures that can be seen in the window's menu."""
        self._window.menu.figures.clear()
        for panel, menu in self._menus.items():
            if panel.isVisible() and not panel.covered:
                self._window.menu.figures.addMenu(menu)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Open the menu by a key, or by a right click; a right button that drags pans."""
        panel = self._panels.get(watched)
        if panel is None:
            return False
        figure, menu, right = panel.figure, self._menus[panel], Qt.MouseButton.RightButton
        is_context = isinstance(event, QContextMenuEvent)  # which some systems send with the press of the button
        by_reader = isinstance(event, QContextMenuEvent) and event.reason() == QContextMenuEvent.Reason.Other
        if by_reader or (isinstance(event, QKeyEvent) and event.type() == Event.KeyPress and _is_menu_key(event)):
            menu.popup(figure.mapToGlobal(figure.rect().center()))
            return True
        if isinstance(event, QMouseEvent) and event.button() == right:
            if event.type() == Event.MouseButtonPress:
                self._pressed = event.globalPosition()
            moved = (event.globalPosition() - self._pressed).manhattanLength()
            if event.type() == Event.MouseButtonRelease and moved < QApplication.startDragDistance():
                menu.popup(event.globalPosition().toPoint())
        return is_context

    def _copy_picture(self, panel: Panel) -> None:
        """Copy both kinds: each program takes the one that it knows."""
        clipboard = QGuiApplication.clipboard()
        clipboard.setImage(QImage.fromData(png(panel.figure)))
        # to Qt's own data: what is made in Python ends too early, and the app's end would be a crash
        clipboard.mimeData().setData("image/svg+xml", svg(panel.figure))
        self._window.say_briefly("Picture copied")

    def _with_data(self, panel: Panel, do: Callable[[Panel, Columns], None]) -> None:
        columns = panel.columns()
        if columns is None or not columns.rows:
            self._window.notices.report(NOTHING.format(panel.title))
        else:
            do(panel, columns)

    def _save_data(self, panel: Panel, columns: Columns) -> None:
        self._save(panel, ".csv", columns.text.encode(), columns.words)

    def _copy_data(self, panel: Panel, columns: Columns) -> None:
        QGuiApplication.clipboard().setText(columns.text)
        self._window.say_briefly(f"Data copied.{columns.words}")

    def _save(self, panel: Panel, suffix: str, data: bytes, words: str = "") -> None:
        """Save in the file that its user chooses."""
        note = heard_note(self._session.choices, self._library, self._session.stage.struck)
        title = re.sub(r"[^\w .+-]", "-", panel.title.lower())
        proposed = Path(f"{note.name if note else 'Figure'} {title}{suffix}")
        path = self._window.places.ask_to_save(self._window, "figure", "Save as", FILTERS[suffix], proposed)
        if path is None:
            return
        try:
            with result_file(path) as file:
                file.write(data)
        except WriteError as error:
            self._window.notices.report(str(error))
        else:
            self._window.notices.inform(f"Saved {path}.{words}", file=path)


def _is_menu_key(event: QKeyEvent) -> bool:
    shifted = event.modifiers() == Qt.KeyboardModifier.ShiftModifier
    return event.key() == Qt.Key.Key_Menu or (event.key() == Qt.Key.Key_F10 and shifted)
