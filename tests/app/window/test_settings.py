"""Settings survive a round trip and a kill; any file lets the app start, and loses no more than what is wrong."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from PySide6.QtCore import QObject

from app.audio.choices import DeviceChoice, SoundChoice
from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.playing.midi import MidiChoices
from app.session.choices import Choices
from app.views.background import Background
from app.views.file_places import FileChoices
from app.views.look import Look
from app.window.remembering import SettingsSaver
from app.window.settings import Settings, load_settings, save_settings, settings_file
from engine.pluck import Pluck
from tests.app.gestures import reported


def load(path: Path, text: str | bytes) -> tuple[Settings, str]:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load_settings(path)


def test_settings_survive_a_round_trip(tmp_path, monkeypatch):
    path = tmp_path / "new folder" / "settings.json"
    monkeypatch.setenv("LEARNED_STRINGS_SETTINGS", str(path))
    assert settings_file() == path and load_settings(path) == (Settings(), ""), "a first start has defaults"
    settings = Settings(
        choices=Choices(pluck=Pluck(0.7), heard="b", b="difference", loop=True),
        export=ExportChoices(format="flac 16", rate_hz=0),
        sampled=SampledChoices(form="sf2", keys=(40, 76), layers=8, dry=True),
        device=DeviceChoice(name="Loud", host_api="ALSA"),
        sound=SoundChoice(rate_hz=44_100, buffer=512),
        look=Look(theme="light", size_percent=125),
        midi=MidiChoices(port="Keys", notes="preset", controllers={"width": 74}),
        files=FileChoices(folders={"note": tmp_path}, recent=(tmp_path / "song.mid",)),
        window_geometry="AdnQyw==",
    )
    save_settings(path, settings)
    assert load_settings(path) == (settings, "")
    assert [each.name for each in path.parent.iterdir()] == ["settings.json"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{"version": 1, "choices": {"position": 0.6}}', Settings(choices=Choices(pluck=Pluck(0.6)))),  # without MIDI
        ('{"choices": {"heard": "truth"}}', Settings(choices=Choices(heard="b"))),  # from before the slots
        ('{"sampled": {"folder": "/music"}, "abx": {"folder": ""}}', Settings()),  # from before `files`
        ('{"look": {"face": "light"}}', Settings(look=Look(theme="light"))),  # of version 0.1
    ],
)
def test_a_file_of_an_earlier_version_loads_without_a_notice(tmp_path, text, expected):
    assert load(tmp_path / "settings.json", text) == (expected, "")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("", "the file"),
        ("{", "the file"),
        ('{"choices": {"position": 9}}', "choices.pluck: position"),
        ('{"colour": 1}', "colour"),
        ('{"sampled": {"layers": 1e30}}', "sampled.layers"),
        ('{"version": 2}', "version"),
        ("[" * 100_000, ""),
        ('{"version": 1, "colour": ' + "7" * 5000 + "}", ""),
        ('{"choices": ' + '{"a": ' * 500 + "1" + "}" * 500 + "}", ""),
        ('{"window_geometry": "' + "x" * 3_000_000 + '"}', ""),
        (b"\xff\xfe", ""),
        ('{"choices": {"position": NaN}}', ""),
        ('{"favourites": ["\\u001b[2J"], "\\u001b]0;owned\\u0007": 1}', ""),
    ],
    ids=lambda text: repr(text[:24]),
)
def test_a_broken_file_is_set_aside(tmp_path, text, names):
    path = tmp_path / "settings.json"
    settings, notice = load(path, text)
    assert names in notice and notice.isprintable() and len(notice) <= 500
    if names:
        assert settings == Settings() and "settings.broken.json" in notice
        assert (tmp_path / "settings.broken.json").read_text() == text
        assert load_settings(path) == (Settings(), "")
    save_settings(path, settings)
    assert load_settings(path) == (settings, "")


def test_a_wrong_field_loses_no_more_than_itself(tmp_path):
    """What is dropped for one fault is not there for the next, and may be necessary where it was."""
    path = tmp_path / "settings.json"
    settings, notice = load(
        path,
        '{"choices": {"position": 9, "listen": 0.2}, "sound": {"buffer": 3, "rate_hz": 96000}, "look": 7,'
        ' "colour": 1, "device": {"name": "Loud"}, "export": {"bits": "32f"}}',
    )
    sound, export = SoundChoice(rate_hz=96_000), ExportChoices(format="wav 32f")
    assert settings == Settings(choices=Choices(listen=0.2), sound=sound, export=export)
    assert "choices.pluck: position" in notice and "settings.broken.json" in notice
    instrument = json.loads((INSTRUMENTS / "classical_guitar.json").read_text())
    kept = {"volume_db": -12.0, "instrument": instrument, "string": {"length_m": 0.65}}
    for extra, is_there in (({}, True), ({"kind": "set", "extra": 1}, False)):
        instrument["strings"] |= extra
        settings, notice = load(path, json.dumps({"choices": kept, "favourites": ["mine"]}))
        assert (settings.choices.volume_db, settings.favourites) == (-12.0, ("mine",))
        assert settings.choices.string is None and (settings.choices.instrument is not None) == is_there
        assert "choices.string" in notice or not is_there


def test_a_change_is_saved_once_it_rests_and_where_that_fails_later(qtbot, tmp_path):
    """The test says when the saver looks."""
    owner, now = QObject(), Settings()

    def saver(path: Path) -> SettingsSaver:
        return SettingsSaver(path, load_settings(path)[0], lambda: now, owner)

    def look(keeper: SettingsSaver) -> None:
        keeper.look()
        (background,) = keeper.findChildren(Background)
        qtbot.waitUntil(lambda: not background.busy)

    def place(position: float) -> Settings:
        return Settings(choices=Choices(pluck=Pluck(position)))

    path, folder = tmp_path / "settings.json", tmp_path / "folder"
    keeper, now = saver(path), place(0.41)
    for written in (False, True):  # it may be under way
        look(keeper)
        assert path.exists() == written
    assert load_settings(path)[0] == now
    before = path.stat().st_mtime_ns
    look(keeper)
    keeper.close()
    assert path.stat().st_mtime_ns == before, "nothing new, nothing written"
    folder.write_text("in the way, as a full disk is for a moment")
    keeper = saver(folder / "settings.json")
    failed = reported(keeper.failed)
    for position in (0.42, 0.43):
        now = place(position)
        look(keeper)
        look(keeper)
    qtbot.waitUntil(lambda: len(failed) == 1 and "cannot be written" in failed[0])  # once
    folder.unlink()
    keeper.close()
    assert load_settings(folder / "settings.json")[0].choices.pluck.position == 0.43


KILLED = """
import sys
from pathlib import Path
from PySide6.QtCore import QCoreApplication, QTimer
from app.session.choices import Choices
from app.window.remembering import SettingsSaver
from app.window.settings import Settings
from engine.pluck import Pluck
application = QCoreApplication([])
box = [Settings()]
keeper = SettingsSaver(Path(sys.argv[1]), box[0], lambda: box[0], application)
QTimer.singleShot(0, lambda: box.__setitem__(0, Settings(choices=Choices(pluck=Pluck(0.41)))))
looks = QTimer(interval=100)
looks.timeout.connect(keeper.look)
looks.start()
application.exec()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX does")
def test_a_kill_loses_nothing_that_rested(tmp_path):
    path = tmp_path / "settings.json"
    with subprocess.Popen([sys.executable, "-c", KILLED, str(path)]) as process:
        end_s = time.monotonic() + 60
        while not path.exists() and time.monotonic() < end_s:
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
    assert load_settings(path)[0].choices.pluck.position == 0.41
