"""The app's window with its controller, for benchmarks that drive it from within."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch
from PySide6.QtCore import QCoreApplication, QEvent, QEventLoop, QTimer
from PySide6.QtWidgets import QApplication

from app.audio.devices import AudioDevice
from app.audio.problems import no_device
from app.audio.sound import Sound
from app.shared.heap import collect_anywhere, collect_between_events, return_large_blocks
from app.views.theme import apply_theme
from app.window.controller import Controller, ProblemListener
from app.window.main import load_engine
from app.window.main_window import MainWindow
from app.window.settings import Settings
from tests.bench.display import choose_display

LOOK_MS = 2  # between two checks of a condition
PATIENCE_S = 120.0


@dataclass(frozen=True)
class Stage:
    """A window that is open. Methods are called in its thread and handle events while they wait."""

    window: MainWindow
    controller: Controller
    platform: str  # Qt's: "xcb", "offscreen", …

    def run_for(self, seconds: float) -> None:
        loop = QEventLoop()
        QTimer.singleShot(round(1000 * seconds), loop.quit)
        loop.exec()

    def wait_for(self, condition: Callable[[], bool], what: str, seconds: float = 0.0) -> None:
        """Wait until `condition` holds.

        Args:
            what: is waited for, in words.
            seconds: how long it should take; `PATIENCE_S` are added.

        Raises:
            TimeoutError: it did not hold in time; the message has the latest notice.
        """
        patience_s = seconds + PATIENCE_S
        loop, timer, until_s = QEventLoop(), QTimer(interval=LOOK_MS), time.monotonic() + patience_s
        timer.timeout.connect(lambda: loop.quit() if condition() or time.monotonic() > until_s else None)
        timer.start()
        loop.exec()
        timer.stop()
        if not condition():
            raise TimeoutError(f"{what} did not come within {patience_s:g} s; {self.window.notices.text}")

    def wait_until_rendered(self) -> None:
        """Wait until the take of what is chosen is complete, and a pluck of it would sound at once."""
        stage = self.controller.performance
        self.wait_for(lambda: stage.ready and stage.settled and stage.at_hand, "the rendering of a pluck")


def silent(on_problem: ProblemListener) -> Sound:
    """A sound without a device, as on a computer that has none: a clock takes its frames."""

    def look_up(_device: AudioDevice | None, _rescan: bool) -> AudioDevice:
        raise no_device()

    return Sound(on_problem, look_up=look_up)


@contextmanager
def opened(
    settings: Settings, size: tuple[int, int], make_sound: Callable[[ProblemListener], Sound] = Sound
) -> Iterator[Stage]:
    """Open the window with its first pluck rendered, and close and delete it afterwards. `size`: in pixels."""
    choose_display()
    application = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(application, QApplication)
    threads = torch.get_num_threads()
    return_large_blocks()
    load_engine()
    apply_theme(application, settings.look.theme)
    window = MainWindow()
    window.resize(*size)
    with tempfile.TemporaryDirectory() as folder:
        try:
            window.show()
            controller = Controller(window, settings, Path(folder) / "settings.json", make_sound)
            collector = collect_between_events()
            stage = Stage(window, controller, application.platformName())
            stage.wait_until_rendered()
            yield stage
            collector.timer.stop()
        finally:
            window.close()
            window.deleteLater()
            QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
            collect_anywhere()
            torch.set_num_threads(threads)
