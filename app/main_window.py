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
    ("X", "switch_asked", "switch between model and truth at the playhead"),
    ("Ctrl+L", "loop_asked", "loop"),
    ("PgUp", "previous_asked", "previous preset"),
    ("PgDown", "next_asked", "next preset"),
    ("Ctrl+Z", "undo_asked", "undo: preset, pluck, listening point, duration"),
    ("Ctrl+Shift+Z", "redo_asked", "redo"),
    ("M", "motion_asked", "show or hide the string's motion"),
    ("E", "envelope_asked", "show or hide the envelope of the motion"),
    ("Ctrl+E", "export_asked", "export WAV"),
    ("Ctrl+M", "midi_asked", "MIDI"),
    ("F1", "help_asked", "these keys"),
    ("Ctrl+Q", "quit_asked", "quit"),
)

PLAYED_KEYS = (  # see `app/keyboard.py`
    ("A S D F G H J K L ;", "pluck at ten places, from left to right"),
    ("1 … 9", "how hard, from softest to loudest (not while a knob has the keyboard)"),
    ("C   V", "softer, harder"),
)


class MainWindow(QMainWindow):
    """See the module."""

    play_asked = Signal()
    pluck_asked = Signal()
    switch_asked = Signal()
    loop_asked = Signal()
    previous_asked = Signal()
    next_asked = Signal()
    undo_asked = Signal()
    redo_asked = Signal()
    motion_asked = Signal()
    envelope_asked = Signal()
    export_asked = Signal()
    midi_asked = Signal()
    help_asked = Signal()
    quit_asked = Signal()
    closing = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle("Learned Strings")
        self.setMinimumSize(1180, 560)
        self.resize(1280, 800)
        self.presets = PresetBar()
        self.left, self.right = Deck("Views on the left"), Deck("Views on the right")
        self.transport = TransportBar()
        self.notices = NoticeBar()
        self.error_label = QLabel()
        self.error_label.setToolTip(
            "Model against truth for this pluck: relative mean absolute error, all of the string"
        )
        self.rate_label = QLabel()
        self.rate_label.setObjectName("badge")
        self.audio_menu = QMenu(self)
        self._audio_button = tool_button("Audio ▾", "Audio device", "Choose where the sound goes")
        self._audio_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self._audio_button.setMenu(self.audio_menu)
        self._midi_button = tool_button("MIDI …", "MIDI", "Play with a MIDI keyboard, and teach its controllers")
        self._midi_button.clicked.connect(self.midi_asked)
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
        head.addWidget(self._midi_button)
        facts = QHBoxLayout()
        facts.addWidget(self.presets.card)
        facts.addStretch(1)
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

    def geometry_text(self) -> str:
        """Size and place, for `restore_geometry`."""
        return bytes(self.saveGeometry().toBase64().data()).decode("ascii")

    def restore_geometry(self, text: str) -> None:
        if text:
            self.restoreGeometry(QByteArray.fromBase64(text.encode("ascii", "ignore")))

    def show_help(self) -> None:
        table = [*PLAYED_KEYS, *((key, what) for key, _, what in KEYS)]
        rows = "".join(f"<tr><td><b>{key}</b>&nbsp;&nbsp;</td><td>{what}</td></tr>" for key, what in table)
        QMessageBox.information(
            self,
            "Keys",
            f"<table>{rows}</table>"
            "<p>On the string: arrow keys move the pluck, with Shift the listening point (Ctrl+Shift: the right "
            "one), with Ctrl width and shape; Delete resets the pluck, Shift+Delete the listening point.</p>"
            "<p>On a knob: arrow keys or wheel, Shift is finer, Page up and down are coarse, Home and End; "
            "or type a number; Delete or a double-click resets.</p>",
        )

    def closeEvent(self, event: QCloseEvent) -> None:
        self.closing.emit()
        super().closeEvent(event)
