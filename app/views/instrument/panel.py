"""The instrument's strip: its bar, the string's knobs (if shown), the keys or the neck, and what keys play.

In a low window the string's knobs take the place of the keys and the switches of techniques. So the strip is no
higher with them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtGui import QAction, QActionGroup, QResizeEvent
from PySide6.QtWidgets import (
    QFrame,
    QGridLayout,
    QMenu,
    QSizePolicy,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.views import theme
from app.views.controls.parts import filled, tool_button
from app.views.controls.plain import Label
from app.views.controls.segments import Segments
from app.views.controls.sideways import Sideways
from app.views.instrument.instrument_bar import InstrumentBar
from app.views.instrument.neck import Neck
from app.views.instrument.piano_keys import PianoKeys
from app.views.instrument.string_knobs import StringKnobs

if TYPE_CHECKING:
    from app.playing.keys import SoundingNote

HINTS = {"keys": "Press A … L, or click the keys", "neck": "Press A … L, or click the strings"}
NO_STRINGS = "Drums have no strings to show: keys strike them"
FOLD_TIP = "Show every knob of the string in place of the macros, or the macros again"
LOW_TIP = "Show every knob of the string in place of macros and keys, or these again"
COMPACT_BELOW_PX = 1320  # a narrower panel has a compact bar
TIGHT = 900  # pixels: a narrower panel has a tight bar, with fewer buttons than a compact one
PLAYS_WIDTH = 164  # pixels: of the longer words, so that the keys beside them stay where they are
KEYS_PLAY = {  # what the computer's keys play -> (words, tip)
    "pitch": ("Keys play notes", "The computer's keys play the instrument, as a piano's two rows"),
    "place": (
        "Keys set pluck position",
        "The computer's keys pluck the chosen preset at ten places along its string",
    ),
}
_SURFACES = (
    ("keys", "Keys", "Show a piano's keyboard"),
    ("neck", "Strings", "Show the strings and where they are stopped"),
)


_TOUCHES = (  # what a key does while another is held
    ("pluck", "Pluck", "Every key plucks its string"),
    (
        "legato",
        "Legato",
        "Hammer-on and pull-off: a key moves the note of the one that is held, without a pluck. "
        "Of MIDI keyboards the legato footswitch does this (controller 68)",
    ),
    (
        "slide",
        "Slide",
        "A key slides the note of the one that is held along its string. Of MIDI keyboards portamento does this "
        "(controllers 65 and 5, with 68)",
    ),
)
_TECHNIQUES = (  # that keys are played with; their amounts have knobs
    ("strum", "Strum", "The keys of a chord are plucked string by string. Of MIDI: controller 82"),
    ("tremolo", "Tremolo", "A key that is held plucks again and again. Of MIDI: controller 81"),
    (
        "harmonics",
        "Harm.",
        "Harmonics: a finger touches the string at its middle, or at another node, as it is plucked. "
        "Of MIDI: controller 80",
    ),
)


class InstrumentPanel(QFrame):
    """The panel of an instrument, whose parts are public: `bar`, `keys`, `neck`, `knobs`.

    A surface is what is played with the mouse: "keys" or "neck". Unfolded, all knobs of the string are shown. In a
    low window, one of little height, these then hide the surface.
    """

    pressed = Signal(int, int, object)  # key, velocity, string as of `Playable`
    released = Signal(int, object)
    keys_play_asked = Signal(str)  # of KEYS_PLAY
    touch_chosen = Signal(str)  # of _TOUCHES
    technique_switched = Signal(str, bool)  # of _TECHNIQUES, and whether it is on

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("panel")
        self.setAccessibleName("Instrument")
        self.bar, self.knobs = InstrumentBar(), StringKnobs()
        self.keys, self.neck = PianoKeys(), Neck()
        self._surfaces = self.keys, self.neck
        for surface in self._surfaces:
            surface.pressed.connect(self._press)
            surface.released.connect(self.released)
        self._drums = False  # the instrument has drums, whose surface is always the keys
        self.touch = Segments("Key while another is held", _TOUCHES)
        self.touch.chosen.connect(self._choose_touch)
        self.techniques = Segments("Technique", _TECHNIQUES, switches=True)
        self.techniques.switched.connect(self.technique_switched)
        self._choice = Segments("Surface", _SURFACES)
        self._choice.chosen.connect(self.show_surface)
        self._choice.clicked.connect(self._uncover_surface)
        self._fold = tool_button("String knobs", tip=FOLD_TIP, kind="small", checkable=True)
        self._fold.toggled.connect(self.set_unfolded)
        tip = "No finger on the neck: clicks play frets again (Delete)"
        self._lift = tool_button("Lift fingers", tip=tip, kind="small", pressed=self.neck.lift)
        self._lift.hide()
        self.neck.fingered.connect(self._show_lift)
        self._build_plays()
        for button in (self._fold, self._lift, self.plays):
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._low = False  # the window has little height
        self._hinted = False  # the hint was hidden, which is for good
        self._instrument_area = True  # bar and knobs are shown, not the surface alone
        self._stack = QStackedWidget()
        self._hint = Label(HINTS["keys"], self._stack, objectName="hint")
        self._hint.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._lay_out()

    def _lay_out(self) -> None:
        """Lay out the bar above, a column of buttons at the left, and beside it the surfaces, one at a time."""
        for surface in self._surfaces:
            self._stack.addWidget(surface)
        self._stack.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._bar_row, self._knobs_row = Sideways(self.bar), Sideways(self.knobs)
        buttons = self._choice, self._fold, self.plays, self.touch, self.techniques, self._lift
        self._grid = QGridLayout(self)
        self._grid.setHorizontalSpacing(8)
        self._grid.setColumnStretch(1, 1)
        self._grid.addWidget(self._bar_row, 0, 0, 1, 2)
        self._grid.addLayout(filled(QVBoxLayout(), *buttons, None, spacing=4), 2, 0)
        self._grid.addWidget(self._stack, 2, 1)
        self._share_room()
        self._stack.installEventFilter(self)
        self._hint.installEventFilter(self)
        self.show_keys_play("pitch", possible=True)
        theme.changes.theme_changed.connect(self._fit)  # with the size of text

    def _build_plays(self) -> None:
        """Build the menu of the two things that the computer's keys play, under the present one."""
        self.plays = tool_button("", kind="chip", minimumWidth=PLAYS_WIDTH)
        self.plays.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self.plays)
        menu.setToolTipsVisible(True)
        group = QActionGroup(menu)
        self._plays: dict[str, QAction] = {}
        for key, (words, tip) in KEYS_PLAY.items():
            action = self._plays[key] = QAction(words, group, toolTip=tip, checkable=True)
            action.triggered.connect(lambda _=False, key=key: self.keys_play_asked.emit(key))
            menu.addAction(action)
        self.plays.setMenu(menu)

    # What is shown

    @property
    def surface(self) -> str:
        return self._choice.key

    def show_surface(self, surface: str) -> None:
        """Show "keys" or "neck", and its hint; of drums always the keys, while the choice is remembered."""
        self._choice.show_key(surface)
        shown_surface = "keys" if self._drums else surface
        self._stack.setCurrentWidget(self.keys if shown_surface == "keys" else self.neck)
        self._hint.setText(HINTS[shown_surface])
        self._place_hint()
        self._show_lift()

    def set_drums(self, drums: bool) -> None:
        """Set the panel for drums, which have no strings. Their keys are shown, whatever the surface is."""
        if drums != self._drums:
            self._drums = drums
            self._choice.setEnabled(not drums)
            self._choice.setToolTip(NO_STRINGS if drums else "")
            self._fold.setText("Drum knobs" if drums else "String knobs")
            self.touch.setEnabled(not drums)
            self.techniques.setEnabled(not drums)
            self.show_surface(self.surface)

    @property
    def unfolded(self) -> bool:
        return self._fold.isChecked()

    def set_unfolded(self, unfolded: bool) -> None:
        self._fold.setChecked(unfolded)
        self._share_room()

    def show_instrument_area(self, shown: bool) -> None:
        """Show the bar and the knobs of the string, or only what is played on."""
        self._instrument_area = shown
        self._bar_row.setVisible(shown)
        self._fold.setVisible(shown)
        self._share_room()

    def set_low(self, low: bool) -> None:
        """Set the panel for a window with little height: the string's knobs then take the place of the keys."""
        if low != self._low:
            self._low = low
            self._share_room()

    def _uncover_surface(self) -> None:
        """Fold the knobs of the string in a low window, where they hide the surface that was clicked."""
        if self._low:
            self.set_unfolded(False)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Set the bar compact or tight by the panel's width; both limits grow with the text."""
        self.bar.set_compact(self.width() < theme.px(COMPACT_BELOW_PX), self.width() < theme.px(TIGHT))

    def _share_room(self) -> None:
        """Place the knobs of the string above the surface, or in a low window in its place; show what is unfolded."""
        self._grid.removeWidget(self._knobs_row)
        self._grid.addWidget(self._knobs_row, *((2, 1, 1, 1) if self._low else (1, 0, 1, 2)))
        self._grid.setContentsMargins(*((12, 4, 12, 6) if self._low else (12, 8, 12, 10)))
        self._grid.setVerticalSpacing(6 if self._low else 8)
        self._fold.setToolTip(LOW_TIP if self._low else FOLD_TIP)
        unfolded = self.unfolded and self._instrument_area
        self._knobs_row.setVisible(unfolded)
        for part in (self._stack, self.techniques):
            part.setVisible(not (self._low and unfolded))
        self.bar.show_macros(not unfolded)

    def set_range(self, low: int, high: int) -> None:
        for surface in self._surfaces:
            surface.set_range(low, high)

    def show_keys_play(self, plays: str, possible: bool) -> None:
        """Show what the computer's keys play, of KEYS_PLAY. `possible`: there is an instrument for pitches."""
        words, tip = KEYS_PLAY[plays]
        self._plays[plays].setChecked(True)
        self.plays.setText(f"{words}  ▾")
        self.plays.setAccessibleName(words)
        self.plays.setEnabled(possible)
        self.plays.setToolTip(
            tip + ("; click to change it" if possible else ". Choose an instrument to play pitches")
        )
        self.bar.show_pitches(plays == "pitch")

    def show_sounding(self, levels: Mapping[int, float], notes: Iterable[SoundingNote] = ()) -> None:
        """Show the loudness of each key, 0 … 1, and the notes with their strings.

        The hint is hidden once one sounds.
        """
        if levels:
            self.hide_hint()
        for surface in self._surfaces:
            surface.show_sounding(levels)
        self.neck.show_notes(notes)

    def show_source(self, source: str) -> None:
        for surface in self._surfaces:
            surface.show_source(source)

    def hide_hint(self) -> None:
        self._hint.hide()
        self._hinted = True

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.EnabledChange:
            self._hint.setVisible(self.isEnabled() and not self._hinted)

    def release_all(self) -> None:
        for surface in self._surfaces:
            surface.release_all()

    def _show_lift(self) -> None:
        self._lift.setVisible(bool(self.neck.fingers) and self._stack.currentWidget() is self.neck)

    def _choose_touch(self, touch: str) -> None:
        self.keys.legato = self.neck.legato = touch != "pluck"
        self.touch_chosen.emit(touch)

    def _press(self, key: int, velocity: int, string: int | None) -> None:
        self.hide_hint()
        self.pressed.emit(key, velocity, string)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Keep the hint in the middle as the surface changes its size, or the hint its style."""
        if watched is self._stack and event.type() in (QEvent.Type.Resize, QEvent.Type.Show):
            self._place_hint()
        elif watched is self._hint and event.type() == QEvent.Type.StyleChange:
            QTimer.singleShot(0, self, self._place_hint)  # when the label has taken the style
        return super().eventFilter(watched, event)

    def _place_hint(self) -> None:
        self._hint.adjustSize()
        self._hint.move((self._stack.width() - self._hint.width()) // 2, 8)
        self._hint.raise_()
