"""The window: its parts, where they stand, and its keys. What they do is connected in `controller`."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from PySide6.QtCore import QByteArray, QMargins, QPoint, QRect, Qt, QTimer, Signal
from PySide6.QtGui import (
    QCloseEvent,
    QDragEnterEvent,
    QDropEvent,
    QKeySequence,
    QPaintEvent,
    QResizeEvent,
    QShortcut,
    QShowEvent,
)
from PySide6.QtWidgets import (
    QAbstractButton,
    QComboBox,
    QGraphicsView,
    QHBoxLayout,
    QMainWindow,
    QSplitter,
    QTabBar,
    QToolTip,
    QVBoxLayout,
    QWidget,
)

from app.views.controls.app_menu import AppMenu, menu_button
from app.views.controls.deck import Deck
from app.views.controls.focus_ring import FocusRing
from app.views.controls.notice_bar import NoticeBar
from app.views.controls.parts import tool_button
from app.views.controls.plain import Label, plain_tip
from app.views.controls.preset_bar import PresetBar
from app.views.controls.sideways import Sideways
from app.views.controls.transport_bar import TransportBar
from app.views.instrument.panel import InstrumentPanel
from engine.kernels import cache  # and not the compiler

KEYS = (  # (key, name of the signal, what it does)
    ("Space", "play_asked", "play from the pluck, or stop"),
    ("Return", "pluck_asked", "pluck"),
    ("B", "switch_asked", "switch between A and B at the playhead"),
    ("Esc", "all_modes_asked", "play all modes again"),
    ("Ctrl+L", "loop_asked", "loop"),
    ("PgUp", "previous_asked", "previous preset"),
    ("PgDown", "next_asked", "next preset"),
    ("Ctrl+P", "browse_asked", "browse the presets"),
    ("Ctrl+Z", "undo_asked", "undo: patch and its knobs, preset, pluck, listening point, duration"),
    ("Ctrl+Shift+Z", "redo_asked", "redo"),
    ("M", "motion_asked", "show or hide the string's motion"),
    ("N", "envelope_asked", "show or hide the envelope of the motion"),
    ("Ctrl+E", "export_asked", "export WAV"),
    ("Ctrl+Shift+E", "sampled_asked", "export the patch as an instrument for samplers (SFZ, SoundFont)"),
    ("Ctrl+T", "abx_asked", "blind listening test (ABX)"),
    ("Ctrl+,", "audio_asked", "audio settings"),
    ("F8", "notices_asked", "notices since the start"),
    ("Ctrl+M", "midi_asked", "MIDI"),
    ("Ctrl+K", "instrument_asked", "show or hide the instrument: keys and patch"),
    ("F10", "menu_asked", "menu"),
    ("F1", "help_asked", "help"),
    ("Ctrl+Q", "quit_asked", "quit"),
)
KEY_NAMES = {"Return": "Enter", "PgUp": "Page up", "PgDown": "Page down"}  # as tooltips call them
FAILED = "The models cannot be loaded."
LOADING, COMPILING = "Loading the models …", "Preparing the sound engine (once; about a minute) …"
WIDE, HIGH = 1100, 560  # pixels: a narrower window hides brand and instrument button; a lower one the preset's facts
ROOMY = 1240  # pixels: in a narrower window the controls are compact
ALL_HIGH = 640  # pixels: a lower window shows the instrument instead of the views
KNOBS_HIGH = 780  # pixels: in a lower one the string's knobs take the place of the keys, and all stands closer
FACTS_HEIGHT = 20
BRIEFLY_MS = 1_800  # a text over the window
TITLE_BAR = 40  # pixels, at most; its height is known only once the window is shown

PLAYED_KEYS = (  # see `app/playing/keyboard.py`
    ("A S D F …  W E …", "play notes, as on a piano: white keys below, black keys above"),
    ("Z   X", "an octave lower, higher"),
    ("1 … 9", "velocity, from softest to loudest (not while a knob has the keyboard focus)"),
    ("C   V", "softer, harder"),
    (
        "A S D F G H J K L ;",
        "where keys choose the place, or without a patch: pluck at ten places, left to right",
    ),
)


class MainWindow(QMainWindow):
    """Its parts are public: `presets`, `left`, `right`, `transport`, `instrument`, `notices`, `menu`."""

    play_asked = Signal()
    pluck_asked = Signal()
    switch_asked = Signal()
    loop_asked = Signal()
    all_modes_asked = Signal()
    previous_asked = Signal()
    next_asked = Signal()
    undo_asked = Signal()
    redo_asked = Signal()
    motion_asked = Signal()
    envelope_asked = Signal()
    export_asked = Signal()
    sampled_asked = Signal()
    abx_asked = Signal()
    audio_asked = Signal()
    notices_asked = Signal()
    midi_asked = Signal()
    instrument_asked = Signal()
    browse_asked = Signal()
    file_dropped = Signal(str)  # a path
    menu_asked = Signal()
    help_asked = Signal()
    about_asked = Signal()
    quit_asked = Signal()
    closing = Signal()
    first_painted = Signal()  # once, after the first paint

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle("Learned Strings")
        self.setMinimumSize(760, 480)
        self.resize(1280, 800)
        self._painted = False
        self._tabbed_to: QWidget | None = None  # what got the keyboard by the Tab key
        self.may_close: Callable[[], bool] = lambda: True  # asked before it is closed
        self.presets = PresetBar()
        self.left, self.right = Deck("Views on the left"), Deck("Views on the right")
        self.transport = TransportBar()
        self.instrument = InstrumentPanel()
        self.notices = NoticeBar()
        self.error_label = Label()
        self.error_label.setToolTip(
            "Mean absolute error of the model relative to the truth, for this pluck and the whole string:\n"
            "as trained is over the time that the model was trained for"
        )
        self._solo = tool_button("", "Play all modes", "One mode is soloed; click, or Esc, to play all modes")
        self._solo.setObjectName("solo")
        self._solo.setVisible(False)
        self._solo.clicked.connect(self.all_modes_asked)
        self.rate_label = Label()
        self.rate_label.setObjectName("badge")
        self._audio_button = tool_button("Audio …", "Audio settings", "Audio output, sample rate and buffer (Ctrl+,)")
        self._audio_button.clicked.connect(self.audio_asked)
        tip = "Show or hide the instrument: keys and patch (Ctrl+K). A low window shows it instead of the views"
        self._instrument_button = tool_button("Instrument", tip=tip)
        self._instrument_button.setCheckable(True)
        self._instrument_button.setChecked(True)
        self._instrument_button.toggled.connect(self.show_instrument)
        self.instrument_asked.connect(self._instrument_button.toggle)
        self.menu = AppMenu(self)
        self._menu_button = menu_button(self.menu)
        self._lay_out()
        self.setAcceptDrops(True)
        for key, signal, _ in KEYS:
            shortcut = QShortcut(QKeySequence(key), self)
            shortcut.setAutoRepeat(False)
            shortcut.activated.connect(self._press_or_pluck if key == "Return" else getattr(self, signal))
        self.notices_asked.connect(self.notices.show_all)
        self.menu_asked.connect(self._menu_button.showMenu)
        for action, signal in self.menu.asked.items():
            action.triggered.connect(getattr(self, signal))
        self.quit_asked.connect(self.close)

    def _lay_out(self) -> None:
        self._brand = Label("LEARNED STRINGS")
        self._brand.setObjectName("brand")
        self._head = head = QHBoxLayout()
        head.addWidget(self._brand)
        head.addWidget(self.presets, 1)
        tip = "Blind listening test: can you tell A and B apart? (Ctrl+T)"
        self._test_button = test = tool_button("ABX …", "Listening test", tip)
        test.clicked.connect(self.abx_asked)
        aside = (self._instrument_button, test, self.rate_label, self.notices.bell)
        for widget in (*aside, self._audio_button, self._menu_button):
            head.addWidget(widget)
        self._facts = QWidget()
        self._facts_row = facts = QHBoxLayout(self._facts)
        facts.setContentsMargins(0, 0, 0, 0)
        facts.setSpacing(24)
        for part in (self.presets.card, self._solo):  # of one height, so that the solo button moves nothing
            part.setFixedHeight(FACTS_HEIGHT)
        facts.addWidget(self.presets.card, 1)
        facts.addWidget(self._solo)
        facts.addWidget(self.error_label)
        self._decks = decks = QSplitter(Qt.Orientation.Horizontal)
        decks.addWidget(self.left)
        decks.addWidget(self.right)
        decks.setSizes([560, 720])
        self._stage = QSplitter(Qt.Orientation.Vertical)
        self._loading = Label(LOADING if cache.is_whole() else COMPILING)
        self._loading.setObjectName("faint")
        self._loading.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._stage.addWidget(self._loading)
        self._string: QWidget = self._loading  # until it is there
        self._stage.addWidget(decks)
        self._set_alive(False)
        for splitter in (decks, self._stage):
            splitter.setChildrenCollapsible(False)
            splitter.setHandleWidth(8)
        self._column = column = QVBoxLayout()
        column.addLayout(head)
        column.addWidget(self._facts)
        column.addWidget(self._stage, 1)
        column.addWidget(Sideways(self.transport))
        column.addWidget(self.instrument)
        middle = QWidget()
        middle.setLayout(column)
        self.setCentralWidget(middle)
        self.notices.setParent(middle)
        FocusRing(middle)

    def show_string(self, view: QWidget) -> None:
        """Puts the string's view above the decks, gives it the focus and enables the window, which was loading."""
        self._loading.hide()
        self._string = view
        self._stage.insertWidget(0, view)
        self._stage.setSizes([310, 0, 300])
        self._set_alive(True)
        view.setFocus()

    def show_failed(self) -> None:
        """Says, in the place of the string, that the models cannot be loaded."""
        self._loading.setText(FAILED)

    def order_tabs(self) -> None:
        """Sets the order of the Tab key: header, notice, string, views, controls. Call it once all parts exist."""
        header = (self.presets, self._instrument_button, self.notices.bell, self._audio_button, self._menu_button)
        chain: list[QWidget] = []
        for part in (*header, self.notices, self._string, self.left, self.right, self.transport, self.instrument):
            inside = [part, *part.findChildren(QWidget)]
            stops = [
                widget
                for widget in inside
                if widget.focusPolicy() & Qt.FocusPolicy.TabFocus
                and widget.focusProxy() is None
                and widget.window() is self  # not the pop-up of a combo box
            ]
            chain += sorted(stops, key=lambda widget: not isinstance(widget, QTabBar))  # a deck's names come first
        for before, after in pairwise(chain):
            QWidget.setTabOrder(before, after)

    def focusNextPrevChild(self, forward: bool) -> bool:
        moved = super().focusNextPrevChild(forward)
        self._tabbed_to = self.focusWidget()
        return moved

    def _press_or_pluck(self) -> None:
        """Presses the button, or opens the box, that the Tab key went to; after a click elsewhere, Enter plucks."""
        aimed = self.focusWidget()
        if aimed is self._tabbed_to and isinstance(aimed, QAbstractButton):
            aimed.animateClick()
        elif aimed is self._tabbed_to and isinstance(aimed, QComboBox):
            aimed.showPopup()
        else:
            self.pluck_asked.emit()

    def _set_alive(self, alive: bool) -> None:
        for part in (self.presets, self.transport, self._test_button, self._audio_button, self._menu_button):
            part.setEnabled(alive)
        self._alive = alive
        self.instrument.setEnabled(alive)
        self._share_height()
        self.rate_label.setVisible(alive)

    @property
    def shows_instrument(self) -> bool:
        return self._instrument_button.isChecked()

    def show_instrument(self, shown: bool) -> None:
        """Folds the instrument away, or shows it."""
        self._instrument_button.setChecked(shown)
        self.instrument.setVisible(shown)
        self._share_height()

    def _share_height(self) -> None:
        """A low window hides the views beside the instrument, a lower one also the preset's facts."""
        height = self.height()
        self.instrument.set_low(height < KNOBS_HIGH)
        self._decks.setVisible(self._alive and (height >= ALL_HIGH or not self.shows_instrument))
        self._facts.setVisible(height >= HIGH)
        home, place = (self._facts_row, 1) if height >= HIGH else (self._head, 2)
        if home.indexOf(self._solo) < 0:
            shown = not self._solo.isHidden()
            home.insertWidget(place, self._solo)
            self._solo.setVisible(shown)

    def show_solo(self, mode: int) -> None:
        """The soloed mode; 0: none, all are heard."""
        self._solo.setText(f"Mode {mode} solo  ✕")
        self._solo.setVisible(mode > 0)

    def say_briefly(self, text: str) -> None:
        """Shows a text over the window for BRIEFLY_MS: what a key did, which may not be visible."""
        place = self.mapToGlobal(QPoint(self.width() // 2, self._head.geometry().bottom()))
        QToolTip.showText(place, plain_tip(text), self, QRect(), BRIEFLY_MS)

    def geometry_text(self) -> str:
        """Size and place, for `restore_geometry`."""
        return bytes(self.saveGeometry().toBase64().data()).decode("ascii")

    def restore_geometry(self, text: str) -> None:
        """Restores size and place ("": none), no larger than the present screen."""
        if text:
            self.restoreGeometry(QByteArray.fromBase64(text.encode("ascii", "ignore")))
        if not self.isMaximized() and not self.isFullScreen():
            room = self.screen().availableSize()
            self.resize(self.size().boundedTo(room.shrunkBy(QMargins(0, TITLE_BAR, 0, 0))))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """A small window has narrower margins, and neither brand nor instrument button."""
        super().resizeEvent(event)
        for spared in (self._brand, self._instrument_button):  # the menu shows and hides the instrument too
            spared.setVisible(self.width() >= WIDE)
        self._share_height()
        narrow, low = self.width() < ROOMY, self.height() < KNOBS_HIGH
        self.transport.set_compact(narrow)
        self._head.setSpacing(6 if narrow else 10)
        aside, above = 8 if narrow else 14, 6 if low else 12
        self._column.setContentsMargins(aside, above, aside, above)
        self._column.setSpacing(6 if low else 10)
        under_head = QPoint(aside, above + self._head.sizeHint().height() + 2)
        self.notices.place(under_head, self.width() - 2 * aside)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if not self._painted:
            self._painted = True
            QTimer.singleShot(0, self.first_painted.emit)

    def showEvent(self, event: QShowEvent) -> None:
        for plot in self.findChildren(QGraphicsView):
            for part in (plot, plot.viewport()):
                part.setAcceptDrops(False)  # it would keep dropped files from the window
        super().showEvent(event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        ours = event.source() is not None  # dragged out of this window
        if not ours and any(url.isLocalFile() for url in event.mimeData().urls()):
            _copy(event)

    def dropEvent(self, event: QDropEvent) -> None:
        _copy(event)
        for url in event.mimeData().urls():
            if url.isLocalFile():
                self.file_dropped.emit(url.toLocalFile())

    def closeEvent(self, event: QCloseEvent) -> None:
        if not self.may_close():
            event.ignore()
            return
        self.closing.emit()
        super().closeEvent(event)


def _copy(event: QDropEvent) -> None:
    """Never a move, after which a file manager would delete the user's file."""
    event.setDropAction(Qt.DropAction.CopyAction)
    event.accept()
