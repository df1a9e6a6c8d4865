"""A factory instrument is played without torch, which takes more than a second to load."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

OFFLINE = """
import sys
from app.instrument.events import NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED, read_patch
from engine.presets import find_preset, load_preset

patch = read_patch(SHIPPED / "classical_guitar.json")
preset = load_preset(find_preset(patch.preset))
for source in ("model", "truth", "difference"):
    blocks = list(render_events(patch, preset, [TimedEvent(0.0, NoteOn(52, 100))], 48_000, source, seconds=0.2))
    assert source == "difference" or max(abs(block).max() for block in blocks) > 0.01
assert "torch" not in sys.modules
"""

WINDOW = """
import sys
from PySide6.QtCore import QCoreApplication, QMetaObject, Qt
from app.rendering import RenderWorker
from app.window import main

found = []

def heard():
    found.append("torch" in sys.modules)
    QMetaObject.invokeMethod(QCoreApplication.instance(), "quit", Qt.ConnectionType.QueuedConnection)

main.load_torch = heard  # it is called when keys sound
RenderWorker.submit = lambda self, request: None  # pictures come after that: tests/app/rendering/test_worker.py
main.run()
assert found == [False], found
"""


def run(code: str, folder: Path) -> None:
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "LEARNED_STRINGS_SETTINGS": str(folder / "s.json")}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_a_factory_instrument_is_rendered(tmp_path: Path) -> None:
    run(OFFLINE, tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="there torch must come before Qt")
def test_the_window_plays_its_first_key(tmp_path: Path) -> None:
    run(WINDOW, tmp_path)
