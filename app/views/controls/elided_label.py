"""A line of text that is told in fewer words, or cut with an ellipsis, where there is too little room for it."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QStyle, QStyleOption, QWidget


class ElidedLabel(QLabel):
    """Takes the room there is; what it says never moves what is beside it. `text` is whole."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self._shorter: tuple[str, ...] = ()

    @property
    def marked_up(self) -> bool:
        """Whether its texts are the program's own and may be HTML."""
        return self.textFormat() != Qt.TextFormat.PlainText

    def say(self, text: str, *shorter: str) -> None:
        """`shorter` are other wordings, the longest first, for where there is no room for the text."""
        self._shorter = shorter
        self.setText(text)
        self.update()

    @property
    def shown(self) -> str:
        """As much of it as there is room for."""
        metrics, room = self.fontMetrics(), self.contentsRect().width()
        for words in (self.text(), *self._shorter):
            if metrics.horizontalAdvance(words) <= room:
                return words
        return metrics.elidedText(words, Qt.TextElideMode.ElideRight, room)

    def minimumSizeHint(self) -> QSize:
        return QSize(0, super().minimumSizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        if self.marked_up and self.text().startswith("<"):  # rich text has no ellipsis
            super().paintEvent(event)
            return
        painter = QPainter(self)
        option = QStyleOption()
        option.initFrom(self)
        self.style().drawPrimitive(QStyle.PrimitiveElement.PE_Widget, option, painter, self)
        painter.setPen(option.palette.windowText().color())
        painter.drawText(self.contentsRect(), self.alignment() | Qt.AlignmentFlag.AlignVCenter, self.shown)
