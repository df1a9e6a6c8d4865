"""Settings outlive a kill, and any file lets the app start."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from PySide6.QtCore import QObject
from pytestqt.qtbot import QtBot

from app.session.choices import Choices
from app.window.remembering import SettingsSaver
from app.window.settings import Settings, load_settings, save_settings


class Desk:
    """What is to be remembered of one instance."""

    def __init__(self, path: Path, owner: QObject) -> None:
        self.now = load_settings(path)[0]
        self.keeper = SettingsSaver(path, self.now, lambda: self.now, owner)
        self.keeper._timer.stop()  # the test says when it looks

    def choose(self, **changes: object) -> None:
        choices = Choices.model_validate({**self.now.choices.model_dump(), **changes})
        self.now = self.now.model_copy(update={"choices": choices})

    def look(self) -> None:
        self.keeper.look()
        if self.keeper._writing is not None:
            self.keeper._writing.join()


def test_a_change_is_saved_once_it_rests(qtbot: QtBot, tmp_path: Path) -> None:
    owner, path = QObject(), tmp_path / "settings.json"
    desk = Desk(path, owner)
    desk.choose(position=0.41)
    desk.look()
    assert not path.exists()  # it may be under way
    desk.look()
    assert load_settings(path)[0].choices.position == 0.41
    before = path.stat().st_mtime_ns
    desk.look()
    desk.keeper.close()
    assert path.stat().st_mtime_ns == before  # nothing new, nothing written


def test_a_folder_that_cannot_be_written_is_reported_once(qtbot: QtBot, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    owner, reported = QObject(), []
    desk = Desk(tmp_path / "file" / "settings.json", owner)
    desk.keeper.failed.connect(reported.append)
    for position in (0.41, 0.42):
        desk.choose(position=position)
        desk.keeper.close()
    assert len(reported) == 1 and "cannot be written" in reported[0]


KILLED = """
import sys, time
from pathlib import Path
from PySide6.QtCore import QCoreApplication, QTimer
from app.session.choices import Choices
from app.window.remembering import SettingsSaver
from app.window.settings import Settings
application = QCoreApplication([])
box = [Settings()]
keeper = SettingsSaver(Path(sys.argv[1]), box[0], lambda: box[0], application)
QTimer.singleShot(0, lambda: box.__setitem__(0, Settings(choices=Choices(position=0.41))))
print("ready", flush=True)
application.exec()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX does")
def test_a_kill_loses_nothing_that_rested(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    with subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE) as process:
        end = time.monotonic() + 60
        while not path.exists() and time.monotonic() < end:
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
    assert load_settings(path)[0].choices.position == 0.41


@pytest.mark.parametrize(
    "text",
    [
        b"[" * 100_000,
        b'{"version": 1, "colour": ' + b"7" * 5000 + b"}",
        b'{"choices": ' + b'{"a": ' * 500 + b"1" + b"}" * 500 + b"}",
        b'{"window_geometry": "' + b"x" * 3_000_000 + b'"}',
        b"\xff\xfe",
        b'{"choices": {"position": NaN}}',
        json.dumps({"favourites": ["\x1b[2J"], "\x1b]0;owned\x07": 1}).encode(),
    ],
    ids=["deep", "digits", "deep tables", "large", "no text", "NaN", "escapes"],
)
def test_any_file_lets_the_app_start(text: bytes, tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_bytes(text)
    settings, notice = load_settings(path)
    assert isinstance(settings, Settings)
    assert notice.isprintable() and len(notice) <= 500
    save_settings(path, settings)
    assert load_settings(path) == (settings, "")


def test_what_could_not_be_written_is_written_later(qtbot: QtBot, tmp_path: Path) -> None:
    folder, owner = tmp_path / "folder", QObject()
    folder.write_text("in the way, as a full disk is for a moment")
    desk = Desk(folder / "settings.json", owner)
    desk.choose(position=0.41)
    desk.look()
    desk.look()
    folder.unlink()
    desk.keeper.close()
    assert load_settings(folder / "settings.json")[0].choices.position == 0.41
