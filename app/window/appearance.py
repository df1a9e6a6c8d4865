"""The chosen theme, or the desktop's, and the size of text, applied to the window."""

from __future__ import annotations

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication

from app.views.look import Look
from app.views.theme import apply_theme
from app.window.main_window import MainWindow


class Appearance(QObject):
    """The look of the window; `look`: the present choices, to be saved."""

    def __init__(self, window: MainWindow, look: Look) -> None:
        super().__init__(window)
        self.look = look
        self._window = window
        window.menu.show_look(look)
        window.menu.look_asked.connect(self._change)
        QApplication.styleHints().colorSchemeChanged.connect(self._follow)

    def _change(self, field: str, value: object) -> None:
        self.look = Look.model_validate({**self.look.model_dump(), field: value})
        self._window.menu.show_look(self.look)
        self._put_on()

    def _follow(self) -> None:
        if self.look.theme == "system":
            self._put_on()

    def _put_on(self) -> None:
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        apply_theme(application, self.look.theme, self.look.size_percent)
