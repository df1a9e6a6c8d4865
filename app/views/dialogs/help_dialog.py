"""Help: a tour, the keys, what each view shows, and what each model is. It does not block the window."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from PySide6.QtWidgets import QDialog, QHBoxLayout, QPushButton, QTabWidget, QTextBrowser, QVBoxLayout, QWidget

from app.views.dialogs.help_text import ERRORS, GESTURES, MODELS, TOUR

Pairs = Iterable[tuple[str, str]]


class HelpDialog(QDialog):
    """Tabs of text that can be read, scrolled and copied with the keyboard.

    Args:
        keys: (key, what it does).
        views: (title, what it shows).
        log: the file that errors are written to.
    """

    def __init__(
        self, keys: Pairs, views: Sequence[tuple[str, str]], log: Path, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Help")
        self.resize(680, 560)
        self.tabs = QTabWidget()
        self.tabs.setAccessibleName("Help topics")
        self.tabs.setDocumentMode(True)
        self._add("Tour", "<h3>A tour of two minutes</h3><ol>" + _items(TOUR) + "</ol>")
        self._add("Keys", "<h3>Keys</h3>" + _table(keys) + "<h3>Mouse gestures and knobs</h3>" + _table(GESTURES))
        self._add("Views", _sections(views))
        self._add(
            "Models",
            "<p>Every model is given the initial displacement of the string and computes the motion that follows.</p>"
            + _sections(MODELS),
        )
        self._add("Errors", "<h3>When something goes wrong</h3>" + _paragraphs(ERRORS) + _path(log))
        close = QPushButton("Close", default=True)
        close.clicked.connect(self.accept)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(close)
        column = QVBoxLayout(self)
        column.addWidget(self.tabs)
        column.addLayout(buttons)

    def _add(self, title: str, html: str) -> None:
        page = QTextBrowser()
        page.setAccessibleName(f"Help: {title}")
        page.setTabChangesFocus(True)
        page.document().setDocumentMargin(10)
        page.setHtml(html)
        self.tabs.addTab(page, title)


def _items(pairs: Pairs) -> str:
    return "".join(f"<li style='margin-bottom: 8px'><b>{escape(a)}.</b> {escape(b)}</li>" for a, b in pairs)


def _paragraphs(texts: Iterable[str]) -> str:
    return "".join(f"<p>{escape(text)}</p>" for text in texts)


def _path(path: Path) -> str:
    return f"<p><code>{escape(str(path))}</code></p>"


def _table(pairs: Pairs) -> str:
    cell = "<td style='padding: 3px 24px 3px 0'>"
    rows = "".join(f"<tr>{cell}<b>{escape(a)}</b></td>{cell}{escape(b)}</td></tr>" for a, b in pairs)
    return f"<table>{rows}</table>"


def _sections(pairs: Pairs) -> str:
    return "".join(f"<h3>{escape(a)}</h3><p>{escape(b)}</p>" for a, b in pairs)
