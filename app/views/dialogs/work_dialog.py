"""A dialog of long work: its progress with the time that is left, and its result in words."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QDialog, QFormLayout, QProgressBar, QWidget

from app.shared.worker import Work
from app.views.background import Background
from app.views.controls.parts import label
from engine.plain_text import time_left

CHANGES = (QEvent.Type.LayoutRequest, QEvent.Type.Resize, QEvent.Type.Show)


class WorkDialog(QDialog):
    """A dialog that does work in the background, and is always as high as its texts need, as far as the screen is.

    Qt gives a window no height for its width.

    Args:
        name: of the thread.
        expected: errors of the work whose message is for the user.

    Attributes:
        state: what is to come, how far the work is, or its result.
    """

    def __init__(
        self, title: str, width: int, name: str, expected: tuple[type[Exception], ...], parent: QWidget | None
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.setMinimumWidth(width)
        self.state = label("faint", selectable=True)
        self.bar = QProgressBar(maximum=1000)
        self.bar.hide()
        self.bar.setAccessibleName("Progress")
        self._began_s = 0.0  # of the work, on the monotonic clock
        self._then: Callable[[Any], None] = lambda result: None  # takes the result of the work
        self.background = Background(name, self, expected=expected)
        self.background.progressed.connect(self._show_progress)
        self.background.finished.connect(lambda result: self._then(result))
        self.background.failed.connect(lambda message, _: self.show_failure(message))
        self.background.cancelled.connect(self.show_cancelled)

    def begin(self, work: Work, then: Callable[[Any], None], bar: bool = True) -> None:
        """Do the work in the background, then call `then` with its result, or `show_failure` or `show_cancelled`.

        `bar`: show the progress bar.
        """
        self._then, self._began_s = then, time.monotonic()
        self.bar.setValue(0)
        self.bar.setVisible(bar)
        self.background.start(work)

    @abstractmethod
    def show_failure(self, message: str) -> None:
        """Show why the work has failed."""

    @abstractmethod
    def show_cancelled(self) -> None:
        """Show that the work was ended."""

    @abstractmethod
    def progress_words(self, text: str, left: str) -> str:
        """The progress in words; `text`: the present step; `left`: the time, as "about 5 s left", or ""."""

    def _show_progress(self, share: float, text: str, left_s: float | None) -> None:
        self.bar.setValue(round(1000 * share))
        left = time_left(self._began_s, share, left_s)
        self.state.setText(self.progress_words(text, left and f"about {left}"))

    def event(self, event: QEvent) -> bool:
        """Make the dialog as high as its texts need at their width, at most as high as the screen."""
        handled = super().event(event)
        if event.type() in CHANGES and (layout := self.layout()) is not None:
            needed = min(layout.totalHeightForWidth(self.width()), self.screen().availableSize().height())
            if needed > self.height():
                for form in self.findChildren(QFormLayout):
                    form.invalidate()  # it would share the room by the heights of the texts before
                self.resize(self.width(), needed)
        return handled
