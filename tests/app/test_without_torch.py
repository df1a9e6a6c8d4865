"""A factory instrument is played, drawn and analysed without torch, which takes seconds and 200 MB to load."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

SCRIPT = """
import linecache, sys, threading
from app.window import main
from PySide6.QtCore import QTimer
from app.player.events import (NoteOn, TimedEvent)
from app.player.offline import render_events
from app.instruments.library import SHIPPED, read_instrument
from engine.presets import find_preset, load_preset

instrument = read_instrument(SHIPPED / "classical_guitar.json")
preset = load_preset(find_preset(instrument.preset))
for source in ("model", "truth", "difference"):
    blocks = list(render_events(instrument, preset, [TimedEvent(0.0, NoteOn(52, 100))], 48_000, source, seconds=0.2))
    assert source == "difference" or max(abs(block).max() for block in blocks) > 0.01
assert "torch" not in sys.modules

keys, drawn, loaded, timer = [45, 64], [], [], QTimer(interval=20)
views = ["error_plane", "eigenvalues"]

def alive(controller):
    stage = controller.performance

    def look():
        if len(loaded) == 2:
            if all(thread.name != "torch-loader" for thread in threading.enumerate()):
                timer.stop()
                controller.window.close()
            return
        if loaded:
            view = controller.session.choices.left_view
            panel = {panel.key: panel for panel in controller.panels}[view]
            if not views and panel.columns() is not None:
                loaded.append("torch" in sys.modules)
                panel.background.cancel()  # finer errors
                controller.presets.browser.show_over()
            elif view == "spectrum" or panel.columns() is not None:
                controller.session.update(left_view=views.pop())
            return
        if not (stage.playable and stage.ready and stage.settled) or any(take is stage.take for take in drawn):
            return
        drawn.append(stage.take)
        if keys:
            controller.inputs.play(NoteOn(keys.pop(), 100))
            return
        loaded.append("torch" in sys.modules or "scipy.signal" in sys.modules)  # 60 MB each, or more
        controller.window.face_asked.emit("lab")

    timer.timeout.connect(look)
    timer.start()

main.run(alive=alive)
assert len({take.info.string for take in drawn}) == 3
for take in drawn:
    for source in ("model", "truth"):
        assert abs(take.motion_m(source)).max() > 1e-4 and abs(take.listened.signals[source].read()).max() > 0
assert loaded == [False, False] and "torch" in sys.modules  # a browser of presets has it before a model is chosen
assert len(linecache.cache) < 100  # sources of modules, which PySide would keep
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there torch must come before Qt")
def test_an_instrument_is_rendered_and_the_window_plays_keys_and_draws_their_strings(tmp_path):
    (path := tmp_path / "s.json").write_text('{"choices": {"seconds": 0.5}}')  # each note is drawn to its end
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "LEARNED_STRINGS_SETTINGS": str(path)}
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
