"""How long the app takes to start, each time in a process of its own, where `main` runs."""

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
    from app.main_window import MainWindow

LOOK_MS = 5
PATIENCE_S = 180.0
COMMAND = (
    "import sys; import app.cli; from app.bench.start import main; sys.exit(main())"  # a user's start has the cli
)


@dataclass(frozen=True)
class Start:
    """Seconds since the process was asked for.

    Attributes:
        painted_s: the window has been painted.
        ready_s: the engine is loaded, and the first block of the first pluck is rendered: Space would sound at once.
    """

    painted_s: float
    ready_s: float


def measure_starts(count: int, report: Callable[[int], None]) -> list[Start]:
    """`count` warm starts with default settings, after one that fills the system's caches and does not count."""
    found = []
    for number in range(count + 1):
        report(number)
        found.append(_measure())
    return found[1:]


def _measure() -> Start:
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "LEARNED_STRINGS_SETTINGS": str(Path(folder) / "settings.json")}
        begun_s = time.time()  # the one clock that two processes share everywhere
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
    times_s = json.loads(done.stdout.splitlines()[-1])
    return Start(*(times_s[name] - begun_s for name in ("painted", "ready")))


def main() -> int:
    """Starts the app as its command does, notes the times on the way, and closes it."""
    from app.bench.display import choose_display
    from app.main import run

    choose_display()
    times_s: dict[str, float] = {}
    status = run(lambda window: _watch(window, times_s))
    print(json.dumps(times_s))
    return status


def _watch(window: MainWindow, times_s: dict[str, float]) -> None:
    from PySide6.QtCore import QTimer

    def look() -> None:
        if window.error_label.text():  # it tells of every rendering as it begins and ends
            times_s.setdefault("ready", time.time())
            timer.stop()
            window.close()

    timer = QTimer(window, interval=LOOK_MS)
    timer.timeout.connect(look)
    timer.start()
    window.first_painted.connect(lambda: times_s.setdefault("painted", time.time()))
