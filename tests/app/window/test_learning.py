"""A recording dropped on the window: string or body, learned, compared, kept and played; errors in words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.instruments.library import own_instruments
from app.player.bodies import own_bodies
from app.views.dialogs.learn_dialog import ON_KEYS, LearnDialog
from engine.presets import find_preset, read_info
from tests.app.questions import answered
from tests.app.window.driver import KEY, Window
from tests.training.recording.synthetic import synthetic_note

UNWRITTEN = "Nothing is written yet. "
Sound = tuple[np.ndarray, int]


@pytest.fixture(scope="module")
def note(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("note") / "Low string.wav"
    made = synthetic_note(2, seconds=1.0)
    soundfile.write(path, made.samples, made.rate_hz, "FLOAT")
    return path


def dialogs(w: Window) -> list[LearnDialog]:
    return [each for each in w.window.findChildren(LearnDialog) if each.isVisible()]


def dialog_of(w: Window, file: Path) -> LearnDialog:
    """The dialog when it has examined the file."""
    w.drop(file)
    (dialog,) = dialogs(w)
    w.wait(lambda: dialog.string.isChecked() or dialog.body.isChecked())
    return dialog


def test_a_note_is_learned_compared_kept_and_played(guitar: Window, note: Path) -> None:
    dialog = dialog_of(guitar, note)
    assert dialog.string.isChecked() and dialog.name.text() == "Low string"
    assert dialog.length_m.text() == dialog.gauge_mm.text() == "assumed"
    dialog.kind.setCurrentIndex(dialog.kind.findData("bass"))
    dialog.start.click()
    assert not dialog.start.isEnabled()
    guitar.wait(lambda: dialog.state.text() == UNWRITTEN + ON_KEYS)
    assert "error-to-signal ratio 0.0" in dialog.report.toPlainText() and not own_instruments().exists()
    for heard, other in (("learned", "recording"), ("recording", "learned")):
        dialog.heard[heard].click()
        assert dialog.heard[heard].isChecked() and not dialog.heard[other].isChecked()
        guitar.wait(lambda: guitar.controller.sound.mixer.active > 0)
    for key in (KEY.Key_Escape, KEY.Key_Return):  # no key discards what took minutes
        for leave in (dialog.reject, lambda: guitar.controller.take_file(note)):
            with answered(key) as asked:
                leave()
            assert asked == ["Discard the instrument?"] and dialogs(guitar) == [dialog]
    dialog.start.click()
    guitar.wait(lambda: not dialogs(guitar))
    instrument = guitar.instrument
    assert (instrument.name, instrument.category, instrument.preset) == ("Low string", "bass", "low_string")
    assert (own_bodies() / "low_string.wav").exists()
    notice = guitar.window.notices.notices[-1]
    assert notice.message.startswith("low_string: learned.") and not notice.error
    recorded = read_info(
        find_preset("low_string", [each.path for each in guitar.controller.library.entries])
    ).recorded
    assert recorded is not None and recorded.errors["esr"] < 0.1
    guitar.wait_for_keys()
    guitar.play(43, hold=True)
    guitar.wait(lambda: guitar.keys.sounding().get(43, 0.0) > 0.3)


def noise() -> Sound:
    return np.random.default_rng(1).uniform(-0.5, 0.5, 24_000) * np.geomspace(1, 1e-3, 24_000), 48_000


def silence() -> Sound:
    return np.zeros(48_000), 48_000


def hot() -> Sound:
    made = synthetic_note(2, seconds=1.0)
    limit = np.sort(np.abs(made.samples))[-8]
    return np.clip(made.samples, -limit, limit), made.rate_hz


@pytest.mark.parametrize(
    ("sound", "is_string", "words", "notice"),
    [
        (noise, False, "•", "now has the body sound"),
        (silence, None, "it is silent; check the cable", "no impulse response"),
        (hot, True, "• it is clipped", ""),
    ],
)
def test_the_dialog_says_what_a_sound_is_and_that_is_done_all_the_same(
    guitar: Window, tmp_path: Path, sound: Callable[[], Sound], is_string: bool | None, words: str, notice: str
) -> None:
    """What is only unusual is a warning; a silent recording can only be a body."""
    samples, rate_hz = sound()
    soundfile.write(tmp_path / "sound.wav", samples, rate_hz, "FLOAT")
    dialog = dialog_of(guitar, tmp_path / "sound.wav")
    assert (dialog.string.isChecked(), dialog.string.isEnabled()) == (bool(is_string), is_string is not None)
    assert words in dialog.state.text()
    if is_string:
        assert "shows whether a string was found" in dialog.state.text()
        return
    if is_string is not None:
        dialog.string.setChecked(True)
        assert "although" in dialog.state.text()
        dialog.body.setChecked(True)
    dialog.start.click()
    assert notice in guitar.window.notices.text and not dialogs(guitar)
    assert (own_bodies() / "sound.wav").exists() == (is_string is not None)


def test_a_name_that_is_taken_is_refused_and_the_learning_can_be_cancelled(guitar: Window, note: Path) -> None:
    dialog = dialog_of(guitar, note)
    dialog.name.setText("studio any string")
    dialog.start.click()
    guitar.wait(lambda: "exists already" in dialog.state.text())
    dialog.name.setText("Mine")
    dialog.start.click()
    dialog.reject()
    guitar.wait(lambda: "Cancelled" in dialog.state.text())
    assert dialog.start.isEnabled()
    dialog.reject()
    assert not dialogs(guitar) and not own_instruments().exists()
