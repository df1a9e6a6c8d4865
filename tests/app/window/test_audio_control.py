"""What becomes of a choice of output: opened, refused, saved, reported."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from PySide6.QtWidgets import QLabel

from app.audio.choices import DeviceChoice, SoundChoice
from app.audio.devices import AudioDevice
from app.audio.problems import AudioProblem, ProblemKind, problem
from app.audio.sound import SoundStatus
from app.views.dialogs.audio_dialog import AudioDialog
from app.window import audio_control
from app.window.audio_control import FREQUENT_GAPS, AudioControl
from app.window.main_window import MainWindow
from engine.voices import Gap
from tests.app.window.conftest import SPEAKERS
from tests.app.window.driver import press

GAPS = tuple(Gap(0.5 * number, "device", 2.0) for number in range(4))
WISH = (DeviceChoice(name="Loud", host_api="JACK"), SoundChoice(rate_hz=96_000, buffer=256))


class Desk:
    """The control, its dialog, and an output that notes what it is asked for."""

    def __init__(self, window: MainWindow) -> None:
        self.opened: list[tuple[Any, ...]] = []
        self.tones: list[str] = []
        self.present = SoundStatus(device=SPEAKERS, gaps=GAPS)
        self.notices = window.notices
        output = SimpleNamespace(
            open=lambda *given: self.opened.append(given),
            sound_tone=self.tones.append,
            status=lambda: self.present,
        )
        self.control = AudioControl(window, lambda report: output, None, SoundChoice())  # type: ignore[arg-type, return-value]
        self.control.open()
        self.control.show_dialog()
        (self.dialog,) = window.findChildren(AudioDialog)

    def show(self, **status: Any) -> None:
        """Tell the control the state of the output, as the window does ten times a second."""
        notes = SimpleNamespace(latencies_s=(), forget_latencies=lambda: None)
        self.control.show(SoundStatus(**{"device": SPEAKERS, **status}), notes, None)  # type: ignore[arg-type]

    @property
    def saved(self) -> tuple[DeviceChoice | None, SoundChoice]:
        return self.control.device, self.control.sound

    def words(self) -> list[str]:
        return [label.text() for label in self.dialog.findChildren(QLabel)]


@pytest.fixture
def desk(qtbot, monkeypatch) -> Iterator[Desk]:
    monkeypatch.setattr(audio_control, "output_devices", lambda rescan=False: [SPEAKERS])
    window = MainWindow()
    qtbot.addWidget(window)
    made = Desk(window)
    yield made
    made.dialog.close()


def test_a_choice_is_saved_once_it_plays_and_reported_where_it_is_refused(desk):
    assert desk.opened == [(None, SoundChoice(), False)]
    desk.dialog.choice_made.emit(*WISH)
    assert desk.opened[-1] == (*WISH, False)
    desk.present = SoundStatus(device=SPEAKERS, changes_done=2, problem="It refuses 96000 Hz.")
    desk.control.report(AudioProblem(ProblemKind.RATE_REFUSED, "It refuses 96000 Hz.", "Choose another.", "code"))
    desk.show(changes_done=2, problem="It refuses 96000 Hz.")
    assert "Playback continues on “Speakers”" in desk.notices.text and desk.notices.notices[-1].details == "code"
    assert desk.saved == (None, SoundChoice()) and any("It refuses 96000 Hz." in each for each in desk.words())
    desk.dialog.choice_made.emit(*WISH)
    desk.show(changes_done=2)
    assert desk.saved == (None, SoundChoice()), "it does not play yet"
    desk.show(device=AudioDevice("Loud", "JACK", 96_000), changes_done=3)
    assert desk.saved == WISH and desk.notices.text == ""
    desk.control.report(problem(ProblemKind.STALLED, "Speakers"))
    assert "keeps trying" in desk.notices.text and "Playback continues on" not in desk.notices.text
    desk.show()
    assert desk.notices.text == ""
    press(desk.dialog, "Rescan")
    assert desk.opened[-1] == (*desk.opened[-2][:-1], True)
    press(desk.dialog, "Left")
    assert desk.tones == ["left"]


def test_gaps_count_from_the_reset_and_frequent_ones_are_reported_once_for_a_buffer(desk):
    assert any("4, the last at 1.5 s: device" in each for each in desk.words())
    press(desk.dialog, "Reset")
    late = Gap(7.25, "rendering", 0.0)
    one = "1, the last at 7.2 s: rendering"
    for gaps, words in ((GAPS, "0"), ((*GAPS, late), one), ((late,), one)):  # only so many are remembered
        desk.show(gaps=gaps)
        assert words in desk.words()
    desk.dialog.choice_made.emit(None, SoundChoice())
    desk.notices.withdraw(FREQUENT_GAPS)
    close = tuple(Gap(time_s, "the sound device was late", 5.0) for time_s in (20.0, 21.0, 22.0))
    apart = tuple(replace(gap, time_s=20 * gap.time_s) for gap in close)
    for gaps, reported in ((close[:2], False), (apart, False), (close, True)):
        desk.show(gaps=gaps)
        assert (desk.notices.text == FREQUENT_GAPS) == reported
    for buffer, reported in ((None, False), ("high", True)):
        desk.notices.withdraw(FREQUENT_GAPS)
        if buffer:
            desk.dialog.choice_made.emit(None, SoundChoice(buffer=buffer))
        desk.show(gaps=close)
        assert desk.notices.isHidden() is not reported
