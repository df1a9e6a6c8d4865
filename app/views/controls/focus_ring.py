"""A line round the plot that has the keyboard: a style sheet's border would take its room from the axes."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QRectF, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QApplication, QGraphicsView, QWidget

from app.views import theme


class FocusRing(QWidget):
    """A ring that lies over its parent and lets every gesture through."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._ground = parent
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._around: QGraphicsView | None = None  # the plot that has the keyboard focus; None: none has
        self.hide()
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        application.focusChanged.connect(self._follow)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self._around and event.type() in (QEvent.Type.Resize, QEvent.Type.Move):
            self._place()
        return super().eventFilter(watched, event)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(QPen(theme.translucent(theme.TEXT, 150), 1))
        painter.drawRect(QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5))

    def _follow(self, _before: QWidget | None, now: QWidget | None) -> None:
        """Surround the widget that got the keyboard focus, if it is a plot of the parent; else hide."""
        if self._around is not None:
            self._around.removeEventFilter(self)
            self._around = None
        if isinstance(now, QGraphicsView) and self._ground.isAncestorOf(now):
            self._around = now
            now.installEventFilter(self)
            self._place()
            self.raise_()
        self.setVisible(self._around is not None)

    def _place(self) -> None:
        if self._around is not None:
            corner = self._around.mapTo(self._ground, QPoint(0, 0))
            self.setGeometry(QRect(corner, self._around.size()))
