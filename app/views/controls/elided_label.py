"""A line of text with shorter wordings for little room, cut with an ellipsis where none of them fits."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QStaticText, QTextOption
from PySide6.QtWidgets import QLabel, QStyle, QStyleOption, QWidget


class ElidedLabel(QLabel):
    """Its least width is 0: its text never moves other widgets. `text()` is whole, `shown` what is painted."""

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
        """The longest wording that fits, or the shortest one cut."""
        metrics, room = self.fontMetrics(), self.contentsRect().width()
        for words in (self.text(), *self._shorter):
            wide = self._formatted(words).size().width() if self._is_html(words) else metrics.horizontalAdvance(words)
            if wide <= room:
                return words
        if self._is_html(words):  # it has no ellipsis
            return words
        return metrics.elidedText(words, Qt.TextElideMode.ElideRight, room)

    def minimumSizeHint(self) -> QSize:
        return QSize(0, super().minimumSizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, shown = QPainter(self), self.shown
        option = QStyleOption()
        option.initFrom(self)
        self.style().drawPrimitive(QStyle.PrimitiveElement.PE_Widget, option, painter, self)
        painter.setPen(option.palette.windowText().color())
        if not self._is_html(shown):
            painter.drawText(self.contentsRect(), self.alignment() | Qt.AlignmentFlag.AlignVCenter, shown)
            return
        formatted = self._formatted(shown)
        place = QRectF(QPointF(), formatted.size())
        place.moveCenter(QRectF(self.contentsRect()).center())
        if self.alignment() & Qt.AlignmentFlag.AlignRight:
            place.moveRight(self.contentsRect().right())
        elif self.alignment() & Qt.AlignmentFlag.AlignLeft:
            place.moveLeft(self.contentsRect().left())
        painter.drawStaticText(place.topLeft(), formatted)

    def _is_html(self, words: str) -> bool:
        return self.marked_up and words.startswith("<")

    def _formatted(self, words: str) -> QStaticText:
        formatted = QStaticText(words)
        formatted.setTextFormat(Qt.TextFormat.RichText)
        option = QTextOption()
        option.setWrapMode(QTextOption.WrapMode.NoWrap)
        formatted.setTextOption(option)
        formatted.prepare(font=self.font())
        return formatted
