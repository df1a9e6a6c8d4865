"""The program as its user starts it, on the private screen, until its first key is heard."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from app.window.settings import Settings, save_settings
from tests.bench.play import hands
from tests.bench.play.children import child
from tests.bench.play.recording import Recording
from tests.bench.play.screen import Screen
from tests.bench.play.sound_server import SoundServer

TITLE = "Learned Strings"
START_PATIENCE_S = 120.0
TRY_EVERY_S = 0.25  # a key, while the program starts


@contextlib.contextmanager
def ended_politely() -> Iterator[None]:
    """A request to end the benchmark ends all that it has started."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def app(
    folder: Path, settings: Settings, server: SoundServer, screen: Screen, more: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """The program as its command starts it; `more` is added to its environment."""
    file = folder / "settings.json"
    save_settings(file, settings)
    environment = {
        **server.environment,
        "DISPLAY": screen.name,
        "QT_QPA_PLATFORM": "xcb",
        "LEARNED_STRINGS_SETTINGS": str(file),
        **(more or {}),
    }
    environment.pop("WAYLAND_DISPLAY", None)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as at a user's second start
    command = [sys.executable, "-m", "app.commands.cli"]
    with (folder / "app.log").open("wb") as log, child(command, environment, stdout=log, stderr=log) as process:
        yield process


def open_window(screen: Screen, process: subprocess.Popen[bytes]) -> tuple[Any, float]:
    """The program's window, and when it was to be seen."""
    deadline_s = time.monotonic() + START_PATIENCE_S
    while (window := screen.find(TITLE)) is None:
        if process.poll() is not None or time.monotonic() > deadline_s:
            raise RuntimeError("the app opened no window; start it by hand to see why")
        time.sleep(0.01)
    shown_s = time.monotonic()
    screen.take(window)
    return window, shown_s


def try_keys(
    screen: Screen,
    recorded: Recording,
    process: subprocess.Popen[bytes],
    started_s: float,
    key: str = hands.KEYS[0],
) -> None:
    deadline_s = time.monotonic() + START_PATIENCE_S
    while True:
        hands.tap(screen, key)
        if recorded.wait_for_sound(started_s, TRY_EVERY_S):
            return
        if process.poll() is not None or time.monotonic() > deadline_s:
            raise RuntimeError("no key of the app was heard; is its sound device the system's default?")
