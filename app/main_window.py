"""The window: its parts, where they stand, and its keys. What they do is connected in `controller`."""

from __future__ import annotations

from PySide6.QtCore import QByteArray, Qt, Signal
from PySide6.QtGui import QCloseEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QMainWindow,
    QMenu,
    QMessageBox,
    QSplitter,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.views.deck import Deck
from app.views.notice_bar import NoticeBar
from app.views.parts import tool_button
from app.views.preset_bar import PresetBar
from app.views.transport_bar import TransportBar

KEYS = (  # (key, name of the signal, what it does)
    ("Space", "play_asked", "play from the pluck, or stop"),
    ("Return", "pluck_asked", "pluck"),
    ("X", "switch_asked", "switch between A and B at the playhead"),
    ("L", "loop_asked", "loop"),
    ("Esc", "all_modes_asked", "hear all modes again"),
    ("PgUp", "previous_asked", "previous preset"),
    ("PgDown", "next_asked", "next preset"),
    ("Ctrl+E", "export_asked", "export WAV"),
    ("F1", "help_asked", "these keys"),
    ("Ctrl+Q", "quit_asked", "quit"),
)


class MainWindow(QMainWindow):
    """See the module."""

    play_asked = Signal()
    pluck_asked = Signal()
    switch_asked = Signal()
    loop_asked = Signal()
    all_modes_asked = Signal()
    previous_asked = Signal()
    next_asked = Signal()
    export_asked = Signal()
    help_asked = Signal()
    quit_asked = Signal()
    closing = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle("Learned Strings")
        self.setMinimumSize(1256, 560)
        self.resize(1280, 800)
        self.presets = PresetBar()
        self.left, self.right = Deck("Views on the left"), Deck("Views on the right")
        self.transport = TransportBar()
        self.notices = NoticeBar()
        self.error_label = QLabel()
        self.error_label.setToolTip(
            "Model against truth for this pluck: relative mean absolute error, all of the string"
        )
        self._solo = tool_button("", "Hear all modes", "One mode is heard alone; click, or Esc, to hear all of them")
        self._solo.setVisible(False)
        self._solo.clicked.connect(self.all_modes_asked)
        self.rate_label = QLabel()
        self.rate_label.setObjectName("badge")
        self.audio_menu = QMenu(self)
        self._audio_button = tool_button("Audio ▾", "Audio device", "Choose where the sound goes")
        self._audio_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self._audio_button.setMenu(self.audio_menu)
        self._lay_out()
        for key, signal, _ in KEYS:
            shortcut = QShortcut(QKeySequence(key), self)
            shortcut.setAutoRepeat(False)
            shortcut.activated.connect(getattr(self, signal))
        self.help_asked.connect(self.show_help)
        self.quit_asked.connect(self.close)

    def _lay_out(self) -> None:
        brand = QLabel("LEARNED STRINGS")
        brand.setObjectName("brand")
        head = QHBoxLayout()
        head.setSpacing(10)
        head.addWidget(brand)
        head.addSpacing(12)
        head.addWidget(self.presets)
        head.addStretch(1)
        head.addWidget(self.rate_label)
        head.addWidget(self._audio_button)
        facts = QHBoxLayout()
        facts.addWidget(self.presets.card)
        facts.addStretch(1)
        facts.addWidget(self._solo)
        facts.addWidget(self.error_label)
        decks = QSplitter(Qt.Orientation.Horizontal)
        decks.addWidget(self.left)
        decks.addWidget(self.right)
        decks.setSizes([560, 720])
        self._stage = QSplitter(Qt.Orientation.Vertical)
        self._stage.addWidget(decks)
        for splitter in (decks, self._stage):
            splitter.setChildrenCollapsible(False)
            splitter.setHandleWidth(8)
        column = QVBoxLayout()
        column.setContentsMargins(14, 12, 14, 12)
        column.setSpacing(10)
        column.addLayout(head)
        column.addLayout(facts)
        column.addWidget(self.notices)
        column.addWidget(self._stage, 1)
        column.addWidget(self.transport)
        middle = QWidget()
        middle.setLayout(column)
        self.setCentralWidget(middle)

    def show_string(self, view: QWidget) -> None:
        """Puts the string above the decks; it has the keyboard at first."""
        self._stage.insertWidget(0, view)
        self._stage.setSizes([380, 250])
        view.setFocus()

    def show_solo(self, mode: int) -> None:
        """Which mode is heard alone; 0: all are heard."""
        self._solo.setText(f"mode {mode} alone  ✕")
        self._solo.setVisible(mode > 0)

    def geometry_text(self) -> str:
        """Size and place, for `restore_geometry`."""
        return bytes(self.saveGeometry().toBase64().data()).decode("ascii")

    def restore_geometry(self, text: str) -> None:
        if text:
            self.restoreGeometry(QByteArray.fromBase64(text.encode("ascii", "ignore")))

    def show_help(self) -> None:
        rows = "".join(f"<tr><td><b>{key}</b>&nbsp;&nbsp;</td><td>{what}</td></tr>" for key, _, what in KEYS)
        QMessageBox.information(
            self,
            "Keys",
            f"<table>{rows}</table><p>On the string: arrow keys move the pluck, with Shift the listening point.<br>"
            "On a knob: arrow keys, wheel, or type a number; Delete resets.</p>",
        )

    def closeEvent(self, event: QCloseEvent) -> None:
        self.closing.emit()
        super().closeEvent(event)
