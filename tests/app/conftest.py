"""A window with its controller, a sound without a device and one small preset."""

import gc
import os
import shutil
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from app.audio.devices import AudioDevice
from app.audio.output import ClockOutput
from app.audio.problems import AudioProblem, ProblemKind
from app.audio.sound import Sound
from app.rendering import Take
from app.rendering.take import Listened, Signal
from app.shared.vocabulary import Face
from engine.values.ear import Ear
from engine.voices import Mixer
from engine.voices.ear import weights_of
from tests.app.questions import none_unanswered

os.environ["DBUS_SESSION_BUS_ADDRESS"] = "disabled:"  # no test opens the desktop's file manager

Hear = Callable[[Take, Ear], None]


@pytest.fixture
def hear(derivative: Callable[[np.ndarray, int], np.ndarray]) -> Hear:
    """Listens to a take of which every frame is a picture, as far as it is rendered."""

    def heard(take: Take, ear: Ear) -> None:
        listened = Listened(ear)
        for name in take.motions:
            motion = take.motions[name]
            frames_m, rate_hz = motion.read(), round(motion.rate_hz)
            signal = listened.signals[name] = Signal(rate_hz, len(ear.points), take.seconds)
            samples = frames_m @ weights_of(ear, frames_m.shape[1]).astype(np.float32)
            if ear.pickup == "velocity":
                samples = derivative(samples, rate_hz).astype(np.float32)
            signal.append(samples)
        take.listened = listened

    return heard


@pytest.fixture(autouse=True)
def threads_begun() -> Iterator[Callable[[], list[str]]]:
    """Names the threads that the test has begun and that are alive. None is once it is over: a test ends its own."""
    before = set(threading.enumerate())

    def begun() -> list[threading.Thread]:
        return [each for each in threading.enumerate() if each not in before]

    yield lambda: [each.name for each in begun()]
    for each in begun():
        each.join(AWAITED_MS / 1000)
    assert not begun()


@pytest.fixture(scope="session", autouse=True)
def frozen_to_the_end() -> Iterator[None]:
    """The end of an app unfreezes nothing."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("app.window.main.collect_anywhere", gc.enable)
        yield
    gc.unfreeze()


@pytest.fixture(scope="module", autouse=True)
def kept_is_frozen() -> None:
    """A look at all of torch takes a quarter of a second: what is left by the tests before is no garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def every_question_is_answered() -> Iterator[None]:
    with none_unanswered():
        yield


@pytest.fixture(autouse=True)
def collected_here() -> Iterator[None]:
    """Garbage is deleted in this thread alone, as in the app (`app.shared.heap.collect_between_events`)."""
    gc.disable()
    yield
    gc.collect()
    gc.enable()


@pytest.fixture(autouse=True)
def no_button_is_held() -> Iterator[None]:
    """A double click of the tests ends with a press; a plot follows no pointer while a button is down."""
    yield
    for button in (Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton):
        if QApplication.instance() and QApplication.mouseButtons() & button:
            QTest.mouseRelease(QWidget(), button)
    assert not QApplication.instance() or not QApplication.mouseButtons()


def no_device(*_: object) -> AudioDevice:
    raise AudioProblem(ProblemKind.NO_DEVICE, "No sound output here.", "Connect one.")


def make_sound(on_problem: Callable[[AudioProblem], None] | None = None) -> Sound:
    """Its frames are taken at the pace of time, and dropped."""
    return Sound(on_problem, look_up=no_device)


class NumbOutput(ClockOutput):
    """A device that takes frames at the pace of time, like a real one, and makes no sound."""

    def __init__(self, device: AudioDevice, buffer_s: float, mixer: Mixer) -> None:
        super().__init__(mixer)
        self.device, self.latency_s = device, buffer_s
        self.gone = False

    def lost(self) -> bool:
        return self.gone


@pytest.fixture
def numb_output() -> type[NumbOutput]:
    return NumbOutput


@pytest.fixture
def preset_folder(small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The shipped presets, replaced by two small ones: `first` and `second`."""
    folder = tmp_path / "presets"
    folder.mkdir()
    for name in ("first", "second"):
        shutil.copy(small_preset, folder / f"{name}.safetensors")
    monkeypatch.setattr("app.presets.library.SHIPPED", folder)
    return folder


def _closed_without_a_question(window: QWidget) -> None:
    """Nobody answers one about what a test leaves."""
    window.may_close = lambda: True  # type: ignore[attr-defined]


@pytest.fixture
def face() -> Face:
    """With which the window of `controller` opens; modules on the Lab have their own, as its plots take time."""
    return "play"


@pytest.fixture
def controller(
    qtbot: QtBot,
    preset_folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    face: Face,
    threads_begun: Callable[[], list[str]],
) -> Iterator[object]:
    from app.session.choices import Choices
    from app.window.controller import Controller
    from app.window.main_window import MainWindow
    from app.window.settings import InstrumentChoice, Settings

    monkeypatch.setenv("LEARNED_STRINGS_RECORDINGS", str(tmp_path / "unsaved recordings"))
    window = MainWindow()
    qtbot.addWidget(window, before_close_func=_closed_without_a_question)
    settings = Settings(choices=Choices(seconds=0.5, face=face), instrument=InstrumentChoice(shown=True))
    made = Controller(window, settings, tmp_path / "settings.json", make_sound)
    with qtbot.waitExposed(window):
        window.show()
    yield made
    _closed_without_a_question(window)
    window.close()
    assert threads_begun() == []


AWAITED_MS = 60_000  # what comes at all comes within a second on a quiet machine; on a crowded one it may take longer


@pytest.fixture
def qtbot(qtbot: QtBot) -> QtBot:
    """pytest-qt's, but more patient: a test waits for what happens, not for how soon."""
    for name in ("waitUntil", "waitSignal", "waitSignals", "waitExposed"):
        setattr(qtbot, name, partial(getattr(qtbot, name), timeout=AWAITED_MS))
    return qtbot
