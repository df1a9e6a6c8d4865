"""A progress bar two pixels high."""

from __future__ import annotations

from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from app.views import theme


class ProgressStrip(QWidget):
    """A strip that is empty, but of the same height, while nothing is computed."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(name)
        self.setFixedHeight(2)
        self._share: float | None = None  # as of `show_share`

    @property
    def share(self) -> float | None:
        return self._share

    def show_share(self, share: float | None) -> None:
        """Show the share 0 … 1, or None where nothing is computed."""
        if share != self._share:
            self._share = share
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._share is not None:
            painter = QPainter(self)
            painter.fillRect(self.rect(), QColor(theme.LINE))
            painter.fillRect(0, 0, round(self._share * self.width()), self.height(), QColor(theme.TRUTH))
