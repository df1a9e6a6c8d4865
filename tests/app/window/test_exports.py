"""The export of a note in the window: what is chosen is in the file, and comes back with it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QMimeData, QPoint, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.export.recipe import read_recipe
from app.instrument.offline import render_note
from app.patches.library import find_patch
from app.window.controller import Controller
from engine.presets import find_string, load_preset, read_string
from engine.presets.finding import SHIPPED
from tests.app.window.shown import key_is_shown

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def short(controller: Controller, tmp_path: Path) -> Controller:
    """With a dialog that was last set to a short sound."""
    chosen = ExportChoices(folder=str(tmp_path), until_decayed=False, seconds=0.3, normalise=False)
    controller.exports._choices = chosen, controller.exports.choices[1]
    return controller


def export(qtbot: QtBot, controller: Controller, words: str) -> None:
    controller.exports.open("note")
    dialog = controller.exports.dialog
    assert dialog is not None
    dialog.save.click()
    qtbot.waitUntil(lambda: words in dialog.state.text())


def test_without_a_preset_it_says_so(short: Controller) -> None:
    short.session.update(preset="gone")
    short.window.transport.export.click()
    assert short.exports.dialog is None
    assert "There is no preset to export" in short.window.notices.text


def test_what_cannot_be_rendered_is_reported(qtbot: QtBot, short: Controller) -> None:
    entry = short.library.find("first")
    assert entry is not None
    qtbot.waitUntil(lambda: short.performance.at_hand)  # else the window itself would tell that the file is gone
    entry.path.unlink()
    export(qtbot, short, "first.safetensors")


def test_a_note_is_exported_through_the_instrument_that_is_heard(
    qtbot: QtBot, short: Controller, tmp_path: Path, preset_folder: Path
) -> None:
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder)
    short.library.refresh()
    guitar = find_patch("Classical guitar").patch
    short.session.update(instrument=guitar)
    qtbot.waitUntil(lambda: short.performance.notes.keys.player is not None)
    short.window.instrument.pressed.emit(60, 100, None)
    qtbot.waitUntil(lambda: key_is_shown(short))
    export(qtbot, short, "Saved")
    (file,) = tmp_path.glob("*.wav")
    assert file.name == "Classical guitar C4 hard.wav"
    struck = read_recipe(file).struck
    assert struck is not None and struck.instrument == guitar.name
    assert (struck.key, struck.velocity) == (60, 100)
    heard = render_note(guitar, load_preset(SHIPPED / "studio_any_string.safetensors"), 60, 100, 9.0, 0.3, 48_000)
    written = soundfile.read(file)[0]
    faded = round(0.02 * 48_000)  # at its end
    np.testing.assert_allclose(written[:-faded], heard[:-faded], atol=2.0**-22)
    short.session.update(preset="first")
    short.take_file(file)
    assert short.session.choices.instrument == guitar


def test_a_knob_that_was_turned_is_heard_in_the_file(
    qtbot: QtBot, short: Controller, tmp_path: Path, preset_folder: Path
) -> None:
    """Since the note was played."""
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder)
    short.library.refresh()
    short.session.update(instrument=find_patch("Classical guitar").patch)
    qtbot.waitUntil(lambda: short.performance.notes.keys.player is not None)
    short.window.instrument.pressed.emit(60, 100, None)
    qtbot.waitUntil(lambda: key_is_shown(short))
    patch = short.session.choices.patch
    assert patch is not None
    short.session.update(patch=patch.with_value("pluck.position", 0.4))
    export(qtbot, short, "Saved")
    (file,) = tmp_path.glob("*.wav")
    preset = load_preset(SHIPPED / "studio_any_string.safetensors")
    turned = render_note(patch.with_value("pluck.position", 0.4), preset, 60, 100, 9.0, 0.3, 48_000)
    np.testing.assert_allclose(soundfile.read(file)[0][:9_000], turned[:9_000], atol=2.0**-22)
    short.take_file(file)
    assert "instrument Classical guitar is not the one" in short.window.notices.text


def test_the_windows_own_files_are_not_dropped_on_it(qtbot: QtBot, controller: Controller, tmp_path: Path) -> None:
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(tmp_path / "a.wav"))])
    copy, none = Qt.DropAction.CopyAction, Qt.KeyboardModifier.NoModifier
    event = QDragEnterEvent(QPoint(5, 5), copy, mime, LEFT, none)
    event.ignore()
    ours = QDragEnterEvent(QPoint(5, 5), copy, mime, LEFT, none)
    ours.ignore()
    ours.source = lambda: controller.window.transport.export  # type: ignore[method-assign]
    controller.window.dragEnterEvent(event)
    controller.window.dragEnterEvent(ours)
    assert event.isAccepted() and not ours.isAccepted()


def test_the_string_that_is_chosen_is_what_is_exported_and_comes_back(
    qtbot: QtBot, short: Controller, tmp_path: Path, preset_folder: Path
) -> None:
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder)
    short.library.refresh()
    string = read_string(find_string("steel_g3"))
    short.session.update(
        preset="studio_any_string", string=string, amplitude_mm=0.05, shape="triangular", position=0.2
    )
    export(qtbot, short, "Saved")
    (file,) = tmp_path.glob("*.wav")
    assert file.name == "Any string G3 soft.wav"
    with soundfile.SoundFile(file) as sound:
        assert json.loads(sound.comment)["string"]["tension_n"] == string.tension_n
        samples, rate_hz = sound.read(), sound.samplerate
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples)), 2**18))
    peak_hz = spectrum[: round(300 / rate_hz * 2**18)].argmax() * rate_hz / 2**18
    assert peak_hz == pytest.approx(string.undamped_frequency(1) / (2 * np.pi), rel=2e-3)
    short.session.update(preset="first")
    assert short.session.choices.string is None
    short.take_file(file)
    assert (short.session.choices.preset, short.session.choices.string) == ("studio_any_string", string)
