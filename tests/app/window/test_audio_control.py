"""What becomes of a choice of output: opened, refused, saved, reported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from app.audio.choices import DeviceChoice, SoundChoice
from app.audio.devices import AudioDevice
from app.audio.problems import AudioProblem, ProblemKind, internal, stalled
from app.audio.sound import SoundStatus
from app.window import audio_control
from app.window.audio_control import FREQUENT_GAPS, AudioControl
from app.window.main_window import MainWindow
from engine.voices import Gap

SPEAKERS = AudioDevice("Speakers", "ALSA", 48_000)
GAPS = tuple(Gap(0.5 * number, "device", 2.0) for number in range(4))
WISH = (DeviceChoice(name="Loud", host_api="JACK"), SoundChoice(rate_hz=96_000, buffer=256))


class FakeSound:
    """Notes what it is asked for; the test says what became of it."""

    def __init__(self) -> None:
        self.opened: list[tuple[Any, ...]] = []
        self.tones: list[str] = []
        self.present = SoundStatus(device=SPEAKERS, gaps=GAPS)

    def open(self, *arguments: Any) -> None:
        self.opened.append(arguments)

    def sound_tone(self, side: str) -> None:
        self.tones.append(side)

    def status(self) -> SoundStatus:
        return self.present


@pytest.fixture
def output() -> FakeSound:
    return FakeSound()


@pytest.fixture
def control(qtbot: QtBot, output: FakeSound, monkeypatch: pytest.MonkeyPatch) -> Iterator[AudioControl]:
    monkeypatch.setattr(audio_control, "output_devices", lambda rescan=False: [SPEAKERS])
    window = MainWindow()
    qtbot.addWidget(window)
    made = AudioControl(window, output, None, SoundChoice())  # type: ignore[arg-type]
    made.open()
    yield made
    if made._dialog is not None:
        made._dialog.close()


def show(control: AudioControl, status: SoundStatus, latencies_s: tuple[float, ...] = ()) -> None:
    control.show(status, SimpleNamespace(latencies_s=latencies_s, forget_latencies=lambda: None), None)  # type: ignore[arg-type]


def test_the_first_opening(control: AudioControl, output: FakeSound) -> None:
    assert output.opened == [(None, 0.012, 0, 0, False)]


def test_a_choice_is_saved_once_it_plays(control: AudioControl, output: FakeSound) -> None:
    control.show_dialog()
    assert control._dialog is not None
    control._dialog.choice_made.emit(*WISH)
    assert output.opened[-1] == (AudioDevice("Loud", "JACK"), 0.012, 96_000, 256, False)
    show(control, SoundStatus(device=SPEAKERS, changes_done=1))
    assert (control.device, control.sound) == (None, SoundChoice())
    show(control, SoundStatus(device=AudioDevice("Loud", "JACK", 96_000), changes_done=2))
    assert (control.device, control.sound) == WISH


def test_a_refused_choice_is_reported_and_not_saved(control: AudioControl, output: FakeSound) -> None:
    control.show_dialog()
    assert control._dialog is not None
    control._dialog.choice_made.emit(*WISH)
    output.present = SoundStatus(device=SPEAKERS, changes_done=2, problem="It refuses 96000 Hz.")
    control.report(AudioProblem(ProblemKind.RATE_REFUSED, "It refuses 96000 Hz.", "Choose another.", "code"))
    show(control, output.present)
    notices = control._window.notices
    assert "Playback continues on “Speakers”" in notices.text
    assert notices.notices[-1].details == "code"
    assert (control.device, control.sound) == (None, SoundChoice())
    assert "refuses" in control._dialog._problem_label.text()
    control._dialog.rescan_asked.emit()
    assert output.opened[-1][:4] == output.opened[-2][:4]
    show(control, SoundStatus(device=SPEAKERS, changes_done=3))
    assert notices.text == ""


def test_an_internal_fault_stays_to_be_reported(control: AudioControl, output: FakeSound) -> None:
    control.report(internal("Traceback"))
    show(control, SoundStatus(device=SPEAKERS))
    notices = control._window.notices
    assert "internal error" in notices.text and "Playback continues." in notices.text
    assert notices.notices[-1].details == "Traceback"


def test_a_stall_is_reported_without_a_word_on_what_plays(control: AudioControl, output: FakeSound) -> None:
    control.report(stalled("Speakers"))
    notices = control._window.notices
    assert "keeps trying" in notices.text
    assert "Playback continues on" not in notices.text
    show(control, SoundStatus(device=SPEAKERS))
    assert notices.text == ""


def test_looking_again_and_the_tone(control: AudioControl, output: FakeSound) -> None:
    control.show_dialog()
    assert control._dialog is not None
    control._dialog.rescan_asked.emit()
    assert output.opened[-1][-1] is True
    control._dialog.tone_asked.emit("left")
    assert output.tones == ["left"]


def test_gaps_count_from_the_reset(control: AudioControl, output: FakeSound) -> None:
    control.show_dialog()
    assert control._dialog is not None
    counter = control._dialog._gaps
    assert counter.text() == "4, the last at 1.5 s: device"
    control._dialog.gaps_reset.emit()
    show(control, SoundStatus(device=SPEAKERS, gaps=GAPS))
    assert counter.text() == "0"
    late = Gap(7.25, "rendering", 0.0)
    show(control, SoundStatus(device=SPEAKERS, gaps=(*GAPS, late)))
    assert counter.text() == "1, the last at 7.2 s: rendering"
    show(control, SoundStatus(device=SPEAKERS, gaps=(GAPS[-1], late)))  # only so many are remembered
    assert counter.text() == "1, the last at 7.2 s: rendering"
    show(control, SoundStatus(device=SPEAKERS, gaps=(late,)))
    assert counter.text() == "1, the last at 7.2 s: rendering"


def test_frequent_gaps_are_reported_once_for_a_buffer(control: AudioControl) -> None:
    close = tuple(Gap(time_s, "the sound device was late", 5.0) for time_s in (20.0, 21.0, 22.0))
    apart = tuple(replace(gap, time_s=20 * gap.time_s) for gap in close)
    for gaps, reported in ((close[:2], False), (apart, False), (close, True)):
        show(control, SoundStatus(device=SPEAKERS, gaps=gaps))
        assert (control._window.notices.text == FREQUENT_GAPS) == reported
    control._window.notices.withdraw(FREQUENT_GAPS)
    show(control, SoundStatus(device=SPEAKERS, gaps=close))
    assert control._window.notices.isHidden()
    control._choose(None, SoundChoice(buffer="high"))
    show(control, SoundStatus(device=SPEAKERS, gaps=close))
    assert not control._window.notices.isHidden()


def test_the_latency_that_was_measured_is_reported(control: AudioControl) -> None:
    control.show_dialog()
    assert control._dialog is not None
    facts = control._dialog._state_label
    assert "key to device" not in facts.text()
    show(control, SoundStatus(device=SPEAKERS, latency_s=0.012), latencies_s=(0.5, 0.004, 0.0031))
    assert "48 kHz, buffer 12 ms, key to device 4.0 ms (measured)" in facts.text()


def test_latencies_of_another_buffer_are_forgotten(control: AudioControl) -> None:
    forgotten: list[float] = []
    notes = SimpleNamespace(latencies_s=(), forget_latencies=lambda: forgotten.append(1))
    for buffer_s in (0.012, 0.012, 0.05):
        control.show(SoundStatus(device=SPEAKERS, latency_s=buffer_s), notes, None)  # type: ignore[arg-type]
    assert len(forgotten) == 1
