"""What becomes of a choice of output: opened, refused, saved, told."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from app import audio_control
from app.audio import AudioDevice, AudioProblem, PlayerStatus, ProblemKind
from app.audio.problems import stalled
from app.audio_control import AudioControl
from app.main_window import MainWindow
from app.settings import DeviceChoice, SoundChoice

SPEAKERS = AudioDevice("Speakers", "ALSA", 48_000)
WISH = (DeviceChoice(name="Loud", host_api="JACK"), SoundChoice(rate_hz=96_000, buffer=256))


class FakePlayer:
    """Notes what it is asked for; the test says what became of it."""

    def __init__(self) -> None:
        self.opened: list[tuple[Any, ...]] = []
        self.tones: list[str] = []
        self.present = PlayerStatus(device=SPEAKERS, underruns=4)

    def open(self, *arguments: Any) -> None:
        self.opened.append(arguments)

    def sound_tone(self, side: str) -> None:
        self.tones.append(side)

    def status(self) -> PlayerStatus:
        return self.present


@pytest.fixture
def player() -> FakePlayer:
    return FakePlayer()


@pytest.fixture
def control(qtbot: QtBot, player: FakePlayer, monkeypatch: pytest.MonkeyPatch) -> Iterator[AudioControl]:
    monkeypatch.setattr(audio_control, "output_devices", lambda rescan=False: [SPEAKERS])
    window = MainWindow()
    qtbot.addWidget(window)
    made = AudioControl(window, player, None, SoundChoice())  # type: ignore[arg-type]
    made.open()
    yield made
    if made._dialog is not None:
        made._dialog.close()


def test_the_first_opening(control: AudioControl, player: FakePlayer) -> None:
    assert player.opened == [(None, 0.05, 0, 0, False)]


def test_a_choice_is_saved_once_it_plays(control: AudioControl, player: FakePlayer) -> None:
    control.show_dialog()
    assert control._dialog is not None
    control._dialog.choice_made.emit(*WISH)
    assert player.opened[-1] == (AudioDevice("Loud", "JACK"), 0.05, 96_000, 256, False)
    control.show(PlayerStatus(device=SPEAKERS, changes_done=1), None)
    assert (control.device, control.sound) == (None, SoundChoice())
    control.show(PlayerStatus(device=AudioDevice("Loud", "JACK", 96_000), changes_done=2), None)
    assert (control.device, control.sound) == WISH


def test_a_refused_choice_is_told_and_not_saved(control: AudioControl, player: FakePlayer) -> None:
    control.show_dialog()
    assert control._dialog is not None
    control._dialog.choice_made.emit(*WISH)
    player.present = PlayerStatus(device=SPEAKERS, changes_done=2, problem="It refuses 96000 Hz.")
    control.tell(AudioProblem(ProblemKind.RATE_REFUSED, "It refuses 96000 Hz.", "Choose another.", "code"))
    control.show(player.present, None)
    notices = control._window.notices
    assert "“Speakers” plays on" in notices.text
    assert notices.kept[-1][1] == "code"
    assert (control.device, control.sound) == (None, SoundChoice())
    assert "refuses" in control._dialog._problem_label.text()
    control._dialog.rescan_asked.emit()
    assert player.opened[-1][:4] == player.opened[-2][:4]
    control.show(PlayerStatus(device=SPEAKERS, changes_done=3), None)
    assert notices.text == ""


def test_a_stall_is_told_without_a_word_on_what_plays(control: AudioControl, player: FakePlayer) -> None:
    control.tell(stalled("Speakers"))
    notices = control._window.notices
    assert "keeps trying" in notices.text
    assert "plays on" not in notices.text
    control.show(PlayerStatus(device=SPEAKERS), None)
    assert notices.text == ""


def test_looking_again_and_the_tone(control: AudioControl, player: FakePlayer) -> None:
    control.show_dialog()
    assert control._dialog is not None
    control._dialog.rescan_asked.emit()
    assert player.opened[-1][-1] is True
    control._dialog.tone_asked.emit("left")
    assert player.tones == ["left"]


def test_underruns_count_from_the_reset(control: AudioControl, player: FakePlayer) -> None:
    control.show_dialog()
    assert control._dialog is not None
    counter = control._dialog._underruns
    assert counter.text() == "4"
    control._dialog.underruns_reset.emit()
    control.show(PlayerStatus(device=SPEAKERS, underruns=5), None)
    assert counter.text() == "1"
    control.show(PlayerStatus(device=SPEAKERS, underruns=2), None)  # another stream
    assert counter.text() == "2"
