"""The window: its parts, where they stand, and its keys. What they do is connected in `controller`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote_to_bytes

from PySide6.QtCore import QByteArray, QEvent, QMargins, QObject, QPoint, QRect, Qt, QTimer, QUrl, Signal
from PySide6.QtGui import (
    QCloseEvent,
    QDragEnterEvent,
    QDragLeaveEvent,
    QDropEvent,
    QKeySequence,
    QPaintEvent,
    QResizeEvent,
    QShortcut,
    QShowEvent,
)
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QGraphicsView,
    QHBoxLayout,
    QMainWindow,
    QSplitter,
    QStackedWidget,
    QTabBar,
    QToolTip,
    QVBoxLayout,
    QWidget,
)

from app.shared.vocabulary import Face
from app.views import theme
from app.views.controls.app_menu import AppMenu, menu_button
from app.views.controls.choosers import PresetBar
from app.views.controls.deck import Deck
from app.views.controls.drop_sign import DropSign
from app.views.controls.focus_ring import FocusRing
from app.views.controls.notice_bar import NoticeBar
from app.views.controls.overflow import Overflow
from app.views.controls.parts import faint, filled, tool_button, words_label
from app.views.controls.plain import Label, plain_tip
from app.views.controls.segments import Segments
from app.views.controls.sideways import Sideways
from app.views.controls.song_strip import SongStrip
from app.views.controls.transport_bar import TransportBar
from app.views.faces import FACES, TITLES, Area
from app.views.file_places import FilePlaces
from app.views.instrument.panel import InstrumentPanel
from app.views.look import Look
from engine.kernels import cache  # and not the compiler
from engine.plain_text import one_line

FAILED = "The models cannot be loaded."
LOADING, COMPILING = "Loading the models …", "Preparing the sound engine, once: one to five minutes …"
# sizes of the window, in pixels at the usual size of text
WIDE = 1100  # in a narrower one brand, keys and ABX button are hidden or in the overflow menu
HIGH = 560  # in a lower one the preset's facts are in the overflow menu
WIDE_LAB = 1500  # in the Lab a narrower one leaves the brand's room to the preset's name
COMPACT_BELOW_PX, TIGHT = 1240, 900  # narrower: controls are compact; in the Lab symbols stand for words, too
ALL_HIGH = 640  # a lower one shows the instrument instead of the views, while the keys are shown
KNOBS_HIGH, AIRY = 610, 780  # lower than the first: knobs in place of keys; than the second: parts stand closer
FACTS_HEIGHT = 20  # of the row with the preset's facts
BRIEFLY_MS = 1_800  # a text over the window
LONGEST_NAME = 60  # characters of a file
FILE_FILTER = (
    "Files that can be opened (*.mid *.midi *.kar *.rmi *.smf *.json *.scl *.kbm *.safetensors"
    " *.wav *.wave *.bwf *.flac *.aif *.aiff *.aifc *.ogg *.oga *.opus)"
    ";;All files (*)"
)
TITLE_BAR = 40  # pixels, at most; its height is known only once the window is shown

PLAYED_KEYS = (  # see `app/playing/keyboard.py`
    ("A S D F …  W E …", "play notes, as on a piano: white keys below, black keys above"),
    ("Z   X", "an octave lower, higher"),
    ("1 … 9", "velocity, from softest to loudest (not while a knob has the keyboard focus)"),
    ("C   V", "softer, harder"),
    (
        "A S D F G H J K L ;",
        "where keys choose the place, or without an instrument: pluck at ten places, left to right",
    ),
)


class MainWindow(QMainWindow):
    """The main window.

    Its parts are public: `presets`, `left`, `right`, `transport`, `instrument`, `notices`, `menu`, `places`.
    A face is one of two looks: Play, with instrument and string, and the Lab, with the views of `left` and `right`.
    """

    pluck_asked = Signal()
    face_asked = Signal(str)
    file_dropped = Signal(object)  # a Path, whose name may have bytes that are no UTF-8
    closing = Signal()
    first_painted = Signal()  # once, after the first paint

    def __init__(self) -> None:
        super().__init__()
        self.setWindowTitle("Learned Strings")
        self.setMinimumSize(760, 480)
        self.resize(1280, 800)
        self._painted = False  # the first paint was seen
        self.places = FilePlaces()
        self._tabbed_to: QWidget | None = None  # what got the keyboard by the Tab key
        self.look = Look()
        self.may_close: Callable[[], bool] = lambda: True  # asked before it is closed
        self.menu = AppMenu(self)
        self.action = self.menu.action
        self._menu_button = menu_button(self.menu)
        self.face: Face = "play"
        self.presets = PresetBar()
        self.left, self.right = Deck("Views on the left"), Deck("Views on the right")
        self.transport = TransportBar()
        self.song = SongStrip()
        self.instrument = InstrumentPanel()
        self.notices = NoticeBar()
        self.error_label = Label()
        self.error_label.setToolTip(
            "Mean absolute error of the model relative to the truth, for this pluck and the whole string:\n"
            "within the time that the model was trained for, and after it"
        )
        self._solo = tool_button("", "Play all modes", "One mode is soloed; click, or Esc, to play all modes")
        self._solo.setObjectName("solo")
        self._solo.setVisible(False)
        self._solo.clicked.connect(self.action["all_modes"].trigger)
        self.rate_label = Label()
        self.rate_label.setObjectName("badge")
        self._audio_button = tool_button("Audio …", "Audio settings", "Audio output, sample rate and buffer (Ctrl+,)")
        self._audio_button.clicked.connect(self.action["audio"].trigger)
        tip = "Show or hide the keys (Ctrl+K). In a low window they take the place of the plots"
        self._keys_button = tool_button("Keys", tip=tip)
        self._keys_button.setCheckable(True)
        self._keys_button.toggled.connect(self.show_keys)
        self.faces = Segments("Face", TITLES)
        self.faces.chosen.connect(self.face_asked)
        self.growth_sign = Label("i")
        self.growth_sign.setObjectName("badge")
        self.growth_sign.setAccessibleName("Error of the model")
        self.through_label = words_label()
        self.outside_label = words_label()
        self._lay_out()
        self.setAcceptDrops(True)
        self.menu.look_asked.connect(self._change_look)
        self.menu.recent_asked.connect(self.file_dropped)
        self.menu.aboutToShow.connect(lambda: self.menu.show_recent(self.places.choices.recent))
        QApplication.styleHints().colorSchemeChanged.connect(self._follow_desktop)
        enter = QShortcut(QKeySequence("Return"), self)
        enter.setAutoRepeat(False)
        enter.activated.connect(self._press_or_pluck)
        for name, do in (
            ("pluck", self.pluck_asked.emit),
            ("notices", self.notices.show_all),
            ("reveal", self.notices.reveal),
            ("menu", self._menu_button.showMenu),
            ("keys", self._keys_button.toggle),
            ("face", lambda: self.face_asked.emit("lab" if self.face == "play" else "play")),
            ("open", self._ask_for_files),
            ("quit", self.close),
        ):
            self.action[name].triggered.connect(lambda _=False, do=do: do())

    def _lay_out(self) -> None:
        """Put the parts in place, from above: header, facts, stage with decks, song, controls, instrument."""
        self._brand = Label("LEARNED STRINGS")
        self._brand.setObjectName("brand")
        tip = "Blind listening test: can you tell A and B apart? (Ctrl+T)"
        self._test_button = test = tool_button("ABX …", "Listening test", tip)
        test.clicked.connect(self.action["abx"].trigger)
        self._more = Overflow("the Lab")
        self._head = head = filled(QHBoxLayout(), self._menu_button, self.faces, self._brand)
        head.addWidget(self.presets, 1)
        head.addStretch(0)  # takes the room where the presets are hidden, as in Play
        badges = (self.growth_sign, self.rate_label, self.notices.bell)
        filled(head, self._keys_button, test, self._more, *badges, self._audio_button)
        self._facts = QWidget()
        self._facts_row = facts = QHBoxLayout(self._facts)
        facts.setContentsMargins(0, 0, 0, 0)
        facts.setSpacing(24)
        for part in (self.presets.card, self._solo):  # of one height, so that the solo button moves nothing
            theme.fix_size(part, height=FACTS_HEIGHT)
        facts.addWidget(self.presets.card, 3)
        facts.addWidget(self.through_label, 2)
        facts.addWidget(self.outside_label, 2)
        filled(facts, self._solo, self.error_label)
        self._decks = decks = QSplitter(Qt.Orientation.Horizontal)
        decks.addWidget(self.left)
        decks.addWidget(self.right)
        decks.setSizes([620, 660])
        self._stage = QSplitter(Qt.Orientation.Vertical)
        self._loading = faint(LOADING if cache.is_whole() else COMPILING)
        self._loading.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._stage.addWidget(self._loading)
        self._shown = QStackedWidget()  # the string or the drum
        self._stage.addWidget(decks)
        self._set_alive(False)
        for splitter in (decks, self._stage):
            splitter.setChildrenCollapsible(False)
            splitter.setHandleWidth(8)
        self.transport.add_group(self.instrument.knobs.technique)
        self._areas: dict[Area, tuple[QWidget, ...]] = {
            "preset": (self.presets,),
            "instrument": (self.instrument.knobs.technique,),
            **self.transport.areas,
        }
        self._column = column = filled(QVBoxLayout(), head, self._facts)
        column.addWidget(self._stage, 1)
        filled(column, self.song, Sideways(self.transport), self.instrument)
        middle = QWidget()
        middle.setLayout(column)
        self.setCentralWidget(middle)
        middle.installEventFilter(self)
        self.notices.setParent(middle)
        FocusRing(middle)
        self._drop_sign = DropSign(self)
        theme.changes.theme_changed.connect(self._fit)

    def show_stage(self, *views: QWidget) -> None:
        """Put the views of string and drum above the decks and enable the window, which was loading."""
        self._loading.hide()
        for view in views:
            self._shown.addWidget(view)
        self._stage.insertWidget(0, self._shown)
        self._stage.setSizes([310, 0, 300])
        self._set_alive(True)

    def show_on_stage(self, view: QWidget, focus: QWidget) -> None:
        """Show the string or the drum on the stage; `focus` in it gets the focus that the other had."""
        before = self._shown.currentWidget()
        if view is before:
            return
        focused = self.focusWidget()
        had_focus = before is not None and focused is not None and before.isAncestorOf(focused)
        self._shown.setCurrentWidget(view)
        if had_focus:
            focus.setFocus()

    def show_failed(self) -> None:
        """Say, in the place of the string, that the models cannot be loaded."""
        self._loading.setText(FAILED)

    def order_tabs(self) -> None:
        """Set the order of the Tab key: header, notice, string, views, controls. Call it once all parts exist."""
        header = (self._menu_button, self.faces, self.presets, self._keys_button, self._test_button, self._more)
        aside = (self.notices.bell, self._audio_button)
        chain: list[QWidget] = []
        views = (self._shown, self.left, self.right)
        for part in (*header, *aside, self.notices, *views, self.song, self.transport, self.instrument):
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
        has_moved = super().focusNextPrevChild(forward)
        self._tabbed_to = self.focusWidget()
        return has_moved

    def _press_or_pluck(self) -> None:
        """Press the button, or open the box, that the Tab key went to; after a click elsewhere, Enter plucks."""
        aimed = self.focusWidget()
        if aimed is self._tabbed_to and isinstance(aimed, QAbstractButton):
            aimed.animateClick()
        elif aimed is self._tabbed_to and isinstance(aimed, QComboBox):
            aimed.showPopup()
        else:
            self.pluck_asked.emit()

    def _set_alive(self, alive: bool) -> None:
        """Enable the controls, or disable them while the models are loading."""
        for part in (self.presets, self.transport, self._test_button, self._audio_button, self._menu_button):
            part.setEnabled(alive)
        self._alive = alive
        self.instrument.setEnabled(alive)
        self.faces.setEnabled(alive)
        self._share_room()
        self._show_rate_label()

    # The look

    def show_look(self, look: Look) -> None:
        """Show the look that the application has in the menu."""
        self.look = look
        self.menu.show_look(look)

    def _change_look(self, field: str, value: object) -> None:
        self.show_look(Look.model_validate({**self.look.model_dump(), field: value}))
        self._apply_look()

    def _follow_desktop(self) -> None:
        if self.look.theme == "system":
            self._apply_look()

    def _apply_look(self) -> None:
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        theme.apply_theme(application, self.look.theme, self.look.size_percent)

    # Faces

    def show_face(self, face: Face) -> None:
        """Show the areas of a face, and hide the others."""
        self.face = face
        self.faces.show_key(face)
        for area, widgets in self._areas.items():
            for widget in widgets:
                widget.setVisible(self._shows(area))
        self.instrument.show_instrument_area(self._shows("instrument"))
        self.action["keys"].setEnabled(face == "lab")
        self._column.setStretchFactor(self.instrument, int(face == "play"))
        self._show_growth()
        self._show_rate_label()
        self.show_keys(self.shows_keys)
        self._fit()

    def _shows(self, area: Area) -> bool:
        return area in FACES[self.face]

    @property
    def shows_keys(self) -> bool:
        """Return True if the keys are shown in the Lab; in Play they always are."""
        return self._keys_button.isChecked()

    def show_keys(self, shown: bool) -> None:
        """Show the keys in the Lab, or hide them."""
        self._keys_button.setChecked(shown)
        self.instrument.setVisible(shown or self.face == "play")
        self._share_room()

    @property
    def _size_px(self) -> tuple[float, float]:
        """The window's width and height, in pixels at which text has its usual size."""
        return self.width() / theme.present.scale, self.height() / theme.present.scale

    def _share_room(self) -> None:
        """Hide what has no room: in a low window the plots while the keys are shown, in a lower one the facts.

        The header's controls and the preset's facts go to the overflow menu. The button of a soloed mode moves from
        the row of facts to the header where that row is hidden.
        """
        width, height = self._size_px
        is_high, tests = height >= HIGH, self._shows("test")
        self._brand.setVisible(width >= (WIDE if self.face == "play" else WIDE_LAB))
        buttons = [self._keys_button, self._test_button] if tests and width < WIDE else []
        for button in (self._keys_button, self._test_button):
            button.setVisible(width >= WIDE and tests)
        if tests and width < TIGHT:
            buttons.append(self._audio_button)
        self._audio_button.setVisible(self._audio_button not in buttons)
        facts = (self.presets.card, self.through_label, self.outside_label, self.error_label)
        hides_facts = self._shows("facts") and not is_high
        self._more.hold(*buttons, *(facts if hides_facts else ()))
        self._facts.setVisible(is_high and self._shows("facts"))
        self.instrument.set_low(height < KNOBS_HIGH)
        views = self._alive and self._shows("views") and (height >= ALL_HIGH or not self.shows_keys)
        self._decks.setVisible(views)
        home, place = (self._facts_row, 2) if is_high else (self._head, 4)
        if home.indexOf(self._solo) < 0:
            solo_visible = not self._solo.isHidden()
            home.insertWidget(place, self._solo)
            self._solo.setVisible(solo_visible)

    def show_rate(self, text: str, tip: str, fault: bool) -> None:
        """Show the badge of the sample rate, in the Lab; with `fault`, that there is no sound, in both faces."""
        badge = self.rate_label
        if badge.text() == text:
            return
        badge.setText(text)
        badge.setToolTip(tip)
        badge.setProperty("fault", fault)
        badge.style().polish(badge)
        self._show_rate_label()

    def _show_rate_label(self) -> None:
        fault = bool(self.rate_label.property("fault"))
        has_text = bool(self.rate_label.text())
        self.rate_label.setVisible(self._alive and has_text and (fault or self._shows("test")))

    def show_through(self, text: str, *shorter: str) -> None:
        """Show the instrument that keys sound through in the Lab; "" where a string sounds alone."""
        self.through_label.say(text, *shorter)
        self.through_label.setToolTip(plain_tip(text))
        self.through_label.setVisible(bool(text))

    def show_outside(self, text: str, grave: bool) -> None:
        """Show the parts of the latest note that lie outside the training; "" for nothing. `grave`: as a warning."""
        words = self.outside_label
        words.say(text, text.replace(" is outside the trained ", ", trained "), "outside training")
        words.setToolTip(plain_tip(text))
        words.setObjectName("warning" if grave else "faint")
        words.style().polish(words)

    def show_trained(self, why_not: str) -> None:
        """Let the string be plucked as its preset was trained; `why_not`: the reason why it cannot be, or ""."""
        self.action["trained"].setEnabled(not why_not)
        self.transport.show_trained(why_not)

    def show_growth(self, text: str) -> None:
        """Show that the error of the latest pluck grew; "" where it did not."""
        self.growth_sign.setToolTip(plain_tip(text))
        self.growth_sign.setAccessibleDescription(text)
        self._show_growth()

    def _show_growth(self) -> None:
        self.growth_sign.setVisible(self._shows("growth") and bool(self.growth_sign.toolTip()))

    def show_solo(self, mode: int) -> None:
        """Show the soloed mode; 0: none, all are heard."""
        self._solo.setText(f"Mode {mode} solo  ✕")
        self._solo.setVisible(mode > 0)

    def say_briefly(self, text: str) -> None:
        """Show a text over the window for BRIEFLY_MS: what a key did, which may not be visible."""
        place = self.mapToGlobal(QPoint(self.width() // 2, self._head.geometry().bottom()))
        QToolTip.showText(place, plain_tip(text), self, QRect(), BRIEFLY_MS)

    def geometry_text(self) -> str:
        """Size and place, for `restore_geometry`."""
        return bytes(self.saveGeometry().toBase64().data()).decode("ascii")

    def restore_geometry(self, text: str) -> None:
        """Restore size and place ("": none), no larger than the present screen."""
        if text:
            self.restoreGeometry(QByteArray.fromBase64(text.encode("ascii", "ignore")))
        if not self.isMaximized() and not self.isFullScreen():
            room = self.screen().availableSize()
            self.resize(self.size().boundedTo(room.shrunkBy(QMargins(0, TITLE_BAR, 0, 0))))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Fit the parts to the new size; see `_fit`."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Fit parts, spaces and notices to the size of window and text; a small window has narrower margins."""
        self._share_room()
        width, height = self._size_px
        narrow, low = width < COMPACT_BELOW_PX, height < AIRY
        self.transport.set_compact(narrow, width < TIGHT and self.face == "lab")
        self._head.setSpacing(6 if narrow else 10)
        aside, above = 8 if narrow else 14, 6 if low else 12
        self._column.setContentsMargins(aside, above, aside, above)
        self._column.setSpacing(6 if low else 10)
        self._place_notices()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Move the notices when the header may have another height, as after a change of the text's size."""
        if watched is self.centralWidget() and event.type() == QEvent.Type.LayoutRequest:
            self._place_notices()
        return super().eventFilter(watched, event)

    def _place_notices(self) -> None:
        margins = self._column.contentsMargins()
        under_head = QPoint(margins.left(), margins.top() + self._head.sizeHint().height() + 2)
        self.notices.place(under_head, self.width() - 2 * margins.left())

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

    # Files: dropped, or chosen in a dialog

    def _ask_for_files(self) -> None:
        for file in self.places.ask_to_open(self, FILE_FILTER):
            self.file_dropped.emit(file)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        ours = event.source() is not None  # dragged out of this window
        names = [Path(url.toLocalFile()).name for url in event.mimeData().urls() if url.isLocalFile()]
        if not ours and names:
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            self._drop_sign.show_over(f"Drop to open {one_line(names[0], LONGEST_NAME)}{more}")
            _copy(event)

    def dragLeaveEvent(self, event: QDragLeaveEvent) -> None:
        self._drop_sign.hide()

    def dropEvent(self, event: QDropEvent) -> None:
        self._drop_sign.hide()
        _copy(event)
        for url in event.mimeData().urls():
            if url.isLocalFile():
                self.file_dropped.emit(_local_file(url))

    def closeEvent(self, event: QCloseEvent) -> None:
        if not self.may_close():
            event.ignore()
            return
        self.closing.emit()
        super().closeEvent(event)


def _local_file(url: QUrl) -> Path:
    """The file of a URL; Qt would replace bytes of its name that are no UTF-8."""
    if sys.platform in ("win32", "darwin"):
        return Path(url.toLocalFile())
    path = url.path(QUrl.ComponentFormattingOption.FullyEncoded)
    return Path(os.fsdecode(unquote_to_bytes(path)))


def _copy(event: QDropEvent) -> None:
    """Copy the dropped file, never move it: after a move a file manager would delete the user's file."""
    event.setDropAction(Qt.DropAction.CopyAction)
    event.accept()
