"""The real start, in a process of its own: the window opens, renders, closes, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from app.instrument.events import NoteOn, TimedEvent
from app.instrument.midi_file import midi_bytes
from app.patches.library import SHIPPED as PATCHES

ROOT = Path(__file__).parents[3]
PROGRAM = """
import threading
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication
from app.window import main
from app.window.main_window import MainWindow

def close_when_rendered():
    window = next((each for each in QApplication.topLevelWidgets() if isinstance(each, MainWindow)), None)
    if window is not None and "Error of this pluck" in window.error_label.text():
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


OPENING = """
import json, sys
from pathlib import Path
from PySide6.QtCore import QTimer
from app.instrument.events import (NoteOn)
from app.window import main

def watch(controller):
    notes, struck = controller.performance.notes, []
    handle = notes.handle

    def noted(event, due=None):
        made = handle(event, due)
        if isinstance(event, NoteOn):
            struck.append([event.key, made is not None])
        return made

    def close_when_played():
        if len(struck) == 2 and controller.performance.ready:
            print(json.dumps({"struck": struck, "instrument": controller.session.choices.instrument.name}))
            controller.window.close()

    notes.handle = noted
    timer = QTimer(controller.window, interval=50)
    timer.timeout.connect(close_when_played)
    timer.start()

raise SystemExit(main.run(alive=watch, files=[Path(word) for word in sys.argv[1:]]))
"""


def test_files_are_taken_at_the_start_and_no_note_of_a_song_is_lost(tmp_path: Path) -> None:
    song = tmp_path / "song.mid"
    song.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(50, 90)), TimedEvent(0.1, NoteOn(57, 90))]))
    settings = tmp_path / "settings.json"
    settings.write_text('{"choices": {"seconds": 0.5}}')
    done = start(OPENING, settings, PATCHES / "concert_harp.json", song)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found == {"struck": [[50, True], [57, True]], "instrument": "Concert harp"}


def start(program: str, settings: Path, *files: Path) -> subprocess.CompletedProcess[str]:
    """Runs a program in a process of its own, without a screen and with settings of its own."""
    return subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", program, *map(str, files)],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "LEARNED_STRINGS_SETTINGS": str(settings)},
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_start_and_close(tmp_path: Path) -> None:
    settings = tmp_path / "settings.json"
    settings.write_text('{"choices": {"seconds": 0.5, "preset": "a preset that is gone"}}')
    done = start(PROGRAM, settings)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
    saved = json.loads(settings.read_text())
    assert (ROOT / "presets" / f"{saved['choices']['patch']['preset']}.safetensors").is_file()
    assert saved["window_geometry"]
