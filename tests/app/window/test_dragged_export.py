"""A drag from the export button: the file is the dialog's, told where it cannot be made, and gone at the end."""

from __future__ import annotations

import json
import shutil
from itertools import count
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QMimeData, QPoint, Qt, QUrl
from PySide6.QtGui import QDrag, QDragEnterEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.patches.patch import PhysicalString
from app.window.controller import Controller
from engine.presets import find_string, read_string
from engine.presets.finding import SHIPPED

LEFT = Qt.MouseButton.LeftButton
FAR = QPoint(90, 8)
SHORT = {"until_decayed": False, "seconds": 0.3}


@pytest.fixture
def dropped(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    found: list[Path] = []
    monkeypatch.setattr(
        QDrag, "exec", lambda drag, actions: found.extend(Path(url.toLocalFile()) for url in drag.mimeData().urls())
    )
    return found


@pytest.fixture
def short(controller: Controller) -> Controller:
    set_to(controller, **SHORT)
    return controller


def set_to(controller: Controller, **export: object) -> None:
    """As the export dialog would have been set last."""
    before, sampled = controller.exports.choices
    controller.exports._choices = ExportChoices.model_validate({**before.model_dump(), **export}), sampled


def drag(qtbot: QtBot, controller: Controller, until: str = "rendered") -> None:
    """From the button, let go once the files are taken, or a notice is told."""
    button = controller.window.transport.export
    ended: list[None] = []
    button.drag_ended.connect(lambda: ended.append(None))
    qtbot.mousePress(button, LEFT, pos=QPoint(10, 8))

    steps = count()

    def moved() -> bool:
        qtbot.mouseMove(button, FAR + QPoint(next(steps) % 2, 0))
        return bool(ended) if until == "rendered" else until in controller.window.notices.text

    qtbot.waitUntil(moved)
    qtbot.mouseRelease(button, LEFT, pos=FAR)
    assert QApplication.overrideCursor() is None


@pytest.mark.parametrize("export", [{}, {"source": "files", "bits": "32f"}, {"source": "both", "rate_hz": 0}])
def test_it_is_what_the_dialog_writes(
    qtbot: QtBot, short: Controller, dropped: list[Path], tmp_path: Path, export: dict[str, object]
) -> None:
    set_to(short, folder=str(tmp_path), **export)
    drag(qtbot, short)
    short.exports.open("note")
    dialog = short.exports.dialog
    assert dialog is not None
    dialog.save.click()
    qtbot.waitUntil(lambda: "Saved" in dialog.state.text())
    written = list(dialog.note.paths().values())
    assert [path.name for path in dropped] == [path.name for path in written]
    assert [path.read_bytes() for path in dropped] == [path.read_bytes() for path in written]


def test_the_same_choices_are_rendered_once_and_others_replace_no_file(
    qtbot: QtBot, short: Controller, dropped: list[Path]
) -> None:
    drag(qtbot, short)
    drag(qtbot, short)
    short.session.update(listen=0.11)
    drag(qtbot, short)
    first, again, other = dropped
    assert first == again and first.name == other.name and first != other
    assert first.read_bytes() != other.read_bytes()
    folder = first.parents[1]
    short.close()
    assert not folder.exists()


def test_what_cannot_be_rendered_is_told(qtbot: QtBot, short: Controller, dropped: list[Path]) -> None:
    entry = short.library.find("first")
    assert entry is not None
    qtbot.waitUntil(lambda: short.performance.at_hand)  # else the window itself would tell that the file is gone
    entry.path.unlink()
    drag(qtbot, short, until="first.safetensors")
    assert dropped == []


def test_who_lets_go_early_ends_the_rendering(qtbot: QtBot, short: Controller, dropped: list[Path]) -> None:
    set_to(short, seconds=600.0)
    button = short.window.transport.export
    qtbot.mousePress(button, LEFT, pos=QPoint(10, 8))
    qtbot.mouseMove(button, FAR)
    cursor = QApplication.overrideCursor()
    assert cursor is not None and cursor.shape() == Qt.CursorShape.WaitCursor
    qtbot.mouseRelease(button, LEFT, pos=FAR)
    assert QApplication.overrideCursor() is None
    assert dropped == []


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
    qtbot: QtBot, short: Controller, dropped: list[Path], tmp_path: Path, preset_folder: Path
) -> None:
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder)
    short.library.refresh()
    string = PhysicalString.model_validate(vars(read_string(find_string("steel_g3"))))
    short.session.update(
        preset="studio_any_string", string=string, amplitude_mm=0.05, shape="triangular", position=0.2
    )
    drag(qtbot, short)
    (file,) = dropped
    assert "studio_any_string_196." in file.name
    with soundfile.SoundFile(file) as sound:
        assert json.loads(sound.comment)["string"]["tension_n"] == string.tension_n
        samples, rate_hz = sound.read(), sound.samplerate
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples)), 2**18))
    peak_hz = spectrum[: round(300 / rate_hz * 2**18)].argmax() * rate_hz / 2**18
    assert peak_hz == pytest.approx(string.parameters.undamped_frequency(1) / (2 * np.pi), rel=2e-3)
    short.session.update(preset="first")
    assert short.session.choices.string is None
    short.take_file(file)
    assert (short.session.choices.preset, short.session.choices.string) == ("studio_any_string", string)
