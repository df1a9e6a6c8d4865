"""Figures, saved and copied: pictures as PNG and SVG, data as CSV. A right click or the menu key offers it.

What is saved is taken at the command: a take may grow while a file is chosen.
"""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QPointF, Qt
from PySide6.QtGui import QContextMenuEvent, QGuiApplication, QImage, QKeyEvent, QKeySequence, QMouseEvent
from PySide6.QtWidgets import QAbstractScrollArea, QApplication, QMenu, QWidget

from app.presets.library import Library
from app.stage.session import Session
from app.views.controls.form import FILTERS
from app.views.figure import picture
from app.window.exports import heard_note
from app.window.main_window import MainWindow
from app.window.panels.base import Panel
from engine.whole_file import WriteError, result_file

NOTHING = "{}: there is nothing to save yet; play a note first."
MENU_KEYS = QKeySequence("Menu"), QKeySequence("Shift+F10")
Event = QEvent.Type


class Figures(QObject):
    """The figures of all panels, with a menu each."""

    def __init__(self, window: MainWindow, session: Session, library: Library) -> None:
        super().__init__(window)
        self._window, self._session, self._library = window, session, library
        self._menus: dict[QObject, QMenu] = {}  # by what the pointer or the keyboard is on
        self._pressed = QPointF()  # where the right button went down, in pixels

    def add(self, panel: Panel) -> None:
        """Offer what a panel shows."""
        figure = panel.figure
        menu = QMenu(figure)
        menu.addAction("Save picture as PNG …", lambda: self._save(panel, ".png"))
        menu.addAction("Save picture as SVG …", lambda: self._save(panel, ".svg"))
        menu.addAction("Copy picture", lambda: self._copy_picture(figure))
        menu.addAction("Save data as CSV …", lambda: self._save(panel, ".csv"))
        menu.addAction("Copy data as CSV", lambda: self._copy_data(panel))
        for part in (figure, *([figure.viewport()] if isinstance(figure, QAbstractScrollArea) else [])):
            self._menus[part] = menu
            part.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Open the menu by a key, or by a right click; a right button that drags pans."""
        menu = self._menus.get(watched)
        if menu is None or not isinstance(watched, QWidget):
            return False
        if isinstance(event, QMouseEvent) and event.button() == Qt.MouseButton.RightButton:
            if event.type() == Event.MouseButtonPress:
                self._pressed = event.position()
            is_click = (event.position() - self._pressed).manhattanLength() < QApplication.startDragDistance()
            if event.type() == Event.MouseButtonRelease and is_click:
                menu.popup(event.globalPosition().toPoint())
            return False
        takes = isinstance(event, QContextMenuEvent)
        if isinstance(event, QKeyEvent) and event.type() == Event.KeyPress:
            takes = QKeySequence(event.keyCombination()) in MENU_KEYS
        by_mouse = isinstance(event, QContextMenuEvent) and event.reason() == QContextMenuEvent.Reason.Mouse
        if takes and not by_mouse:  # by the mouse it may come with the press
            menu.popup(watched.mapToGlobal(watched.rect().center()))
        return takes

    def _copy_picture(self, figure: QWidget) -> None:
        """Copy both kinds: each program takes the one that it knows."""
        clipboard = QGuiApplication.clipboard()
        clipboard.setImage(QImage.fromData(picture(figure, ".png")))
        # to Qt's own data: what is made in Python ends too early, and the app's end would be a crash
        clipboard.mimeData().setData("image/svg+xml", picture(figure, ".svg"))
        self._window.say_briefly("Picture copied")

    def _content(self, panel: Panel, suffix: str) -> tuple[bytes, str]:
        """The bytes of a picture or of the data, and words for what is left out of it, "" for nothing.

        Where there are no data, a notice reports it and the bytes are b"".

        Args:
            suffix: ".png", ".svg", or ".csv" for the data.
        """
        if suffix != ".csv":
            return picture(panel.figure, suffix), ""
        columns = panel.columns()
        if columns is None or not columns.rows:
            self._window.notices.report(NOTHING.format(panel.title))
            return b"", ""
        return columns.text.encode(), columns.words

    def _copy_data(self, panel: Panel) -> None:
        data, words = self._content(panel, ".csv")
        if data:
            QGuiApplication.clipboard().setText(data.decode())
            self._window.say_briefly(f"Data copied.{words}")

    def _save(self, panel: Panel, suffix: str) -> None:
        """Save in the file that its user chooses."""
        data, words = self._content(panel, suffix)
        if not data:
            return
        note = heard_note(self._session.choices, self._library, self._session.stage.struck)
        proposed = Path(f"{note.name if note else 'Figure'} {panel.title.lower()}{suffix}")
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
