"""The time that the app takes to start, each time in a process of its own, which runs `main`."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.printing import target
from training.cli.console import ProgressReport

if TYPE_CHECKING:
    from app.window.controller import Controller
    from app.window.main_window import MainWindow

LOOK_MS = 5
PATIENCE_S = 180.0
# the command line is imported, as it is at a user's start
COMMAND = "import sys; import app.commands.cli; from bench.start import main; sys.exit(main())"


@dataclass(frozen=True)
class Starts:
    """Medians and the slowest of some starts with default settings, from when the process is started.

    Attributes:
        window_s: until the window has been painted.
        sound_s: until the sources of the first pluck are loaded and the output is open, so that a key sounds at once.
    """

    window_s: float = field(metadata=target(2.0))
    slowest_window_s: float
    sound_s: float = field(metadata=target(3.0))
    slowest_sound_s: float


def measure(count: int, report: ProgressReport) -> dict[str, Any]:
    """Time `count` starts, after one that fills the caches.

    Raises:
        RuntimeError: the app did not start.
    """
    found = []
    for number in range(count + 1):
        report(number / (count + 1))
        found.append(_start())
    painted_s, ready_s = ([each[name] for each in found[1:]] for name in ("painted", "ready"))
    starts = Starts(statistics.median(painted_s), max(painted_s), statistics.median(ready_s), max(ready_s))
    return {"platform": found[0]["platform"], "starts": starts}


def _start() -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "LEARNED_STRINGS_SETTINGS": str(Path(folder) / "settings.json")}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as at a user's second start
        begun_s = time.time()  # the only clock that two processes share on every system
        command, root = [sys.executable, "-c", COMMAND], Path(__file__).parents[1]
        done = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, timeout=PATIENCE_S)
    if done.returncode != 0:
        raise RuntimeError(f"the app did not start: {done.stderr.strip().splitlines()[-1:]}")
    said = json.loads(done.stdout.splitlines()[-1])
    return {**said, **{name: said[name] - begun_s for name in ("painted", "ready")}}


def main() -> int:
    """Start the app as its command does, print the times (`time.time`) as JSON, and end it."""
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication

    from app.shared.thread_priority import wait_asleep
    from app.window.main import run

    wait_asleep()
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    if sys.platform.startswith("linux") and not any(map(os.environ.get, screens)):
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
    said: dict[str, object] = {}

    def watch(window: MainWindow) -> None:
        window.first_painted.connect(lambda: said.update(painted=time.time()))

    def watch_for_sound(controller: Controller) -> None:
        def look() -> None:
            if controller.performance.playable:
                said.update(ready=time.time(), platform=QApplication.platformName())
                timer.stop()
                controller.window.close()

        timer = QTimer(controller, interval=LOOK_MS)
        timer.timeout.connect(look)
        timer.start()

    status = run(watch, watch_for_sound)
    print(json.dumps(said))
    return status
