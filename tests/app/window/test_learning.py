"""A recording dropped on the window: string or body, learned, compared, kept and played; errors in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.instrument.bodies import own_bodies
from app.patches.library import own_patches
from app.views.dialogs.learn_dialog import NOT_FOUND, ON_KEYS, LearnDialog
from app.window.controller import Controller
from engine.presets import find_preset, read_info
from tests.app.questions import answered
from tests.training.recording.sounds import membrane
from tests.training.recording.synthetic import synthetic_note

LEARNED_MS = 90_000


@pytest.fixture(scope="session")
def note(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("note") / "Low string.wav"
    made = synthetic_note(2, seconds=1.0)
    soundfile.write(path, made.samples, made.rate_hz, "FLOAT")
    return path


def open_in(played: Controller) -> list[LearnDialog]:
    return [each for each in played.window.findChildren(LearnDialog) if each.isVisible()]


def dialog_of(qtbot: QtBot, played: Controller, file: Path) -> LearnDialog:
    """The dialog when it has examined the file."""
    played.take_file(file)
    (dialog,) = open_in(played)
    qtbot.waitUntil(lambda: dialog.string.isChecked() or dialog.body.isChecked(), timeout=LEARNED_MS)
    return dialog


def test_a_note_is_learned_compared_kept_and_played(qtbot: QtBot, played: Controller, note: Path) -> None:
    dialog = dialog_of(qtbot, played, note)
    assert dialog.string.isChecked()
    assert dialog.name.text() == "Low string"
    assert dialog.length_m.text() == dialog.gauge_mm.text() == "assumed"
    dialog.kind.setCurrentIndex(dialog.kind.findData("bass"))
    dialog.start.click()
    assert not dialog.start.isEnabled()
    qtbot.waitUntil(lambda: "Nothing is written yet" in dialog.state.text(), timeout=LEARNED_MS)
    assert "error-to-signal ratio 0.0" in dialog.report.toPlainText()
    assert dialog.state.text() == f"Nothing is written yet. {ON_KEYS}"
    assert not own_patches().exists()
    for heard, other in (("learned", "recording"), ("recording", "learned")):
        dialog.heard[heard].click()
        assert dialog.heard[heard].isChecked() and not dialog.heard[other].isChecked()
    for key in (Qt.Key.Key_Escape, Qt.Key.Key_Return):  # no key discards what took minutes
        for leave in (dialog.reject, lambda: played.take_file(note)):
            with answered(key) as asked:
                leave()
            assert asked == ["Discard the instrument?"]
            assert open_in(played) == [dialog]
    dialog.start.click()
    qtbot.waitUntil(lambda: not open_in(played), timeout=LEARNED_MS)
    patch = played.session.choices.patch
    assert patch is not None
    assert (patch.name, patch.category, patch.preset) == ("Low string", "bass", "low_string")
    assert (own_bodies() / "low_string.wav").exists()
    notice = played.window.notices.notices[-1]
    assert notice.message.startswith("low_string: learned.")
    assert not notice.error
    recorded = read_info(find_preset("low_string", [entry.path for entry in played.library.entries])).recorded
    assert recorded is not None
    assert recorded.errors["esr"] < 0.1
    qtbot.waitUntil(lambda: played.patches.entry is not None)
    notes = played.performance.notes
    qtbot.waitUntil(lambda: notes.keys.player is not None, timeout=LEARNED_MS)
    played.window.instrument.pressed.emit(43, 100, None)
    qtbot.waitUntil(lambda: notes.keys.sounding().get(43, 0.0) > 0.3, timeout=LEARNED_MS)


def test_what_is_no_note_is_a_body_or_learned_all_the_same(qtbot: QtBot, played: Controller, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).uniform(-0.5, 0.5, 24_000) * np.geomspace(1, 1e-3, 24_000)
    soundfile.write(tmp_path / "room.wav", noise, 48_000)
    dialog = dialog_of(qtbot, played, tmp_path / "room.wav")
    assert dialog.body.isChecked()
    assert "•" in dialog.state.text()
    dialog.string.setChecked(True)
    assert "although" in dialog.state.text()
    dialog.body.setChecked(True)
    dialog.start.click()
    assert not open_in(played)
    assert (own_bodies() / "room.wav").exists()
    assert "now has the body room" in played.window.notices.text


def test_where_no_string_is_found_keeping_is_no_default(qtbot: QtBot, played: Controller, tmp_path: Path) -> None:
    samples, rate_hz = membrane(np.random.default_rng(15))
    soundfile.write(tmp_path / "drum.wav", samples[:rate_hz], rate_hz, "FLOAT")
    dialog = dialog_of(qtbot, played, tmp_path / "drum.wav")
    dialog.string.setChecked(True)
    dialog.start.click()
    qtbot.waitUntil(lambda: "Nothing is written yet" in dialog.state.text(), timeout=LEARNED_MS)
    assert "no string found: " in dialog.report.toPlainText()
    assert dialog.state.text() == f"Nothing is written yet. {NOT_FOUND}"
    assert dialog.start.text() == "Keep all the same" and not dialog.start.isDefault()
    with answered("Discard"):
        dialog.reject()
    assert not own_patches().exists()


def test_what_is_only_unusual_is_a_warning(qtbot: QtBot, played: Controller, tmp_path: Path) -> None:
    made = synthetic_note(2, seconds=1.0)
    limit = np.sort(np.abs(made.samples))[-8]
    soundfile.write(tmp_path / "hot.wav", np.clip(made.samples, -limit, limit), made.rate_hz, "FLOAT")
    dialog = dialog_of(qtbot, played, tmp_path / "hot.wav")
    assert dialog.string.isChecked()
    assert "• it is clipped" in dialog.state.text() and "shows whether a string was found" in dialog.state.text()


def test_a_silent_recording_can_only_be_a_body(qtbot: QtBot, played: Controller, tmp_path: Path) -> None:
    soundfile.write(tmp_path / "silence.wav", np.zeros(48_000), 48_000)
    dialog = dialog_of(qtbot, played, tmp_path / "silence.wav")
    assert not dialog.string.isEnabled()
    assert "it is silent; check the cable" in dialog.state.text()
    dialog.start.click()
    assert "no impulse response" in played.window.notices.text


def test_a_name_that_is_taken_is_refused_and_the_learning_can_be_cancelled(
    qtbot: QtBot, played: Controller, note: Path
) -> None:
    dialog = dialog_of(qtbot, played, note)
    dialog.name.setText("studio any string")
    dialog.start.click()
    qtbot.waitUntil(lambda: "exists already" in dialog.state.text())
    dialog.name.setText("Mine")
    dialog.start.click()
    dialog.reject()
    qtbot.waitUntil(lambda: "Cancelled" in dialog.state.text(), timeout=LEARNED_MS)
    assert dialog.start.isEnabled()
    dialog.reject()
    assert not open_in(played)
    assert not own_patches().exists()
