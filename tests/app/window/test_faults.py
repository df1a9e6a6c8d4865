"""An unexpected fault is written down, shown as a notice, and a window without an engine stays to say so."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.shared.log import FILE_VARIABLE, LARGEST_BYTES, OLDER_KEPT, faults_logged, log_fault, log_file
from app.views.controls.notice_bar import NoticeBar
from app.window.about import about_text


@pytest.fixture(autouse=True)
def hooks_of_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test runner's own would take the faults for the test's."""
    monkeypatch.setattr(sys, "excepthook", lambda *fault: None)
    monkeypatch.setattr(threading, "excepthook", lambda fault: None)


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(FILE_VARIABLE, str(tmp_path / "logs" / "here.log"))
    return tmp_path / "logs" / "here.log"


def test_a_fault_of_any_thread_is_written_and_reported(qtbot: QtBot, log: Path) -> None:
    notices = NoticeBar()
    qtbot.addWidget(notices)
    qtbot.addWidget(notices.bell)
    with faults_logged(lambda text: notices.faulted.emit("Unexpected.", text)):
        for number in range(3):
            thread = threading.Thread(target=lambda: 1 / 0, name=f"unlucky-{number}")
            thread.start()
            thread.join()
        try:
            raise LookupError("in a slot")
        except LookupError as error:
            sys.excepthook(LookupError, error, error.__traceback__)
    qtbot.waitUntil(lambda: notices.text == "Unexpected. LookupError: in a slot")
    text = log.read_text("utf-8")
    reported = "".join(notice.details for notice in notices.notices)
    for words in ("ZeroDivisionError", "unlucky-2", "LookupError: in a slot", "Traceback"):
        assert words in text and words in reported
    assert [notice.times for notice in notices.notices] == [3, 1] and "unlucky-0" in text
    assert "Python" in text.splitlines()[0]
    assert str(log) in about_text(Path("here"), Path("there"))


def test_the_log_stays_small(log: Path) -> None:
    with faults_logged(lambda text: None):
        for _ in range(40):
            log_fault(RuntimeError("x" * 200_000), "here")
    sizes = [path.stat().st_size for path in log.parent.glob("here.log*")]
    assert len(sizes) == 1 + OLDER_KEPT and max(sizes) <= LARGEST_BYTES + 300_000


def test_without_a_place_for_the_log_it_is_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FILE_VARIABLE, "/dev/null/there/here.log")
    before, reported = sys.excepthook, []
    with faults_logged(reported.append):
        error = ValueError("shown all the same")
        sys.excepthook(ValueError, error, None)
    assert "shown all the same" in reported[0] and sys.excepthook is before
    assert log_file() == Path("/dev/null/there/here.log")


def child(code: str, log: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", code],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", FILE_VARIABLE: str(log), **environment},
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_a_crash_in_compiled_code_leaves_where_it_was(log: Path) -> None:
    code = (
        "from app.shared.log import crashes_written\nimport ctypes\n"
        "with crashes_written():\n    ctypes.string_at(0)\n"
    )
    assert child(code, log).returncode != 0
    assert "Segmentation fault" in log.with_suffix(".crash").read_text() or sys.platform == "win32"


def test_an_engine_that_cannot_be_loaded_is_shown(log: Path, tmp_path: Path) -> None:
    """And garbage is collected, however long that window stays."""
    code = """
import gc
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication
from app.window import main
from app.window.main_window import MainWindow
def broken():
    raise OSError("libtorch.so: cannot open shared object file")
main.load_engine = broken
application = QApplication([])
def look():
    for dialog in application.topLevelWidgets():
        if isinstance(dialog, MainWindow) and (text := dialog.notices.text):
            print("libtorch.so" in text, "cannot be loaded" in text, gc.isenabled())
            application.closeAllWindows()
timer = QTimer(interval=50)
timer.timeout.connect(look)
timer.start()
try:
    main.run()
except OSError as error:
    print("ended with", error)
"""
    done = child(code, log, LEARNED_STRINGS_SETTINGS=str(tmp_path / "settings.json"))
    assert done.stdout.splitlines()[:1] == ["True True True"], done.stderr
    assert "libtorch.so" in log.read_text("utf-8")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a screen")
@pytest.mark.parametrize("display", ["", ":987"])
def test_without_a_screen_there_is_one_line(display: str, log: Path) -> None:
    code = "import sys; from app.commands.cli import main; sys.exit(main([]))"
    done = child(code, log, QT_QPA_PLATFORM="", DISPLAY=display, WAYLAND_DISPLAY="")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "screen" in line


def test_output_that_is_not_utf8_prints_what_it_can(log: Path) -> None:
    code = "import sys; from app.commands.cli import main; sys.exit(main(['models']))"
    done = child(code, log, PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert done.returncode == 0 and "koopman" in done.stdout
