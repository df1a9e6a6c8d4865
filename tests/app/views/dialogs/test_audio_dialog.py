"""The audio settings, both directions: a choice is asked for; devices, faults and counters are shown."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from app.audio.choices import DeviceChoice, SoundChoice
from app.views.dialogs.audio_dialog import AudioDialog, AudioState

LOUD, SOFT = DeviceChoice(name="Loud", host_api="ALSA"), DeviceChoice(name="Soft", host_api="JACK")
GAPS = ("1.2 s: device", "3.4 s: rendering", "5.6 s: runaway")
PLAYING = AudioState("“Loud” (ALSA)", "48 kHz, buffer 12 ms", "", GAPS, 0.254)
SILENT = AudioState("", "", "It is in use by another program.", (), 0.0)


@pytest.fixture
def dialog(qtbot: QtBot) -> AudioDialog:
    made = AudioDialog()
    qtbot.addWidget(made)
    made.show_devices([LOUD, SOFT], LOUD)
    made.show_sound(SoundChoice(rate_hz=48_000, buffer=512))
    made.show()
    return made


def button(dialog: AudioDialog, text: str) -> QPushButton:
    return next(found for found in dialog.findChildren(QPushButton) if found.text() == text)


def test_what_is_chosen_is_shown_and_asked_for(qtbot: QtBot, dialog: AudioDialog) -> None:
    assert (dialog.device, dialog.sound) == (LOUD, SoundChoice(rate_hz=48_000, buffer=512))
    with qtbot.waitSignal(dialog.choice_made) as asked:
        qtbot.keyClick(dialog._device, Qt.Key.Key_Down)
        dialog._device.activated.emit(dialog._device.currentIndex())
    assert asked.args == [SOFT, SoundChoice(rate_hz=48_000, buffer=512)]
    dialog._buffer.setCurrentIndex(dialog._buffer.findData("high"))
    assert dialog.sound.buffer == "high"


def test_a_device_that_is_away_stays_in_the_list(dialog: AudioDialog) -> None:
    dialog.show_devices([SOFT], LOUD)
    assert dialog.device == LOUD
    assert "not connected" in dialog._device.currentText()
    dialog.show_devices([], None)
    assert dialog.device is None


def test_a_fault_is_reported_with_a_way_to_try_again(qtbot: QtBot, dialog: AudioDialog) -> None:
    dialog.show_state(PLAYING)
    assert dialog._problem.isHidden()
    assert "Loud" in dialog._state_label.text()
    dialog.show_state(SILENT)
    assert not dialog._problem.isHidden()
    assert "No audio output" in dialog._state_label.text()
    assert not button(dialog, "Left").isEnabled()
    with qtbot.waitSignal(dialog.rescan_asked):
        button(dialog, "Rescan").click()


def test_gaps_are_reported_with_time_and_cause_and_the_load_as_a_share(dialog: AudioDialog) -> None:
    dialog.show_state(PLAYING)
    assert dialog._gaps.text() == "3, the last at 5.6 s: runaway"
    assert all(gap in dialog._gaps.toolTip() for gap in GAPS)
    assert dialog._load.text() == "25 %"
    assert "buffer 12 ms" in dialog._state_label.text()
    dialog.show_state(SILENT)
    assert dialog._gaps.text() == "0"
    assert GAPS[0] not in dialog._gaps.toolTip()


def test_the_tone_and_the_counter(qtbot: QtBot, dialog: AudioDialog) -> None:
    dialog.show_state(PLAYING)
    with qtbot.waitSignal(dialog.tone_asked) as asked:
        button(dialog, "Right").click()
    assert asked.args == ["right"]
    with qtbot.waitSignal(dialog.gaps_reset):
        button(dialog, "Reset").click()
