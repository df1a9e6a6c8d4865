"""The transport bar: play, loop, the slots A and B, pluck, listening points, slow motion, volume and export."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QMargins, QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLayout, QSizePolicy, QSpacerItem, QVBoxLayout, QWidget

from app.session.choices import Choices
from app.shared.parameters import OF_CHOICES
from app.views import theme
from app.views.controls.drag_handle import DragHandle
from app.views.controls.knob import Knob
from app.views.controls.meter import Meter
from app.views.controls.parts import NO_MARGINS, filled, push_button, tool_button, vertical_rule
from app.views.controls.plain import Label
from app.views.controls.shape_box import AT_BRIDGE, NO_WIDTH, pickup_box, shape_box
from app.views.controls.slot_buttons import SlotButtons
from app.views.faces import Area
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S, FULL_SCALE_N
from engine.pluck import SHAPES

KNOBS = ("position", "amplitude_mm", "width", "listen", "listen_right", "seconds", "speed", "volume_db")
TRAINED_TIP = "Pluck in the middle of what the preset was trained on: shape, place, height and width (Ctrl+Shift+P)"
OF_THE_INSTRUMENT = "While keys play the instrument, it is the instrument's own and is saved with it"


class TransportBar(QFrame):
    """Gestures emit signals and change nothing; `show_choices` shows what became of them.

    The slots A and B hold a source each, such as model or truth; one of them is heard. As trained: plucked in the
    middle of what the preset's model was trained on.
    """

    play_asked = Signal()
    trained_asked = Signal()
    export_asked = Signal()
    change_asked = Signal(str, object)  # a field of `Choices` and its new value

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("panel")
        self.knobs = {field: Knob(OF_CHOICES[field]) for field in KNOBS}
        for field, knob in self.knobs.items():
            knob.value_asked.connect(partial(self.change_asked.emit, field))
        self.meter = Meter()
        self._loop = tool_button("⟳  Loop", "Loop", "Repeat (Ctrl+L)", checkable=True)
        self._loop.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self._loop.toggled.connect(partial(self.change_asked.emit, "loop"))
        self._fitted = (False, False, 1.0)  # compact, tight, scale of text
        self._tight, self._verb = False, ""  # symbols in place of words; "Pluck" or "Strike"
        self._groups: list[QHBoxLayout] = []  # rows of controls, each behind a rule
        self._shown: object = None  # the choices that are shown, without the slots; None: none are
        self._playing: bool | None = None  # as shown; None after a click, which checks the button by itself
        self._row = row = filled(QHBoxLayout(self), spacing=5, margins=QMargins(12, 8, 12, 8))
        self.slots = SlotButtons()
        self.slots.change_asked.connect(self.change_asked)
        knobs = self.knobs
        pluck = (self._build_shape(), knobs["position"], knobs["amplitude_mm"], knobs["width"])
        listener = self._group(knobs["listen"], knobs["listen_right"], self._build_pickup())
        self.areas: dict[Area, tuple[QWidget, ...]] = {
            "slots": (self._group(self.slots),),
            "pluck": (self._group(*pluck),),
            "time": (self._group(knobs["seconds"], knobs["speed"]),),
        }
        areas = *self.areas["slots"], *self.areas["pluck"], listener, *self.areas["time"]
        self._play = push_button("", kind="play", pressed=self._ask_play, checkable=True)
        self._show_verb("Pluck")
        filled(row, filled(QVBoxLayout(), self._play, self._loop), *areas)
        self._space = QSpacerItem(0, 0, QSizePolicy.Policy.Expanding)
        row.addItem(self._space)
        tip = "Save what you hear as a WAV or FLAC file (Ctrl+E)"
        self.export = push_button("Export …", tip, "Export", pressed=self.export_asked)
        self.handle = DragHandle()
        column = filled(QVBoxLayout(), self.meter, self.export, self.handle, spacing=3)
        filled(row, vertical_rule(), knobs["volume_db"], column)

    def add_group(self, group: QWidget) -> None:
        """Put controls of others behind its own, before the volume."""
        self._row.insertWidget(self._row.indexOf(self._space), group)

    def set_compact(self, compact: bool, tight: bool = False) -> None:
        """Narrow the bar by a fifth, for a window of little width; `tight`: for even less, with symbols for words."""
        if (compact, tight, theme.present.scale) == self._fitted:
            return
        self._fitted = compact, tight, theme.present.scale
        self._tight, self._playing = tight, None
        self._loop.setText("⟳" if tight else "⟳  Loop")
        self.show_playing(self._play.isChecked())
        self._row.setContentsMargins(*((4, 8, 4, 8) if compact else (12, 8, 12, 8)))
        self._row.setSpacing(2 if compact else 5)
        for group in self._groups:
            group.setSpacing(1 if compact else 5)
        for knob in self.knobs.values():
            knob.set_narrow(compact)
        self.slots.set_narrow(compact, tight)
        self.handle.set_compact(compact)
        for button in (self._play, self._loop, self._stereo, self._trained, self.export):
            button.setProperty("compact", compact)
            button.setProperty("tight", tight)
            button.style().unpolish(button)
            button.style().polish(button)

    def show_choices(self, choices: Choices) -> None:
        """Show the values on knobs, boxes and slots; disable those that have no effect with the present choices."""
        self.slots.show_choices(choices)
        values = {field: choices.value(field) for field in KNOBS}
        shown = values, choices.pluck.shape, choices.loop, choices.pickup, choices.drums is None
        if shown == self._shown:
            return
        self._shown = shown
        for field, knob in self.knobs.items():
            knob.set_value(values[field])
        self.knobs["width"].set_barred(NO_WIDTH if choices.pluck.shape == "triangular" else "")
        self._shape.setCurrentIndex(SHAPES.index(choices.pluck.shape))
        self._loop.setChecked(choices.loop)
        for field in ("listen", "listen_right"):
            self.knobs[field].set_barred(AT_BRIDGE if choices.pickup.kind == "bridge" else "")
        # not hidden, which would move the controls beside it
        self.knobs["listen_right"].setEnabled(choices.stereo and choices.pickup.kind != "bridge")
        with QSignalBlocker(self._stereo):
            self._stereo.setChecked(choices.stereo)
        self._pickup.setCurrentIndex(self._pickup.findData(choices.pickup.kind))
        for part in (*self.areas["pluck"], self._pickup, self._loop):
            part.setEnabled(choices.drums is None)  # they are of a string
        self._show_verb("Pluck" if choices.drums is None else "Strike")

    def show_trained(self, why_not: str) -> None:
        """Let the string be plucked as trained; `why_not`: the reason why it cannot be, or ""."""
        self._trained.setEnabled(not why_not)
        self._trained.setToolTip(why_not or TRAINED_TIP)

    def show_playing(self, playing: bool) -> None:
        """Show on the play button "Stop" while it plays, else "Pluck" or "Strike"; the sign alone in a tight bar."""
        if playing == self._playing:
            return
        self._playing = playing
        self._play.setChecked(playing)
        words = "■  Stop" if playing else f"▶  {self._verb}"
        self._play.setText(words[0] if self._tight else words)

    def _show_verb(self, verb: str) -> None:
        """Name the play button "Pluck", for a string, or "Strike", for drums."""
        if verb != self._verb:
            self._verb = verb
            self._play.setAccessibleName(f"{verb} or stop")
            self._play.setToolTip(f"{verb} the {'string' if verb == 'Pluck' else 'drum'}, or stop (Space)")
            self._playing = None
            self.show_playing(self._play.isChecked())

    def _ask_play(self) -> None:
        self._playing = None
        self.play_asked.emit()

    def _build_pickup(self) -> QVBoxLayout:
        """Build the switch of stereo, above the box of pick-ups."""
        tip = f"Two listening points: “listen” for the left channel, “right” for the right\n{OF_THE_INSTRUMENT}"
        self._stereo = tool_button("Stereo", tip=tip, checkable=True)
        self._stereo.toggled.connect(partial(self.change_asked.emit, "stereo"))
        self._pickup = pickup_box(
            f"Point: displacement of the listening point (full scale {1000 * FULL_SCALE_M:g} mm)\n"
            f"Magnetic: velocity of that point, as a magnetic pick-up senses it: brighter "
            f"(full scale {FULL_SCALE_M_S:g} m/s)\n"
            f"Bridge: the force on the end at 0, which drives a body (full scale {FULL_SCALE_N:g} N)\n"
            f"{OF_THE_INSTRUMENT}",
            partial(self.change_asked.emit, "pickup_kind"),
        )
        self._stereo.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        return filled(QVBoxLayout(), self._stereo, self._pickup)

    def _build_shape(self) -> QVBoxLayout:
        """Build the box of the pluck's shapes, above the button that plucks as trained."""
        self._shape = shape_box(partial(self.change_asked.emit, "shape"))
        column = QVBoxLayout()
        column.addWidget(Label("PLUCK", objectName="knob"), alignment=Qt.AlignmentFlag.AlignHCenter)
        column.addStretch(1)
        column.addWidget(self._shape)
        self._trained = tool_button("As trained", "Pluck as trained", TRAINED_TIP, pressed=self.trained_asked)
        self._trained.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        column.addWidget(self._trained)
        column.addStretch(1)
        return column

    def _group(self, *parts: QWidget | QLayout) -> QWidget:
        """A rule and parts beside each other, which are shown and hidden together."""
        group = QWidget()
        row = filled(QHBoxLayout(group), vertical_rule(), *parts, spacing=5, margins=NO_MARGINS)
        self._groups.append(row)
        return group
