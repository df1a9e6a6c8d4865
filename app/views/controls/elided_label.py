"""Lines of text with shorter wordings for little room, cut with an ellipsis where none of them fits."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QStyle, QStyleOption, QWidget

from app.views.controls.plain import Label, plain_tip


class ElidedLabel(Label):
    """A label whose least width is 0: its text never moves other widgets.

    `text()` is whole, `shown` what is painted.
    """

    _shorter: tuple[str, ...] = ()

    def say(self, text: str, *shorter: str) -> None:
        """Show a text; `shorter`: other wordings, the longest first, for where there is no room for it."""
        self._shorter = shorter
        self.setText(text)
        self.update()

    @property
    def shown(self) -> str:
        """The longest wording that fits, or the shortest one cut."""
        metrics, room = self.fontMetrics(), self.contentsRect().width()
        for words in (self.text(), *self._shorter):
            if metrics.horizontalAdvance(words) <= room:
                return words
        return metrics.elidedText(words, Qt.TextElideMode.ElideRight, room)

    def minimumSizeHint(self) -> QSize:
        return QSize(0, super().minimumSizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        option = QStyleOption()
        option.initFrom(self)
        self.style().drawPrimitive(QStyle.PrimitiveElement.PE_Widget, option, painter, self)
        painter.setPen(option.palette.windowText().color())
        painter.drawText(self.contentsRect(), self.alignment() | Qt.AlignmentFlag.AlignVCenter, self.shown)


class Readout(ElidedLabel):
    """A faint line that says what the mouse points at, else the text of `rest`. It never asks for more room."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, objectName="faint")
        self.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._resting: tuple[str, ...] = ("",)
        self._reported: tuple[str, ...] = ("",)

    def rest(self, text: str, *shorter: str) -> None:
        self._resting = (text, *shorter)
        self.report(*self._reported)

    def report(self, text: str, *shorter: str) -> None:
        """Show the thing that the mouse points at; "" for nothing. `shorter` as in `ElidedLabel.say`."""
        self._reported = (text, *shorter)
        wordings = self._reported if text else self._resting
        if wordings[0] != self.text():
            self.say(*wordings)
            # where there is too little room for it
            self.setToolTip(plain_tip(wordings[0]))
