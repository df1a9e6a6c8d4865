"""The listening test in the window: it has the sound for itself, nothing gives it away, and all is restored."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from app.analysis.abx.trials import AbxChoices
from app.audio.devices import AudioDevice
from app.audio.output import Output
from app.audio.sound import Sound
from app.instrument import events
from app.instrument.events import PluckAt
from app.session.choices import Choices
from app.views.dialogs.abx_dialog import AbxDialog
from app.window.controller import Controller
from app.window.main_window import MainWindow
from app.window.settings import Settings, load_settings
from engine.pluck import Pluck
from engine.presets import load_preset
from engine.voices import Mixer

Open = Callable[[AudioDevice, float, Mixer], Output]


HEADPHONES = AudioDevice("Headphones", "Test API", 48_000)


@pytest.fixture
def window(qtbot: QtBot, preset_folder: Path, tmp_path: Path) -> Iterator[MainWindow]:
    made = MainWindow()
    qtbot.addWidget(made)
    made.show()
    yield made
    made.close()


@pytest.fixture
def heard(qtbot: QtBot, window: MainWindow, tmp_path: Path, numb_output: Open) -> Controller:
    """A controller whose pluck is rendered, with a device that makes no sound."""

    def make_sound(on_problem: object) -> Sound:
        return Sound(look_up=lambda *_: HEADPHONES, open_output=numb_output)

    abx = AbxChoices(trials=2, folder=str(tmp_path / "records"))
    settings = Settings(choices=Choices(seconds=0.5, volume_db=-6), abx=abx)
    made = Controller(window, settings, tmp_path / "settings.json", make_sound)
    qtbot.waitUntil(lambda: "Error of this pluck" in window.error_label.text())
    return made


def open_test(qtbot: QtBot, controller: Controller) -> AbxDialog:
    qtbot.keyClick(controller.window, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    dialog = controller.window.findChild(AbxDialog)
    assert dialog is not None
    qtbot.waitUntil(dialog._setup.start.isEnabled)
    return dialog


def sounds(controller: Controller) -> bool:
    """Whether the mixer has a voice that is not silent."""
    return any(voice.sounding for voice in controller.sound.mixer.voices)


def test_nothing_behind_reports_what_is_heard(qtbot: QtBot, heard: Controller) -> None:
    window = heard.window
    heard.pluck()
    qtbot.waitUntil(lambda: window.transport.meter._peak_db > -60)
    dialog = open_test(qtbot, heard)
    assert dialog.isModal()
    dialog._setup.start.click()
    before = heard.session.choices
    for key in (Qt.Key.Key_X, Qt.Key.Key_A, Qt.Key.Key_B, Qt.Key.Key_X):
        qtbot.keyClick(dialog._trial, key)
        qtbot.waitUntil(lambda: sounds(heard))
        heard._tick()
        assert window.transport.meter._peak_db == -60
        assert not window.transport.meter.limit_light
    assert heard.session.choices == before
    dialog.abandon()


def test_the_sound_comes_back_as_it_was(qtbot: QtBot, heard: Controller, tmp_path: Path) -> None:
    heard.pluck()
    qtbot.waitUntil(lambda: sounds(heard))
    dialog = open_test(qtbot, heard)
    assert not heard.performance.playing
    qtbot.waitUntil(lambda: not sounds(heard))
    dialog._setup.audition_asked.emit("B")
    qtbot.waitUntil(lambda: sounds(heard))
    dialog._setup.trials.setValue(25)
    qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not sounds(heard))
    heard.pluck()
    qtbot.waitUntil(lambda: heard.performance.position_s > 0.3)
    heard.window.close()
    assert load_settings(tmp_path / "settings.json")[0].abx.trials == 25


def test_instruments_are_silent_meanwhile_and_the_test_keeps_its_pluck(qtbot: QtBot, heard: Controller) -> None:
    dialog = open_test(qtbot, heard)
    before = heard.session.choices
    for event in (PluckAt(Pluck(0.6, 8.0)), events.NoteOn(60, 90)):
        heard.instruments.play(event)  # a MIDI keyboard
    qtbot.wait(50)
    assert heard.session.choices == before
    assert not heard.performance.playing
    assert not sounds(heard)
    first, model = dialog._stimuli, dialog._rendering.result()["model"]
    assert first is not None
    dialog._ask_for_sound()  # as after a change of the device's rate
    assert (dialog._rendering.result(20)["model"] == model).all()
    dialog.abandon()


@pytest.mark.parametrize("struck", [True, False])
def test_a_key_is_compared_as_the_instrument_plays_it(qtbot: QtBot, played: Controller, struck: bool) -> None:
    """With its noise and the neighbours of its string; before a key is struck, the pluck that is shown."""
    qtbot.waitUntil(lambda: played.session.choices.string is not None)
    if struck:
        played.instruments.play(events.NoteOn(52, 70))
        qtbot.waitUntil(lambda: played.instruments.latest.known)  # type: ignore[union-attr]
    played.session.update(solo=2)
    played.listening_test()
    dialog, found, entry = played._abx, played.instruments.struck, played.entry
    assert dialog is not None and dialog._rendering is not None and found is not None and entry is not None
    pluck, sounds = dialog._material.pluck, dialog._rendering.result(30)
    assert (pluck["instrument"], pluck["velocity"] == 70) == ("Steel-string acoustic", struck)
    assert (pluck["pluck"] is None) == struck
    shown = [each.text() for each in dialog._setup.findChildren(QLabel)]
    assert f"{found.words}. All modes, although mode 2 is soloed" in shown
    for source in ("model", "truth"):
        preset, rate_hz = load_preset(entry.path), played.sound.rate_hz
        alone = found.sound(preset, source, rate_hz, 0.5, None, True, lambda share: None)
        assert (np.concatenate(list(alone)) == sounds[source]).all()
    dialog.abandon()


def test_a_pedal_that_is_lifted_meanwhile_is_up_afterwards(
    qtbot: QtBot, heard: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[object] = []
    monkeypatch.setattr(heard.performance.notes, "handle", lambda event, due: taken.append(event))
    dialog = open_test(qtbot, heard)
    release_all = [events.NoteOff(52), events.Controller(events.SUSTAIN, 0)]
    for event in (events.NoteOn(52, 90), *release_all):
        heard._handle(event, None)
    assert taken == release_all
    dialog.abandon()


def test_the_volume_of_a_test_stays_what_it_was_begun_with(qtbot: QtBot, heard: Controller) -> None:
    """A fader that was taught to it moves the sound afterwards."""

    heard.session.update(volume_db=-6.0)
    dialog = open_test(qtbot, heard)
    heard.instruments.midi.performed.emit({"volume_db": 12.0})
    qtbot.waitUntil(lambda: heard.session.choices.volume_db == 12.0)
    assert heard.sound.mixer.record["wanted_volume"] == pytest.approx(10 ** (-6 / 20))
    dialog.abandon()
    qtbot.waitUntil(lambda: heard.sound.mixer.record["wanted_volume"] == pytest.approx(10 ** (12 / 20)))


def test_closing_the_window_keeps_an_incomplete_record(qtbot: QtBot, heard: Controller, tmp_path: Path) -> None:
    dialog = open_test(qtbot, heard)
    dialog._setup.start.click()
    for key in (Qt.Key.Key_X, Qt.Key.Key_1):
        qtbot.keyClick(dialog._trial, key)
    heard.window.close()
    (path,) = (tmp_path / "records").iterdir()
    assert '"p_value": null' in path.read_text()


def test_it_waits_for_no_picture(qtbot: QtBot, heard: Controller) -> None:
    heard.session.update(preset="second")
    dialog = open_test(qtbot, heard)
    assert dialog._material.a.preset == "second"
    dialog.abandon()
