"""Widgets that are shown, and the look of the application, which is as before afterwards."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from app.views import theme

Show = Callable[..., Any]


@pytest.fixture
def show(qtbot: QtBot) -> Show:
    """A function that shows a widget, in a size if that is given, and returns it."""

    kept = []

    def shown(widget: QWidget, *size: int) -> QWidget:
        kept.append(widget)
        qtbot.addWidget(widget)
        if size:
            widget.resize(*size)
        with qtbot.waitExposed(widget):
            widget.show()
        return widget

    return shown


@pytest.fixture(scope="module")
def own_look(qapp: QApplication) -> Iterator[QApplication]:
    """The application, of which a module may change the look."""
    style, palette, font = qapp.styleSheet(), qapp.palette(), qapp.font()
    yield qapp
    theme.use(theme.DARK)
    qapp.styleHints().setColorScheme(Qt.ColorScheme.Unknown)
    qapp.setStyleSheet(style)
    qapp.setPalette(palette)
    qapp.setFont(font)
