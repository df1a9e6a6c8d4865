"""Help: a tour, the keys, what each view shows, and what each model is. It does not block the window."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from PySide6.QtWidgets import QDialog, QHBoxLayout, QTabWidget, QTextBrowser, QVBoxLayout, QWidget

from app.views.controls.parts import filled, push_button

TEXT = Path(__file__).with_name("help.md")  # a part for each heading of the first level

ABOUT = "About"


class HelpDialog(QDialog):
    """Tabs of text that can be read, scrolled and copied with the keyboard.

    Args:
        keys: (key, what it does).
        views: (title, what it shows).
        log: the file that errors are written to.
        about: what the program is; its first line is a title.
    """

    def __init__(
        self,
        keys: Iterable[tuple[str, str]],
        views: Sequence[tuple[str, str]],
        log: Path,
        about: str,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Help")
        self.resize(680, 560)
        self.tabs = QTabWidget(documentMode=True)
        self.tabs.setAccessibleName("Help topics")
        parts = help_parts()
        rows = "\n".join(f"| **{key}** | {what} |" for key, what in keys)
        self._add("Tour", parts["Tour"])
        self._add("Keys", f"### Keys\n\n| key | what it does |\n|---|---|\n{rows}\n\n{parts['Gestures']}")
        self._add("Views", "\n\n".join(f"### {title}\n\n{shows}" for title, shows in views))
        self._add("Models", parts["Models"])
        self._add("Errors", f"{parts['Errors']}\n\n`{log}`")
        title, _, rest = about.partition("\n")
        self._add(ABOUT, f"### {title}\n\n```\n{rest.strip()}\n```")
        close = push_button("Close", pressed=self.accept, default=True, autoDefault=True)
        filled(QVBoxLayout(self), self.tabs, filled(QHBoxLayout(), None, close))

    def open_at(self, topic: str) -> None:
        """Show the tab of this title; "": the one that was shown last."""
        titles = [self.tabs.tabText(place) for place in range(self.tabs.count())]
        if topic in titles:
            self.tabs.setCurrentIndex(titles.index(topic))
        self.show()

    def _add(self, title: str, markdown: str) -> None:
        page = QTextBrowser()
        page.setAccessibleName(f"Help: {title}")
        page.setTabChangesFocus(True)
        page.document().setDocumentMargin(10)
        page.setMarkdown(markdown)
        self.tabs.addTab(page, title)


def help_parts() -> dict[str, str]:
    """The parts of `TEXT` in Markdown, by heading."""
    _, *parts = re.split(r"^# (.+)\n", TEXT.read_text("utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[::2], map(str.strip, parts[1::2]), strict=True))
