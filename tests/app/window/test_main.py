"""The real start, in a process of its own: the window opens, renders, closes, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import threading
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication
from app.window import main
from app.window.main_window import MainWindow

def close_when_rendered():
    window = next((each for each in QApplication.topLevelWidgets() if isinstance(each, MainWindow)), None)
    if window is not None and "error of this pluck" in window.error_label.text():
        window.close()

application = QApplication([])
timer = QTimer(interval=50)
timer.timeout.connect(close_when_rendered)
timer.start()
status = main.run()
for thread in threading.enumerate():
    if thread.name == "sound-finder":  # which nobody waits for
        thread.join(60)
print([thread.name for thread in threading.enumerate() if thread is not threading.main_thread()])
raise SystemExit(status)
"""


def test_start_and_close(tmp_path: Path) -> None:
    settings = tmp_path / "settings.json"
    settings.write_text('{"choices": {"seconds": 0.5, "preset": "a preset that is gone"}}')
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "LEARNED_STRINGS_SETTINGS": str(settings)}
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", PROGRAM],
        env=environment,
        cwd=root,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
    saved = json.loads(settings.read_text())
    assert (root / "presets" / f"{saved['choices']['preset']}.safetensors").is_file()
    assert saved["window_geometry"]
