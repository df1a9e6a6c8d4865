"""The real start, in processes of their own: a window opens, renders, closes, is killed, or says what is wrong."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

from app.export.journal import Journal, left_journals
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import Bend, ControlChange, InstrumentTurned, NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from app.shared.log import FILE_VARIABLE, LARGEST_BYTES, OLDER_KEPT, faults_logged, log_fault
from app.views.controls.notice_bar import NoticeBar
from app.window.signals import SIGNALS, asked_to_end

ROOT = Path(__file__).parents[3]
WRITTEN_S = 2.0  # an event is on disk by then
KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
posix = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs POSIX signals")

START = """
import gc, json, sys, threading
from pathlib import Path
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox
from app.player.events import Bend, ControlChange, NoteOff, NoteOn
from app.window import main
from app.window.main_window import MainWindow

def often(parent, step):
    timer = QTimer(parent, interval=30)
    timer.timeout.connect(lambda: step() and timer.stop())
    timer.start()
"""
OPENING = """
def watch(controller):
    notes, struck, asked = controller.performance.notes, [], []
    handle = notes.handle

    def noted(event, due=None):
        made = handle(event, due)
        if isinstance(event, NoteOn):
            struck.append([event.key, made is not None])
        return made

    def close_when_played():
        if isinstance(box := QApplication.activeModalWidget(), QMessageBox):
            asked.append(box.windowTitle())
            QTest.keyClick(box, Qt.Key.Key_Escape)
        elif asked and len(struck) == 2 and controller.performance.ready:
            print(json.dumps([struck, controller.session.choices.played.name, asked]))
            controller.window.close()

    notes.handle = noted
    often(controller.window, close_when_played)

status = main.run(alive=watch, files=[Path(word) for word in sys.argv[1:]])
for thread in threading.enumerate():
    if thread.name == "sound-finder":  # which nobody waits for
        thread.join(60)
print([thread.name for thread in threading.enumerate() if thread is not threading.main_thread()])
raise SystemExit(status)
"""
RECORDING = """
EVENTS = [NoteOn(60, 100), ControlChange(64, 127), Bend(0.25), NoteOff(60), NoteOn(64, 80)]

def watch(controller):
    left, recorder = list(EVENTS), controller.performance.notes.keys.recorder

    def step():
        if not controller.performance.playable:
            return False
        if not recorder.recording:
            controller.instruments.recordings.record()
        elif left:
            controller.inputs.play(left.pop(0))
            if len(left) == 2:
                controller.instruments.change("level_db", -7.5)
        else:
            print(json.dumps([each.time_s for each in recorder._recorded]), flush=True)
            return True

    often(controller.window, step)

raise SystemExit(main.run(alive=watch))
"""
BROKEN = """
def broken():
    raise OSError("libtorch.so: cannot open shared object file")

def look():
    for window in application.topLevelWidgets():
        if isinstance(window, MainWindow) and (text := window.notices.text):
            print("libtorch.so" in text, "cannot be loaded" in text, gc.isenabled())
            application.closeAllWindows()

main.load_engine = broken
application = QApplication([])
often(application, look)
try:
    main.run()
except OSError as error:
    print("ended with", error)
"""
CRASH = """
from app.shared.log import crashes_written
import ctypes
with crashes_written():
    ctypes.string_at(0)
"""
COMMAND = "import sys; from app.commands.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture
def log(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv(FILE_VARIABLE, str(tmp_path / "logs" / "here.log"))
    return tmp_path / "logs" / "here.log"


def begun(program: str, folder: Path, *words: object, **environment: str) -> subprocess.Popen[str]:
    """A process of its own, without a screen and with settings of its own."""
    settings = folder / "settings.json"
    if not settings.exists():
        settings.write_text('{"choices": {"seconds": 0.5}}')
    own = {"LEARNED_STRINGS_SETTINGS": str(settings), "LEARNED_STRINGS_RECORDINGS": str(folder / "left")}
    return subprocess.Popen(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", program, *map(str, words)],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", **own, **environment},
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(program: str, folder: Path, *words: object, **environment: str) -> tuple[int, list[str], str]:
    """Status, lines and errors of a process that ends by itself."""
    with begun(program, folder, *words, **environment) as child:
        try:
            printed, errors = child.communicate(timeout=120)
        finally:
            child.kill()
    return child.returncode, printed.splitlines(), errors


def test_files_are_taken_at_the_start_no_note_of_a_song_is_lost_and_no_thread_stays(tmp_path):
    """And what an earlier run left is offered."""
    song, left = tmp_path / "song.mid", tmp_path / "left"
    song.write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(50, 90)), TimedEvent(0.1, NoteOn(57, 90))]))
    journal, instrument = Journal.begun(left, datetime.now(UTC)), read_instrument(INSTRUMENTS / "mandolin.json")
    journal.write([TimedEvent(0.0, InstrumentTurned(instrument)), TimedEvent(0.0, NoteOn(60, 100))])
    journal.close()
    (tmp_path / "settings.json").write_text('{"choices": {"seconds": 0.5, "preset": "a preset that is gone"}}')
    status, lines, errors = ended(START + OPENING, tmp_path, INSTRUMENTS / "concert_harp.json", song)
    assert status == 0, errors
    assert json.loads(lines[-2]) == [[[50, True], [57, True]], "Concert harp", ["Recover what was played?"]]
    assert lines[-1] == "[]" and len(left_journals(left)) == 1
    assert json.loads((tmp_path / "settings.json").read_text())["window_geometry"]


@posix
@pytest.mark.parametrize("end", [KILL, signal.SIGTERM])
def test_what_is_recorded_while_the_process_ends_is_left_whole(tmp_path, end):
    with begun(START + RECORDING, tmp_path) as child:
        try:
            assert child.stdout is not None
            times_s: list[float] = json.loads(child.stdout.readline())
            if end == KILL:
                time.sleep(WRITTEN_S)
                assert left_journals(tmp_path / "left") == []  # another window does not take what is being recorded
            child.send_signal(end)
            assert child.wait(60) == (-end if end == KILL else 0)
        finally:
            child.kill()
    if end != KILL:
        assert json.loads((tmp_path / "settings.json").read_text())["choices"]["instrument"]["level_db"] == -7.5
    (journal,) = left_journals(tmp_path / "left")
    played = journal.read()
    journal.close()
    assert played is not None
    kinds = [type(each.event) for each in played.events]
    struck = [kind for kind in kinds if kind is not InstrumentTurned]
    assert struck[:5] == [NoteOn, ControlChange, Bend, NoteOff, NoteOn]
    turned = [each.event for each in played.events if isinstance(each.event, InstrumentTurned)]
    assert turned[-1].instrument.level_db == -7.5
    first_s = times_s[kinds.index(NoteOn)]
    wanted = [max(0.0, time_s - first_s) for time_s in sorted(times_s)]
    assert [each.time_s for each in played.events][: len(wanted)] == wanted
    assert {type(each.event) for each in played.events[len(wanted) :]} <= {NoteOff, ControlChange}  # what was down


@posix
@pytest.mark.parametrize("number", SIGNALS)
def test_each_signal_that_asks_to_end_is_taken_by_the_event_loop(qtbot, number):
    before, asked = signal.getsignal(number), []
    with asked_to_end(lambda: asked.append(signal.getsignal(number))):
        os.kill(os.getpid(), number)
        qtbot.waitUntil(lambda: len(asked) > 0)
    assert asked == [before], "a second one has its usual effect"


def test_a_fault_of_any_thread_is_logged(qtbot, log, monkeypatch):
    monkeypatch.setattr(sys, "excepthook", lambda *fault: None)  # the runner's own would take it for the test's
    monkeypatch.setattr(threading, "excepthook", lambda fault: None)
    notices, before = NoticeBar(), sys.excepthook
    qtbot.addWidget(notices)
    qtbot.addWidget(notices.bell)
    for place in (log, Path("/dev/null/there/here.log")):
        monkeypatch.setenv(FILE_VARIABLE, str(place))
        with faults_logged(lambda text: notices.faulted.emit("Unexpected.", text)):
            thread = threading.Thread(target=lambda: 1 / 0, name="unlucky")
            thread.start()
            thread.join()
            sys.excepthook(LookupError, LookupError(f"in a slot of {place}"), None)
        qtbot.waitUntil(lambda: notices.text == f"Unexpected. LookupError: in a slot of {place}")  # noqa: B023
    assert sys.excepthook is before
    text, said = log.read_text("utf-8"), "".join(notice.details for notice in notices.notices)
    for words in ("ZeroDivisionError", "unlucky", "LookupError: in a slot", "Traceback"):
        assert words in text and words in said
    assert "Python" in text.splitlines()[0]
    monkeypatch.setenv(FILE_VARIABLE, str(log))
    with faults_logged(lambda text: None):
        for _ in range(40):
            log_fault(RuntimeError("x" * 200_000), "here")
    sizes = [path.stat().st_size for path in log.parent.glob("here.log*")]
    assert len(sizes) == 1 + OLDER_KEPT and max(sizes) <= LARGEST_BYTES + 300_000


def test_a_crash_in_compiled_code_leaves_where_it_was(log, tmp_path):
    assert ended(CRASH, tmp_path)[0] != 0
    assert "Segmentation fault" in log.with_suffix(".crash").read_text() or sys.platform == "win32"


def test_an_engine_that_cannot_be_loaded_is_shown_and_garbage_is_collected(log, tmp_path):
    _, lines, errors = ended(START + BROKEN, tmp_path)
    assert lines[:1] == ["True True True"], errors
    assert "libtorch.so" in log.read_text("utf-8")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a screen")
@pytest.mark.parametrize("display", ["", ":987"])
def test_without_a_screen_there_is_one_line(display, log, tmp_path):
    status, _, errors = ended(COMMAND, tmp_path, QT_QPA_PLATFORM="", DISPLAY=display, WAYLAND_DISPLAY="")
    (line,) = errors.splitlines()
    assert status == 1 and "screen" in line


def test_output_that_is_not_utf8_prints_what_it_can(tmp_path):
    status, lines, _ = ended(COMMAND, tmp_path, "instruments", PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert status == 0 and any("harpsichord" in line for line in lines)
