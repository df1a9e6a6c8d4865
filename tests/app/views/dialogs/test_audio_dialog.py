"""The audio settings, both directions: a choice is asked for; devices, faults and counters are shown."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from app.audio.choices import DeviceChoice, SoundChoice
from app.audio.devices import AudioDevice
from app.audio.sound import SoundStatus
from app.views.dialogs.audio_dialog import AudioDialog
from engine.voices import Gap
from tests.app.gestures import named, reported

LOUD, SOFT = DeviceChoice(name="Loud", host_api="ALSA"), DeviceChoice(name="Soft", host_api="JACK")
GAPS = {"1.2 s: device": Gap(1.2, "device", 1.0), "5.6 s: runaway": Gap(5.6, "runaway", 1.0)}
PLAYING = SoundStatus(AudioDevice("Loud", "ALSA", 48_000), 48_000, 0.012, tuple(GAPS.values()), 0.254)
SILENT = SoundStatus(problem="It is in use by another program.")


@pytest.fixture
def dialog(qtbot: QtBot) -> AudioDialog:
    made = AudioDialog()
    qtbot.addWidget(made)
    made.show_devices([LOUD, SOFT], LOUD)
    made.show_sound(SoundChoice(rate_hz=48_000, buffer=512))
    made.show()
    return made


def shown(dialog: AudioDialog) -> str:
    """The words that can be read now."""
    return "\n".join(each.text() for each in dialog.findChildren(QLabel) if each.isVisible())


def test_what_is_chosen_is_shown_and_asked_for(qtbot: QtBot, dialog: AudioDialog) -> None:
    chosen = SoundChoice(rate_hz=48_000, buffer=512)
    assert (dialog.device, dialog.sound) == (LOUD, chosen)
    box = named(dialog, "Output", QComboBox)
    qtbot.keyClick(box, Qt.Key.Key_Down)
    with qtbot.waitSignal(dialog.choice_made) as asked:
        box.activated.emit(box.currentIndex())
    assert asked.args == [SOFT, chosen]
    dialog.show_devices([SOFT], LOUD)
    assert dialog.device == LOUD
    assert "not connected" in box.currentText(), "a device that is away stays in the list"
    dialog.show_devices([], None)
    assert dialog.device is None


def test_the_state_is_shown_with_a_way_to_try_again_and_tones_and_counters(qtbot: QtBot, dialog: AudioDialog) -> None:
    dialog.show_status(PLAYING)
    for words in ("“Loud” (ALSA)", "buffer 12 ms", "2, the last at 5.6 s: runaway", "25 %"):
        assert words in shown(dialog)
    gaps = next(each for each in dialog.findChildren(QLabel) if each.text().startswith("2, the last"))
    assert all(gap in gaps.toolTip() for gap in GAPS)
    asked = reported(dialog.tone_asked, dialog.rescan_asked)
    for text in ("Right", "Reset", "Rescan"):
        named(dialog, text, QPushButton).click()
    assert asked == ["right", ()] and gaps.text() == "0"
    dialog.show_status(SILENT)
    for words in ("No audio output", "in use by another program"):
        assert words in shown(dialog)
    assert (gaps.text(), "device" in gaps.toolTip()) == ("0", False)
    assert not named(dialog, "Left", QPushButton).isEnabled()
