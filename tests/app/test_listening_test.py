"""The listening test in the window: it has the player for itself, nothing behind it tells, and all is restored."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.audio import AudioDevice, Player
from app.audio.silent import SilentOutput
from app.controller import Controller
from app.main_window import MainWindow
from app.session import Choices
from app.settings import AbxChoices, Settings, load_settings
from app.views.abx_dialog import AbxDialog


def numb_player(on_problem: object) -> Player:
    """With a device that makes no sound."""
    device = AudioDevice("Headphones", "Test API", 48_000)

    def open_output(*_: object) -> SilentOutput:
        output = SilentOutput(48_000)
        output.device = device
        return output

    return Player(look_up=lambda *_: device, open_output=open_output)


@pytest.fixture
def window(qtbot: QtBot, preset_folder: Path, tmp_path: Path) -> Iterator[MainWindow]:
    made = MainWindow()
    qtbot.addWidget(made)
    made.show()
    yield made
    made.close()


@pytest.fixture
def heard(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> Controller:
    """A controller whose pluck is rendered."""
    abx = AbxChoices(trials=2, folder=str(tmp_path / "records"))
    settings = Settings(choices=Choices(seconds=0.5, volume_db=-6), abx=abx)
    made = Controller(window, settings, tmp_path / "settings.json", numb_player)
    qtbot.waitUntil(lambda: "error of this pluck" in window.error_label.text(), timeout=20_000)
    return made


def open_test(qtbot: QtBot, controller: Controller) -> AbxDialog:
    qtbot.keyClick(controller.window, Qt.Key.Key_T, Qt.KeyboardModifier.ControlModifier)
    dialog = controller.window.findChild(AbxDialog)
    assert dialog is not None
    qtbot.waitUntil(dialog._setup.start.isEnabled, timeout=5_000)
    return dialog


def test_nothing_behind_tells_what_is_heard(qtbot: QtBot, heard: Controller) -> None:
    window = heard.window
    heard.pluck()
    qtbot.waitUntil(lambda: window.transport.meter._peak_db > -60, timeout=5_000)
    dialog = open_test(qtbot, heard)
    assert dialog.isModal()
    dialog._setup.start.click()
    before = heard.session.choices
    for key in (Qt.Key.Key_X, Qt.Key.Key_A, Qt.Key.Key_B, Qt.Key.Key_X):
        qtbot.keyClick(dialog._trial, key)
        qtbot.waitUntil(lambda: heard.player.status().playing, timeout=5_000)
        heard._tick()
        assert window.transport.meter._peak_db == -60
        assert not window.transport.meter.limit_light
    assert heard.session.choices == before
    dialog.abandon()


def test_the_player_comes_back_as_it_was(qtbot: QtBot, heard: Controller, tmp_path: Path) -> None:
    dialog = open_test(qtbot, heard)
    dialog._setup.audition_asked.emit("B")
    qtbot.waitUntil(lambda: heard.player.status().source == "B", timeout=5_000)
    dialog._setup._trials.setValue(25)
    qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: heard.player.status().source == "model", timeout=5_000)
    assert not heard.player.status().playing
    heard.pluck()
    qtbot.waitUntil(lambda: heard.player.status().position_s > 0.3, timeout=5_000)
    qtbot.waitUntil(lambda: not heard.player.status().playing, timeout=5_000)  # the loop is off again
    heard.window.close()
    assert load_settings(tmp_path / "settings.json")[0].abx.trials == 25


def test_a_new_sound_meanwhile_goes_to_the_test(qtbot: QtBot, heard: Controller) -> None:
    dialog = open_test(qtbot, heard)
    first = dialog._stimuli
    heard.session.update(listen=0.6)
    qtbot.waitUntil(lambda: dialog._stimuli not in (None, first), timeout=10_000)
    assert heard.player.status().source != "model"
    dialog.abandon()


def test_closing_the_window_keeps_an_incomplete_record(qtbot: QtBot, heard: Controller, tmp_path: Path) -> None:
    dialog = open_test(qtbot, heard)
    dialog._setup.start.click()
    for key in (Qt.Key.Key_X, Qt.Key.Key_1):
        qtbot.keyClick(dialog._trial, key)
    heard.window.close()
    (path,) = (tmp_path / "records").iterdir()
    assert '"complete": false' in path.read_text()


def test_without_a_sound_it_is_not_opened(qtbot: QtBot, heard: Controller) -> None:
    heard.session.update(preset="second")
    heard.window.abx_asked.emit()
    assert heard.window.findChild(AbxDialog) is None
    assert "wait until the pluck is rendered" in heard.window.notices.text
