"""The level meter, with a light that shows when playback is being limited."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize
from PySide6.QtGui import QColor, QLinearGradient, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.views import theme
from app.views.painting import set_ink, write

LOWEST_DB = -60.0
LIMIT_HOLD_TICKS = 30  # calls of `show_level`: half a second at 60 Hz


class Meter(QWidget):
    """A bar from -60 to 0 dBFS and the LIMIT light."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Level")
        self.setToolTip(
            "Playback level in dBFS. LIMIT lights while the safety limiter is active (playback only, not in files)"
        )
        self._peak_db = LOWEST_DB  # dBFS, as shown; LOWEST_DB at least
        self._hold = 0  # calls of `show_level` for which the light stays on; 0: it is off

    def sizeHint(self) -> QSize:
        return QSize(theme.px(150), theme.px(40))

    def minimumSizeHint(self) -> QSize:
        return QSize(theme.px(84), theme.px(40))

    def show_level(self, peak_db: float, limiting: bool) -> None:
        """Show the peak in dBFS, and whether the limiter reduces it now."""
        hold = LIMIT_HOLD_TICKS if limiting else max(0, self._hold - 1)
        peak_db = max(peak_db, LOWEST_DB)
        if (peak_db, hold) == (self._peak_db, self._hold):
            return
        if self._pixels(peak_db) != self._pixels(self._peak_db) or bool(hold) != bool(self._hold):
            self.update()  # only then: it repaints what lies behind as well
        self._peak_db, self._hold = peak_db, hold

    def _pixels(self, peak_db: float) -> int:
        """The length of the bar at a level, in pixels of the screen."""
        return round((1 - peak_db / LOWEST_DB) * self._bar.width() * theme.present.scale * self.devicePixelRatioF())

    @property
    def _bar(self) -> QRectF:
        return QRectF(12, 8, self.width() / theme.present.scale - 68, 9)

    @property
    def limit_light(self) -> bool:
        return self._hold > 0

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the bar of the peak, its scale in dBFS below, and the light at the right."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        scale = theme.present.scale  # all of it grows with the text
        painter.scale(scale, scale)
        bar = self._bar
        set_ink(painter, fill=theme.LINE)
        painter.drawRoundedRect(bar, 3, 3)
        gradient = QLinearGradient(bar.left(), 0, bar.right(), 0)
        for place, colour in ((0, theme.GOOD), (0.8, theme.MODEL), (1, theme.WARNING)):
            gradient.setColorAt(place, QColor(colour))
        set_ink(painter, fill=gradient)
        share = 1 - self._peak_db / LOWEST_DB
        painter.drawRoundedRect(QRectF(bar.left(), bar.top(), bar.width() * share, bar.height()), 3, 3)
        font = theme.small_font(9, grows=False)
        for db in (-60, -40, -20, 0) if bar.width() > 80 else (-60, 0):
            x = bar.left() + bar.width() * (1 - db / LOWEST_DB)
            write(painter, QRectF(x - 14, 20, 28, 12), f"{db}", theme.FAINT, font)
        light = QRectF(self.width() / scale - 44, 5, 44, 16)
        set_ink(painter, fill=theme.TEXT if self._hold else theme.LINE)
        painter.drawRoundedRect(light, 3, 3)
        write(painter, light, "LIMIT", theme.BACKGROUND if self._hold else theme.FAINT, font)
