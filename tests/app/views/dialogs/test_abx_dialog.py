"""The listening test by keyboard: it runs, hides what must be hidden, and keeps a record."""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.analysis.abx.record import AbxRecord, Candidate
from app.analysis.abx.trials import AbxChoices, draw_order
from app.audio.devices import AudioDevice
from app.audio.output import Output
from app.audio.sound import Sound
from app.playing.pair import Pair
from app.views.dialogs.abx_dialog import DEVICE_CHANGED, SAME, TRIVIAL, AbxDialog
from app.views.file_places import FilePlaces
from engine.voices import Mixer
from tests.app.gestures import named
from tests.app.places import choose_files
from tests.app.questions import answered

RATE_HZ = 48_000
HEADPHONES = AudioDevice("Headphones", "Test API", RATE_HZ)
A, B = (Candidate(label=label, preset="small", preset_sha256="0f" * 32) for label in ("Model", "Truth"))
MATERIAL = AbxRecord(a=A, b=B, pluck={"position": 0.4}, through={"volume_db": 0.0}, planned_trials=1, seed=0)
Open = Callable[..., AbxDialog]
Sounds = Mapping[str, NDArray[np.float32]]


@pytest.fixture
def devices() -> list[AudioDevice]:
    """What is connected; sound goes to the last."""
    return [HEADPHONES]


@pytest.fixture
def sound(
    numb_output: Callable[[AudioDevice, float, Mixer], Output], devices: list[AudioDevice], qtbot: QtBot
) -> Iterator[Sound]:
    with Sound(look_up=lambda *_: devices[-1], open_output=numb_output) as made:
        made.open()
        qtbot.waitUntil(lambda: made.status().device is not None)
        yield made


def sounds_of(model_hz: float = 401.0, truth_hz: float = 400.0) -> Sounds:
    time_s = np.arange(4800)[:, None] / RATE_HZ
    sounds = {"model": 0.2 * np.sin(6.28 * model_hz * time_s), "truth": 0.3 * np.sin(6.28 * truth_hz * time_s)}
    return {source: samples.astype(np.float32) for source, samples in sounds.items()}


def done(sounds: Sounds) -> Future[Sounds]:
    rendered: Future[Sounds] = Future()
    rendered.set_result(sounds)
    return rendered


@pytest.fixture
def open_dialog(qtbot: QtBot, sound: Sound, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Open:
    monkeypatch.setattr("app.views.dialogs.abx_dialog.default_folder", lambda: tmp_path / "records")

    def open_dialog(
        seed: int = 1, trials: int = 3, render: Callable[[int], Future[Sounds]] | None = None, through: Sound = sound
    ) -> AbxDialog:
        rendered = render or (lambda rate_hz: done(sounds_of()))
        choices = AbxChoices(trials=trials)
        dialog = AbxDialog(through, MATERIAL, choices, rendered, FilePlaces(), seed=lambda: seed)
        qtbot.addWidget(dialog, before_close_func=lambda closed: closed.abandon())  # without its question
        with qtbot.waitExposed(dialog):
            dialog.open()
        if render is None and through is sound:
            qtbot.waitUntil(start_button(dialog).isEnabled)
        return dialog

    return open_dialog


def press(qtbot: QtBot, dialog: AbxDialog, *keys: str) -> None:
    codes = {"left": Qt.Key.Key_Left, "right": Qt.Key.Key_Right, " ": Qt.Key.Key_Space, "esc": Qt.Key.Key_Escape}
    for key in keys:
        qtbot.keyClick(dialog.focusWidget() or dialog, codes.get(key) or Qt.Key(ord(key.upper())))


def start_button(dialog: AbxDialog) -> QPushButton:
    return named(dialog, "Start the test", QPushButton)


def start(dialog: AbxDialog) -> None:
    start_button(dialog).click()
    assert dialog.testing


def texts(widget: QWidget) -> str:
    shown = [w for w in widget.findChildren(QLabel) + widget.findChildren(QAbstractButton) if w.isVisible()]
    return "\n".join(w.text() for w in shown)


def saved(tmp_path: Path) -> AbxRecord:
    (path,) = (tmp_path / "records").iterdir()
    return AbxRecord.model_validate_json(path.read_bytes())


def test_a_test_by_keyboard(qtbot, open_dialog, tmp_path, monkeypatch):
    heard: list[str] = []

    class Heard(Pair):
        def select(self, name: str) -> None:
            heard.append(name)
            super().select(name)

    monkeypatch.setattr("app.views.dialogs.abx_dialog.Pair", Heard)
    seed, order = 4, draw_order(4, 3)
    dialog = open_dialog(seed)
    start(dialog)
    keys = {"A": ("1", "left"), "B": ("2", "right")}
    for number, x in enumerate(order):
        press(qtbot, dialog, "1", "a", "b", "2", "right")
        assert f"Trial {number + 1} of 3" in texts(dialog)
        assert "right" not in texts(dialog)
        press(qtbot, dialog, "x")
        assert heard[-3:] == ["A", "B", x]
        press(qtbot, dialog, " ", keys[x][number % 2])
    text, record = texts(dialog), saved(tmp_path)
    for words in ("3 of 3 right", "p = 0.125", str(tmp_path / "records")):
        assert words in text
    assert (record.seed, record.correct, record.complete) == (seed, 3, True)
    assert [trial.x for trial in record.trials] == list(order)
    assert (record.through["device"], record.through["rate_hz"]) == ("Headphones", RATE_HZ)
    assert (record.a.label, record.b.label) == ("Model", "Truth")
    assert (record.a.gain_db, record.b.gain_db) == pytest.approx((0, -3.52), abs=0.02)


def test_nothing_that_is_shown_depends_on_x(qtbot, open_dialog):
    """Two tests with another X: after the same keys the dialogs are the same, pixel by pixel, word by word."""
    seeds = [next(seed for seed in range(99) if "".join(draw_order(seed, 2)) == order) for order in ("AB", "BA")]
    seen: list[list[object]] = []
    for seed in seeds:
        dialog = open_dialog(seed, trials=2)
        start(dialog)
        seen.append([])
        for key in ("x", "a", "x", "b", "x", " ", "1", "x"):
            press(qtbot, dialog, key)
            words = [
                (each.objectName(), each.accessibleName(), each.accessibleDescription(), each.toolTip())
                for each in (dialog, *dialog.findChildren(QWidget))
            ]
            seen[-1].append((dialog.grab().toImage(), words, texts(dialog), dialog.windowTitle()))
        dialog.abandon()
    assert seen[0] == seen[1]
    assert seen[0][0] != seen[0][1]


def test_a_test_that_is_stopped_is_incomplete(qtbot, open_dialog, tmp_path):
    dialog = open_dialog()
    start(dialog)
    press(qtbot, dialog, "x", "1")
    for key in (Qt.Key.Key_Escape, Qt.Key.Key_Return, Qt.Key.Key_Space):
        with answered(key):
            press(qtbot, dialog, "esc")
        assert dialog.testing
    with answered("Stop the test"):
        press(qtbot, dialog, "esc")
    assert not dialog.testing
    assert dialog.isVisible()
    assert "no p-value can be given" in texts(dialog)
    assert "p =" not in texts(dialog)
    record = saved(tmp_path)
    assert (record.complete, record.p_value, len(record.trials)) == (False, None, 1)
    press(qtbot, dialog, "esc")
    assert not dialog.isVisible()


def test_a_vanished_device_ends_it(qtbot, open_dialog, sound, devices, tmp_path):
    dialog = open_dialog()
    start(dialog)
    press(qtbot, dialog, "x", "1", "x")
    devices.append(AudioDevice("Loudspeaker", "Test API", RATE_HZ))
    sound.open(devices[-1])
    qtbot.waitUntil(lambda: not dialog.testing)
    assert saved(tmp_path).remark == DEVICE_CHANGED
    assert saved(tmp_path).through["device"] == "Headphones"


@pytest.mark.parametrize(
    ("sounds", "message", "can_start"),
    [
        (dict.fromkeys(("model", "truth"), sounds_of()["truth"]), SAME, False),
        (sounds_of(900.0), TRIVIAL, True),
        (sounds_of(), "", True),
        (RuntimeError("the model's output diverges 0.1 s after the pluck"), "diverges", False),
    ],
    ids=["same", "trivial", "apart", "runs away"],
)
def test_sounds_are_waited_for_and_a_test_without_a_point_is_reported(qtbot, open_dialog, sounds, message, can_start):
    rendered: Future[Sounds] = Future()
    dialog = open_dialog(render=lambda rate_hz: rendered)
    qtbot.waitUntil(lambda: "still being rendered" in texts(dialog))
    assert not start_button(dialog).isEnabled()
    rendered.set_exception(sounds) if isinstance(sounds, Exception) else rendered.set_result(sounds)
    qtbot.waitUntil(lambda: message in texts(dialog) and "being rendered" not in texts(dialog))
    assert start_button(dialog).isEnabled() == can_start


def test_another_rate_is_rendered_again(qtbot, sound, devices, open_dialog):
    asked: list[int] = []
    dialog = open_dialog(render=lambda rate_hz: asked.append(rate_hz) or done(sounds_of()))
    for rate_hz, channels in ((44_100, 2), (44_100, 1)):
        devices.append(AudioDevice("Loudspeaker", "Test API", rate_hz, channels))
        sound.open(devices[-1])
        qtbot.waitUntil(lambda channels=channels: sound.mixer.channels == channels and sound.rate_hz == 44_100)
        qtbot.waitUntil(lambda: len(asked) == 2 and start_button(dialog).isEnabled())
    assert asked == [RATE_HZ, 44_100]


def test_a_record_that_cannot_be_written_is_reported_and_saved_elsewhere(qtbot, open_dialog, tmp_path, monkeypatch):
    (tmp_path / "records").write_text("in the way")
    dialog = open_dialog(trials=1)
    start(dialog)
    press(qtbot, dialog, "x", "1")
    assert "cannot be written" in texts(dialog)
    choose_files(monkeypatch, tmp_path / "other")
    named(dialog, "Save elsewhere …", QPushButton).click()
    assert len(list((tmp_path / "other").iterdir())) == 1
    assert "cannot be written" not in texts(dialog)
