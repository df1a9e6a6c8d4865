"""The transport of a MIDI file: its name, play or stop, and its position."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QSlider, QWidget

from app.views.controls.elided_label import ElidedLabel
from app.views.controls.parts import NO_MARGINS, faint, filled, tool_button

STEPS_PER_S = 10  # steps of the slider
KEY_STEP_S, PAGE_STEP_S = 1, 10  # by an arrow key, and by Page up and Page down
NARROWEST_NAME = 80  # pixels


class SongStrip(QWidget):
    """A strip that is hidden while there is no file. Gestures emit signals; setters show what became of them."""

    play_asked = Signal()  # or stop
    seek_asked = Signal(float)  # to a time in s
    close_asked = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("MIDI file")
        self._length_s = 0.0
        tip = "Play or stop the MIDI file"
        self.play = tool_button("▶", "Play the MIDI file", tip, "narrow", self.play_asked)
        self.name = ElidedLabel(minimumWidth=NARROWEST_NAME)
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setAccessibleName("Position in the MIDI file")
        self.slider.setToolTip("Position in the MIDI file; arrow keys move it by a second")
        self.slider.setSingleStep(KEY_STEP_S * STEPS_PER_S)
        self.slider.setPageStep(PAGE_STEP_S * STEPS_PER_S)
        self.slider.valueChanged.connect(self._ask)
        self.time = faint()
        tip = "Stop and close the MIDI file"
        self.closer = tool_button("✕", "Close the MIDI file", tip, "narrow", self.close_asked)
        row = filled(QHBoxLayout(self), margins=NO_MARGINS)
        for widget, share in ((self.play, 0), (self.name, 1), (self.slider, 3), (self.time, 0), (self.closer, 0)):
            row.addWidget(widget, share)
        self._shown_step = 0  # of the slider, as set last by the song or the user
        self.hide()

    def show_song(self, name: str, length_s: float) -> None:
        self._length_s = length_s
        self.name.say(name)
        self.name.setToolTip(name)
        self.slider.setMaximum(max(1, round(length_s * STEPS_PER_S)))
        self.show()

    def show_position(self, position_s: float, playing: bool) -> None:
        """Show the time that is reached and whether it plays; the slider stays while the user drags it."""
        self.play.setText("■" if playing else "▶")
        self.time.setText(f"{_clock(position_s)} / {_clock(self._length_s)}")
        self.slider.setAccessibleDescription(_clock(position_s))
        if not self.slider.isSliderDown():
            self._shown_step = round(position_s * STEPS_PER_S)
            self.slider.setValue(self._shown_step)

    def _ask(self, step: int) -> None:
        """Ask for the time of a step of the slider that the user, not `show_position`, has set."""
        if step != self._shown_step:
            self._shown_step = step
            self.seek_asked.emit(step / STEPS_PER_S)


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
