"""A recording outlives the process that made it: killed, or asked to end by the system."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.export.journal import left_journals
from app.instrument.events import Bend, ControlChange, NoteOff, NoteOn, PatchTurned
from app.window.signals import SIGNALS, asked_to_end

ROOT = Path(__file__).parents[3]
WRITTEN_S = 2.0  # an event is on disk by then
pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs POSIX signals")

RECORDING = """
import json
from PySide6.QtCore import QTimer
from app.instrument.events import (Bend, ControlChange, NoteOff, NoteOn, PatchTurned)
from app.window import main

EVENTS = [NoteOn(60, 100), ControlChange(64, 127), Bend(0.25), NoteOff(60), NoteOn(64, 80)]

def watch(controller):
    played, recorder = [], controller.performance.notes.keys.recorder

    def step():
        if not controller.performance.playable:
            return
        if not recorder.recording:
            controller.patches.recordings.record()
        elif len(played) < len(EVENTS):
            controller.instruments.play(EVENTS[len(played)])
            played.append(1)
            if len(played) == 3:
                controller.patches.change("level_db", -7.5)
        else:
            timer.stop()
            print(json.dumps([each.time_s for each in recorder._recorded]), flush=True)

    timer = QTimer(controller.window, interval=30)
    timer.timeout.connect(step)
    timer.start()

raise SystemExit(main.run(alive=watch))
"""

RECOVERING = """
import json, sys
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox
from app.instrument.events import (NoteOn)
from app.window import main

def watch(controller):
    recordings = controller.patches.recordings
    asked = []

    def look():
        box = QApplication.activeModalWidget()
        if isinstance(box, QMessageBox):
            asked.append(box.text())
            QTest.keyClick(box, Qt.Key[sys.argv[1]])
        elif asked and (controller.exports.dialog is not None or sys.argv[1] == "Key_Escape"):
            timer.stop()
            latest = recordings.latest
            print(json.dumps([each.time_s for each in latest.events] if latest else None), flush=True)
            controller.window.may_close = lambda: True
            controller.window.close()

    timer = QTimer(controller.window, interval=30)
    timer.timeout.connect(look)
    timer.start()

raise SystemExit(main.run(alive=watch))
"""


@contextmanager
def app(program: str, folder: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
    """A process of its own, without a screen."""
    settings = folder / "settings.json"
    if not settings.exists():
        settings.write_text('{"choices": {"seconds": 0.5}}')
    environment = {"LEARNED_STRINGS_SETTINGS": str(settings), "LEARNED_STRINGS_RECORDINGS": str(folder / "left")}
    child = subprocess.Popen(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", program, *words],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", **environment},
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield child
    finally:
        child.kill()
        child.communicate()


def line(child: subprocess.Popen[str]) -> list[float] | None:
    assert child.stdout is not None
    found: list[float] | None = json.loads(child.stdout.readline())
    return found


def recorded(folder: Path, end: signal.Signals) -> list[float]:
    """Records in a process that gets a signal while it does; the times of the events that it recorded."""
    with app(RECORDING, folder) as child:
        times_s = line(child)
        assert times_s is not None
        if end == signal.SIGKILL:
            time.sleep(WRITTEN_S)
            assert left_journals(folder / "left") == []  # another window does not take what is still being recorded
        child.send_signal(end)
        assert child.wait(60) == (-end if end == signal.SIGKILL else 0)
    return times_s


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_what_is_recorded_while_the_process_ends_is_offered_at_the_next_start(
    tmp_path: Path, end: signal.Signals
) -> None:
    times_s = recorded(tmp_path, end)
    if end != signal.SIGKILL:
        assert json.loads((tmp_path / "settings.json").read_text())["choices"]["patch"]["level_db"] == -7.5
    (journal,) = left_journals(tmp_path / "left")
    played = journal.read()
    journal.close()
    assert played is not None
    kinds = [type(each.event) for each in played.events]
    assert [kind for kind in kinds if kind is not PatchTurned][:5] == [NoteOn, ControlChange, Bend, NoteOff, NoteOn]
    assert [each.event.patch.level_db for each in played.events if isinstance(each.event, PatchTurned)][-1] == -7.5
    first_s = times_s[kinds.index(NoteOn)]
    wanted = [max(0.0, time_s - first_s) for time_s in sorted(times_s)]
    found = [each.time_s for each in played.events]
    assert found[: len(wanted)] == wanted
    assert {type(each.event) for each in played.events[len(wanted) :]} <= {NoteOff, ControlChange}  # what was down
    if end != signal.SIGKILL:
        return
    for key, kept in (("Key_Escape", None), ("Key_Return", found)):
        with app(RECOVERING, tmp_path, key) as child:
            assert line(child) == kept, key
            assert child.wait(60) == 0
    assert len(left_journals(tmp_path / "left")) == 1  # it is not saved yet


@pytest.mark.parametrize("number", SIGNALS)
def test_each_signal_that_asks_to_end_is_taken_by_the_event_loop(qtbot: QtBot, number: signal.Signals) -> None:
    before, asked = signal.getsignal(number), []
    with asked_to_end(lambda: asked.append(signal.getsignal(number))):
        os.kill(os.getpid(), number)
        qtbot.waitUntil(lambda: len(asked) > 0)
    assert asked == [before], "a second one has its usual effect"
