"""A dialog that grows with the texts that wrap in it: Qt gives a window no height for its width."""

from __future__ import annotations

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QDialog

CHANGES = (QEvent.Type.LayoutRequest, QEvent.Type.Resize, QEvent.Type.Show)


class GrowingDialog(QDialog):
    """A dialog that is always as high as its texts need at its width, as far as the screen is."""

    def event(self, event: QEvent) -> bool:
        handled = super().event(event)
        if event.type() in CHANGES and (layout := self.layout()) is not None:
            needed = min(layout.totalHeightForWidth(self.width()), self.screen().availableSize().height())
            if needed > self.height():
                self.resize(self.width(), needed)
        return handled
