"""How long the app takes to start, each time in a process of its own, which runs `main`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.window.controller import Controller
    from app.window.main_window import MainWindow

LOOK_MS = 5
PATIENCE_S = 180.0
# the command line is imported, as it is at a user's start
COMMAND = "import sys; import app.commands.cli; from tests.bench.start import main; sys.exit(main())"


@dataclass(frozen=True)
class Starts:
    """Seconds of each start, from the moment when the process is started.

    Attributes:
        painted_s: until the window has been painted.
        ready_s: until the sources of the first pluck are loaded and the output is open, so that a key sounds at once.
    """

    painted_s: tuple[float, ...]
    ready_s: tuple[float, ...]


def measure_starts(count: int, report: Callable[[int], None]) -> Starts:
    """Times `count` starts with default settings, after one that fills the caches.

    Raises:
        RuntimeError: the app did not start.
    """
    found = []
    for number in range(count + 1):
        report(number)
        found.append(_measure())
    painted_s, ready_s = zip(*((each["painted"], each["ready"]) for each in found[1:]), strict=True)
    return Starts(painted_s, ready_s)


def _measure() -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "LEARNED_STRINGS_SETTINGS": str(Path(folder) / "settings.json")}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as at a user's second start
        begun_s = time.time()  # the only clock that two processes share on every system
        done = subprocess.run(
            [sys.executable, "-c", COMMAND],
            env=environment,
            cwd=Path(__file__).parents[2],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
    if done.returncode != 0:
        raise RuntimeError(f"the app did not start: {done.stderr.strip().splitlines()[-1:]}")
    return {name: time_s - begun_s for name, time_s in json.loads(done.stdout.splitlines()[-1]).items()}


def main() -> int:
    """Start the app as its command does, print the times (`time.time`) as JSON, and end it."""
    from app.shared.thread_priority import wait_asleep
    from app.window.main import run
    from tests.bench.display import choose_display

    wait_asleep()
    choose_display()
    times_s: dict[str, float] = {}
    status = run(lambda window: _watch(window, times_s), lambda controller: _watch_for_sound(controller, times_s))
    print(json.dumps(times_s))
    return status


def _watch(window: MainWindow, times_s: dict[str, float]) -> None:
    def painted() -> None:
        times_s["painted"] = time.time()

    window.first_painted.connect(painted)


def _watch_for_sound(controller: Controller, times_s: dict[str, float]) -> None:
    from PySide6.QtCore import QTimer

    times_s["alive"] = time.time()

    def look() -> None:
        if controller.performance.playable:
            times_s["ready"] = time.time()
            timer.stop()
            controller.window.close()

    timer = QTimer(controller, interval=LOOK_MS)
    timer.timeout.connect(look)
    timer.start()
