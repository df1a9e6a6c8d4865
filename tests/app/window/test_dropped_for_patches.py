"""Files dropped for the patch that keys play: scales and mappings tune it, sounds are its body; undo goes back."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent
from pytestqt.qtbot import QtBot

from app.export.files import export_sound
from app.export.sound import SoundRequest
from app.instrument.bodies import own_bodies
from app.patches.instrument import SingleString
from app.patches.tuning import Tuning
from app.window.controller import Controller
from engine.effects import BODIES, Effects
from engine.pluck import Pluck
from engine.presets import load_preset

FIVE = "! five.scl\n!\nFive equal steps\n 5\n!\n" + "".join(f" {240 * n}.\n" for n in range(1, 6))
FIVE_KEYS = "5\n0\n127\n60\n69\n440\n5\n" + "".join(f"{n}\n" for n in range(5))
SEVEN_KEYS = "7\n0\n127\n60\n69\n440\n7\n" + "".join(f"{n}\n" for n in range(7))


@pytest.fixture
def patched(qtbot: QtBot, controller: Controller) -> Controller:
    """A window in which keys play a patch, whose own string is shown."""
    controller.patches.choose("classical_guitar")
    assert controller.patches.patch is not None
    qtbot.waitUntil(lambda: controller.session.choices.string is not None)
    return controller


def drop(controller: Controller, *files: Path) -> None:
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(file)) for file in files])
    copy, left, none = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    controller.window.dropEvent(QDropEvent(QPointF(5, 5), copy, mime, left, none))


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def cents(controller: Controller, low: int, high: int) -> float:
    patch = controller.patches.patch
    assert patch is not None
    tuning = Tuning(patch.tuning)
    return 1200 * math.log2(tuning.hz(high) / tuning.hz(low))


def test_a_dropped_scale_tunes_the_patch_and_undo_takes_it_back(patched: Controller, tmp_path: Path) -> None:
    before = patched.patches.patch
    drop(patched, written(tmp_path / "Five.SCL", FIVE))
    assert cents(patched, 60, 61) == pytest.approx(240)
    assert "Five.SCL tunes Classical guitar" in patched.window.notices.text
    patched.history.undo()
    assert patched.patches.patch == before
    assert cents(patched, 60, 61) == pytest.approx(100)
    patched.history.redo()
    assert cents(patched, 60, 61) == pytest.approx(240)


def test_a_scale_and_its_mapping_together_in_either_order(patched: Controller, tmp_path: Path) -> None:
    scale, keys = written(tmp_path / "five.scl", FIVE), written(tmp_path / "five.kbm", FIVE_KEYS)
    seven = written(tmp_path / "seven.kbm", SEVEN_KEYS)
    for files in ((scale, keys), (keys, scale), (seven, scale, keys)):
        drop(patched, *files)
        patch = patched.patches.patch
        assert patch is not None
        assert (patch.tuning.scale, patch.tuning.keymap) == (FIVE, FIVE_KEYS)
        assert cents(patched, 60, 65) == pytest.approx(1200)
        patched.patches.revert()


def test_a_mapping_joins_the_scale_that_is_loaded(patched: Controller, tmp_path: Path) -> None:
    """Its degrees go beyond twelve: alone it would name steps that twelve equal ones have in higher octaves."""
    scale = written(tmp_path / "31.scl", "31\n31\n" + "".join(f" {1200 * n / 31:.6f}\n" for n in range(1, 32)))
    degrees = "".join(f"{degree}\n" for degree in (0, 3, 5, 8, 10, 13, 16, 18, 21, 23, 26, 28))
    keys = written(tmp_path / "31.kbm", f"12\n0\n127\n60\n69\n440\n31\n{degrees}")
    drop(patched, scale, keys)
    assert "31.kbm tunes Classical guitar, with the scale that it had" in patched.window.notices.text
    assert cents(patched, 60, 61) == pytest.approx(3 * 1200 / 31, abs=1e-3)
    assert cents(patched, 60, 72) == pytest.approx(1200)
    patched.patches.revert()
    drop(patched, keys, scale)
    assert cents(patched, 60, 61) == pytest.approx(3 * 1200 / 31, abs=1e-3)


@pytest.mark.parametrize("name", ["empty.scl", "words.scl", "words.kbm", "missing.scl"])
def test_a_file_that_is_no_tuning_is_reported_and_changes_nothing(
    patched: Controller, tmp_path: Path, name: str
) -> None:
    before = patched.session.choices
    if name != "missing.scl":
        written(tmp_path / name, "no tuning" if "words" in name else "")
    drop(patched, tmp_path / name)
    assert name in patched.window.notices.text
    assert patched.session.choices == before


def test_without_a_patch_a_scale_is_reported_what_it_needs(controller: Controller, tmp_path: Path) -> None:
    drop(controller, written(tmp_path / "five.scl", FIVE))
    assert controller.patches.patch is None
    assert "choose one first" in controller.window.notices.text


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    return tmp_path / "own"


def knock(path: Path, seconds: float = 0.05) -> Path:
    """A short noise that dies away, and was not exported here."""
    frames = int(seconds * 48_000)
    noise = np.random.default_rng(1).uniform(-0.5, 0.5, frames) * np.geomspace(1, 1e-3, frames)
    soundfile.write(path, noise, 48_000, "PCM_24")
    return path


def bodies(controller: Controller) -> list[str]:
    box = controller.window.instrument.bar.body
    return [box.itemData(row) for row in range(box.count())]


@pytest.mark.parametrize("name", ["knock.wav", "knock.flac", "knock.aiff"])
def test_a_dropped_sound_without_a_recipe_is_a_body_and_the_patch_stands_on_it(
    own_folder: Path, patched: Controller, tmp_path: Path, name: str
) -> None:
    before = patched.patches.patch
    assert before is not None
    assert bodies(patched) == ["", *BODIES]
    drop(patched, knock(tmp_path / name))
    assert (own_bodies() / name).read_bytes() == (tmp_path / name).read_bytes()
    assert bodies(patched) == ["", *BODIES, "knock"]
    assert patched.window.instrument.bar.body.currentData() == "knock"
    patch = patched.patches.patch
    assert patch is not None
    assert patch.body.name == "knock" and patch.body.mix > 0
    assert "now has the body knock" in patched.window.notices.text
    patched.history.undo()
    assert patched.patches.patch == before


def test_a_sound_longer_than_a_note_or_body_is_refused_with_what_to_cut_out(
    own_folder: Path, patched: Controller, tmp_path: Path
) -> None:
    before = patched.session.choices
    for path in (knock(tmp_path / "long.wav", seconds=61.0), knock(tmp_path / "long.flac", seconds=61.0)):
        drop(patched, path)
        assert (
            f"{path}: lasts 61 s; cut out a note of at most 60 s, or a body's response" in patched.window.notices.text
        )
    assert patched.session.choices == before
    assert not own_bodies().exists()


def test_a_body_that_comes_back_is_heard_again(
    qtbot: QtBot, own_folder: Path, patched: Controller, tmp_path: Path
) -> None:
    """The patch names it all the time, so that nothing of it changes."""
    heard: list[Effects | None] = []
    reported: list[str] = []

    def is_knock() -> bool:
        """The last body is a sound; the guitar's, which the patch begins with, may come late and has none."""
        return (
            bool(heard)
            and heard[-1] is not None
            and heard[-1].body is not None
            and heard[-1].body.impulse is not None
        )

    patched.performance.notes.keys._set_effects = heard.append
    patched.performance.notes.keys._report = lambda message, details: reported.append(message)
    drop(patched, knock(tmp_path / "knock.wav"))
    chosen = patched.session.choices
    qtbot.waitUntil(is_knock)
    (own_bodies() / "knock.wav").unlink()
    patched.performance.choices_changed(frozenset({"patch"}))
    qtbot.waitUntil(lambda: heard[-1] is None or heard[-1].body is None)
    qtbot.waitUntil(lambda: any("played without its body" in line for line in reported))
    drop(patched, tmp_path / "knock.wav")
    qtbot.waitUntil(is_knock)
    assert patched.session.choices == chosen


def test_a_recipe_of_the_model_that_plays_the_patch_leaves_the_patch_and_its_pick_up(
    played: Controller, tmp_path: Path
) -> None:
    """The patch is heard in stereo, the recipe in mono; both are of the model of many strings."""
    played.session.update(pickup="displacement", stereo=True)
    before, entry = played.session.choices, played.entry
    assert before.patch is not None and before.plays_patch and before.stereo and entry is not None
    assert entry.name == before.patch.preset
    export_sound(SoundRequest(load_preset(entry.path), Pluck(0.3, 2.0), 0.22, 0.6), tmp_path / "a.wav")
    drop(played, tmp_path / "a.wav")
    choices = played.session.choices
    assert (choices.pluck.position, choices.listen, choices.stereo) == (0.3, 0.22, False)
    assert (choices.instrument, choices.patch) == (SingleString(preset=entry.name), before.patch)
    played.session.play_patch()
    choices = played.session.choices
    assert (choices.stereo, choices.listen, choices.patch) == (True, before.listen, before.patch)


@pytest.mark.parametrize("ending", ["wav", "flac"])
def test_a_long_body_is_taken_and_the_notice_says_how_much_of_it(
    qtbot: QtBot, patched: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    path = tmp_path / f"hall.{ending}"
    noise = 0.3 * np.random.default_rng(0).uniform(-1, 1, round(6.97 * 48_000))
    soundfile.write(path, noise * np.geomspace(1, 1e-3, len(noise)), 48_000, "PCM_24")
    drop(patched, path)
    dialog = patched._learning  # as long as a note: the dialog asks
    assert dialog is not None
    qtbot.waitUntil(dialog.body.isChecked)
    dialog.start.click()
    assert patched.patches.patch is not None
    assert patched.patches.patch.body.name == "hall"
    assert f"hall.{ending} lasts 6.97 s: its first 3 s, faded out, are the body." in patched.window.notices.text
