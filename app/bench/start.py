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
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from app.main_window import MainWindow

Moment = Literal["painted", "ready"]
LOOK_MS = 5
PATIENCE_S = 180.0
# the command line is imported, as it is at a user's start
COMMAND = "import sys; import app.cli; from app.bench.start import main; sys.exit(main(sys.argv[1]))"


@dataclass(frozen=True)
class Starts:
    """Seconds since the process was asked for.

    Attributes:
        painted_s: of each start, until the window has been painted.
        ready_s: of one, until the engine is loaded and the first block of the first pluck is rendered: Space would
            sound at once.
    """

    painted_s: tuple[float, ...]
    ready_s: float


def measure_starts(count: int, report: Callable[[int], None]) -> Starts:
    """`count` warm starts with default settings, after one that fills the system's caches and does not count.

    All but the last end with the first picture: what comes after it takes longer, and differs little.
    """
    report(0)
    _measure("ready")
    painted_s = []
    for number in range(1, count):
        report(number)
        painted_s.append(_measure("painted")["painted"])
    report(count)
    last_s = _measure("ready")
    return Starts((*painted_s, last_s["painted"]), last_s["ready"])


def _measure(until: Moment) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "LEARNED_STRINGS_SETTINGS": str(Path(folder) / "settings.json")}
        begun_s = time.time()  # the one clock that two processes share everywhere
        done = subprocess.run(
            [sys.executable, "-c", COMMAND, until],
            env=environment,
            cwd=Path(__file__).parents[2],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
    if done.returncode != 0:
        raise RuntimeError(f"the app did not start: {done.stderr.strip().splitlines()[-1:]}")
    return {name: time_s - begun_s for name, time_s in json.loads(done.stdout.splitlines()[-1]).items()}


def main(until: Moment) -> int:
    """Starts the app as its command does, notes the times on the way, and ends it."""
    from app.bench.display import choose_display
    from app.main import run

    choose_display()
    times_s: dict[str, float] = {}
    status = run(lambda window: _watch(window, times_s, until))
    print(json.dumps(times_s))
    return status


def _watch(window: MainWindow, times_s: dict[str, float], until: Moment) -> None:
    from PySide6.QtCore import QTimer

    def painted() -> None:
        times_s["painted"] = time.time()
        if until == "painted":
            print(json.dumps(times_s), flush=True)
            os._exit(0)  # the engine is being loaded, and would be waited for

    def look() -> None:
        if window.error_label.text():  # it tells of every rendering as it begins and ends
            times_s["ready"] = time.time()
            timer.stop()
            window.close()

    timer = QTimer(window, interval=LOOK_MS)
    timer.timeout.connect(look)
    timer.start()
    window.first_painted.connect(painted)
