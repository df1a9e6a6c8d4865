"""Windows with a controller: of the Lab, of an instrument, and others as a test asks for them."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.audio.devices import AudioDevice
from app.audio.sound import Sound
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.playing.midi_port import MidiInput
from app.session.choices import Choices
from app.views import theme
from app.window import midi_control
from app.window.controller import Controller
from app.window.main_window import MainWindow
from app.window.settings import InstrumentChoice, Settings
from engine.presets.finding import SHIPPED
from tests.app.conftest import make_sound
from tests.app.window.driver import Window
from tests.app.window.midi import FakeBackend

Open = Callable[..., Window]
SPEAKERS = AudioDevice("Speakers", "Test API", 48_000)


@pytest.fixture
def opened(
    qtbot: QtBot,
    preset_folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    threads_begun: Callable[[], list[str]],
) -> Iterator[Open]:
    """Opens windows with the presets `first` and `second` and these shipped ones; none leaves a thread.

    `settings`: fields of `Settings`; the other words are `choices`.
    """
    monkeypatch.setenv("LEARNED_STRINGS_RECORDINGS", str(tmp_path / "unsaved recordings"))
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    windows: list[Window] = []

    def made(
        *presets: str, sound: Any = make_sound, settings: dict[str, Any] | None = None, **choices: Any
    ) -> Window:
        for name in presets:
            shutil.copy(SHIPPED / f"{name}.safetensors", preset_folder)
        window = MainWindow()
        qtbot.addWidget(window, before_close_func=lambda closed: setattr(closed, "may_close", lambda: True))
        fields = {"instrument": InstrumentChoice(shown=True), **(settings or {})}
        chosen = Settings(choices=Choices(**{"seconds": 0.5, **choices}), **fields)
        windows.append(Window(qtbot, Controller(window, chosen, tmp_path / "settings.json", sound)))
        with qtbot.waitExposed(window):
            window.show()
        return windows[-1]

    yield made
    for each in windows:
        each.close()
    assert threads_begun() == []


@pytest.fixture
def lab(opened: Open) -> Window:
    """A window that shows the Lab."""
    return opened(face="lab")


@pytest.fixture
def guitar(opened: Open) -> Window:
    """A window in which keys play a guitar."""
    made = opened("studio_any_string", instrument=read_instrument(INSTRUMENTS / "steel_string_acoustic.json"))
    made.wait_for_keys()
    made.window.setFocus()
    return made


@pytest.fixture
def devices() -> list[AudioDevice]:
    """The sound devices; the last is there."""
    return [SPEAKERS]


@pytest.fixture
def speakers(devices: list[AudioDevice], numb_output: Any) -> Callable[[Any], Sound]:
    """A sound with a device that takes frames at the pace of time and makes none."""
    return lambda on_problem: Sound(on_problem, look_up=lambda *_: devices[-1], open_output=numb_output)


@pytest.fixture
def backend(monkeypatch: pytest.MonkeyPatch) -> FakeBackend:
    """The MIDI system of windows that are opened afterwards."""
    made = FakeBackend()
    made_with = lambda receive, load, release: MidiInput(receive, lambda: made, release)  # noqa: E731
    monkeypatch.setattr(midi_control, "MidiInput", made_with)
    return made


@pytest.fixture
def themed(qapp: QApplication) -> Iterator[Callable[..., None]]:
    """Puts on a theme, by default the dark one, as users see it; afterwards the look is as before."""
    sheet, font, palette = qapp.styleSheet(), qapp.font(), qapp.palette()

    def put_on(name: Any = "dark", percent: int = 100) -> None:
        theme.apply_theme(qapp, name, percent)

    put_on()
    yield put_on
    put_on()
    qapp.setStyleSheet(sheet)
    qapp.setFont(font)
    qapp.setPalette(palette)
