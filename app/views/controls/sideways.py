"""A scroll area for a part that may be wider than the window; it scrolls sideways alone."""

from __future__ import annotations

from PySide6.QtCore import QEvent, Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QScrollArea, QSizePolicy, QWidget


class Sideways(QScrollArea):
    """A scroll area as high as its part, and higher by the scroll bar while there is one."""

    def __init__(self, part: QWidget, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # its controls take the focus, and are scrolled to
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.setWidget(part)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def event(self, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.LayoutRequest, QEvent.Type.Polish, QEvent.Type.Show):
            self._fit()
        elif event.type() in (QEvent.Type.StyleChange, QEvent.Type.FontChange):
            QTimer.singleShot(0, self, self._renew)  # once its controls have the other text
        return super().event(event)

    def _renew(self) -> None:
        """Forget the sizes that rows had with another text. It asks for a layout, so `_fit` must not do it."""
        part = self.widget()
        if part is not None and (layout := part.layout()) is not None:
            layout.invalidate()
        self._fit()

    def _fit(self) -> None:
        """Make the part as wide as the area, or its least width; and the area as high as it, with the scroll bar."""
        part = self.widget()
        if part is not None:
            if (layout := part.layout()) is not None:
                layout.activate()
            least = part.minimumSizeHint().width()
            too_narrow = least > self.width()
            part.resize(max(least, self.viewport().width()), part.height())
            bar = self.horizontalScrollBar().sizeHint().height() + 2 if too_narrow else 0
            self.setFixedHeight(part.sizeHint().height() + bar)
