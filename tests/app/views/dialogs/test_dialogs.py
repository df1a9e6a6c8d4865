"""Audio settings are shown and asked for; help and about name everything that there is."""

import re

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton

from app.audio.choices import DeviceChoice, SoundChoice
from app.audio.devices import AudioDevice
from app.audio.sound import SoundStatus
from app.presets.words import model_word
from app.shared.log import log_file
from app.views.controls.app_menu import ENTRIES
from app.views.dialogs.audio_dialog import AudioDialog
from app.views.dialogs.help_dialog import HelpDialog, help_parts
from engine.models import MODELS as KNOWN_MODELS
from engine.voices import Gap
from tests.app.gestures import named, reported

LOUD, SOFT = DeviceChoice(name="Loud", host_api="ALSA"), DeviceChoice(name="Soft", host_api="JACK")
GAPS = {"1.2 s: device": Gap(1.2, "device", 1.0), "5.6 s: runaway": Gap(5.6, "runaway", 1.0)}
PLAYING = SoundStatus(AudioDevice("Loud", "ALSA", 48_000), 48_000, 0.012, tuple(GAPS.values()), 0.254)
SILENT = SoundStatus(problem="It is in use by another program.")


def test_choices_are_shown_and_asked_for_and_the_state_is_shown(qtbot, show):
    dialog, chosen = show(AudioDialog()), SoundChoice(rate_hz=48_000, buffer=512)
    dialog.show_devices([LOUD, SOFT], LOUD)
    dialog.show_sound(chosen)
    assert (dialog.device, dialog.sound) == (LOUD, chosen)
    box = named(dialog, "Output", QComboBox)
    qtbot.keyClick(box, Qt.Key.Key_Down)
    with qtbot.waitSignal(dialog.choice_made) as asked:
        box.activated.emit(box.currentIndex())
    assert asked.args == [SOFT, chosen]
    dialog.show_devices([SOFT], LOUD)
    assert dialog.device == LOUD and "not connected" in box.currentText(), "a device that is away stays in the list"
    dialog.show_devices([], None)
    assert dialog.device is None

    def shown() -> str:
        return "\n".join(each.text() for each in dialog.findChildren(QLabel) if each.isVisible())

    dialog.show_status(PLAYING)
    for words in ("“Loud” (ALSA)", "buffer 12 ms", "2, the last at 5.6 s: runaway", "25 %"):
        assert words in shown()
    gaps = next(each for each in dialog.findChildren(QLabel) if each.text().startswith("2, the last"))
    assert all(gap in gaps.toolTip() for gap in GAPS)
    presses = reported(dialog.tone_asked, dialog.rescan_asked)
    for text in ("Right", "Reset", "Rescan"):
        named(dialog, text, QPushButton).click()
    assert presses == ["right", ()] and gaps.text() == "0"
    dialog.show_status(SILENT)
    for words in ("No audio output", "in use by another program"):
        assert words in shown()
    assert (gaps.text(), "device" in gaps.toolTip()) == ("0", False)
    assert not named(dialog, "Left", QPushButton).isEnabled()


def test_help_has_every_key_view_and_model(qtbot, controller):
    controller.window.action["help"].trigger()
    dialog = controller.window.findChild(HelpDialog)
    assert dialog.isVisible()
    assert not dialog.isModal()
    texts = {dialog.tabs.tabText(row): dialog.tabs.widget(row).toPlainText() for row in range(dialog.tabs.count())}
    for entry in ENTRIES.values():
        assert entry.key_name in texts["Keys"]
        assert not entry.key or entry.does in texts["Keys"]
    for panel in controller.panels:
        assert panel.title in texts["Views"]
        assert panel.help, panel.key
        assert panel.help in texts["Views"]
    models = re.findall(r"^### (.+)$", help_parts()["Models"], re.MULTILINE)
    assert set(models) == {model_word(model) for model in KNOWN_MODELS}  # as presets are named
    for title in models:
        assert title in texts["Models"]
    assert str(log_file()) in texts["Errors"]
    controller.window.action["about"].trigger()
    assert dialog.tabs.tabText(dialog.tabs.currentIndex()) == "About" and "DAFx24" in texts["About"]
    dialog.close()
