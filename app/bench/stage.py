"""The real window with its controller, and a pretended sound device: what benchmarks of the app drive."""

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

from app.bench.display import choose_display
from app.bench.pretended_device import PretendedCard
from app.controller import Controller
from app.main import SWITCH_INTERVAL_S, load_engine
from app.main_window import MainWindow
from app.memory import collect_anywhere, collect_between_events, return_large_blocks
from app.settings import Settings
from app.views.plots import dress_plots
from app.views.theme import apply_theme

LOOK_MS = 2  # between two looks at what is waited for
PATIENCE_S = 120.0


@dataclass(frozen=True)
class Stage:
    """Everything here is called in the window's thread; events are handled meanwhile."""

    window: MainWindow
    controller: Controller
    card: PretendedCard
    platform: str  # Qt's: "xcb", "offscreen", …

    def run_for(self, seconds: float) -> None:
        loop = QEventLoop()
        QTimer.singleShot(round(1000 * seconds), loop.quit)
        loop.exec()

    def wait_for(self, condition: Callable[[], bool], what: str) -> None:
        """Raises TimeoutError, with the latest notice, where `condition` does not come true."""
        loop, timer, until_s = QEventLoop(), QTimer(interval=LOOK_MS), time.monotonic() + PATIENCE_S
        timer.timeout.connect(lambda: loop.quit() if condition() or time.monotonic() > until_s else None)
        timer.start()
        loop.exec()
        timer.stop()
        if not condition():
            raise TimeoutError(f"{what} did not come within {PATIENCE_S:g} s; {self.window.notices.text}")

    def wait_until_rendered(self) -> None:
        self.wait_for(lambda: self.window.error_label.text().startswith("error"), "the rendering of a pluck")


@contextmanager
def opened(settings: Settings, card: PretendedCard, size: tuple[int, int]) -> Iterator[Stage]:
    """The window, alive and with its first pluck rendered, `size` in pixels; afterwards it is closed and gone."""
    choose_display()
    application = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(application, QApplication)
    interval_s, threads = sys.getswitchinterval(), torch.get_num_threads()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    return_large_blocks()
    load_engine()
    apply_theme(application, settings.look.face)
    dress_plots()
    window = MainWindow()
    window.resize(*size)
    with tempfile.TemporaryDirectory() as folder:
        try:
            window.show()
            controller = Controller(window, settings, Path(folder) / "settings.json", card.player)
            collector = collect_between_events()
            stage = Stage(window, controller, card, application.platformName())
            stage.wait_for(lambda: card.stream is not None, "the pretended device")
            stage.wait_until_rendered()
            yield stage
            collector.timer.stop()
        finally:
            window.close()
            window.deleteLater()
            QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
            collect_anywhere()
            sys.setswitchinterval(interval_s)
            torch.set_num_threads(threads)
