"""Presets, scales and bodies: chosen in the browser, stepped through, dropped on the window."""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QPoint, QRect

from app.audio.sound import Sound
from app.instruments.library import find_instrument
from app.instruments.tuning import Tuning
from app.player.bodies import own_bodies
from app.rendering.note_sound import NoteSound
from app.views.controls.browser import Browser
from app.views.dialogs.learn_dialog import LearnDialog
from app.window.settings import FIRST_FAVOURITES, load_settings
from engine.effects import BODIES, Effects
from engine.pluck import Pluck
from engine.presets import preset_files
from engine.values.ear import Ear
from tests.app.conftest import no_device
from tests.app.sounds import export_sound
from tests.app.window.conftest import Open
from tests.app.window.driver import CONTROL, KEY, LEFT, Window

FIVE = "! five.scl\n!\nFive equal steps\n 5\n!\n" + "".join(f" {240 * n}.\n" for n in range(1, 6))
FIVE_KEYS, SEVEN_KEYS = (
    f"{n}\n0\n127\n60\n69\n440\n{n}\n" + "".join(f"{degree}\n" for degree in range(n)) for n in (5, 7)
)
GUITAR = find_instrument("Classical guitar").instrument


@pytest.fixture
def browser(lab: Window) -> Browser:
    """Open, with the keyboard in its search."""
    lab.wait(lab.window.isActiveWindow)
    lab.key(KEY.Key_P, CONTROL)
    found = lab.controller.presets.browser
    assert found.isVisible()
    found.search.setFocus()
    return found


def row_rect(browser: Browser, number: int) -> QRect:
    """The place of a listed row, with its star."""
    title = browser.list.index_of(browser.listed[number])
    return browser.list.visualRect(title.siblingAtColumn(0)).united(browser.list.visualRect(title))


def groups(browser: Browser) -> dict[str, int]:
    """The rows under each heading."""
    model = browser.list.model()
    lines = [browser.list.line(model.index(row, 0)) for row in range(model.rowCount())]
    rows = browser.list.rows
    return {line: sum(row.heading == line for row in rows) for line in lines if isinstance(line, str)}


def test_the_browser_is_worked_by_keys_while_the_window_plays(lab: Window, browser: Browser) -> None:
    search, played = browser.search, list[str]()
    browser.played.connect(played.append)
    for key, on, preset in (
        (KEY.Key_Down, search, "second"),
        (KEY.Key_Down, search, "second"),
        (KEY.Key_Up, browser.list, "first"),
    ):
        lab.key(key, on=on)
        assert lab.choices.preset == preset and browser.isVisible() and not lab.performance.playing
    lab.key(KEY.Key_X, on=browser.list)
    assert (lab.choices.heard, search.text()) == ("a", "x"), "keys of the window rest"
    search.clear()
    lab.key(KEY.Key_Space, on=search)
    assert browser.isVisible() and search.text() == ""
    lab.wait(lambda: lab.performance.playing)
    del played[:]
    for letter in "small sec":
        lab.key(letter, on=search)
    assert (search.text(), browser.listed, played) == ("small sec", ["second"], [])
    lab.key(KEY.Key_Down, on=search)
    lab.key(KEY.Key_Space, on=browser.list)
    lab.key(KEY.Key_Backspace, on=browser.list)
    assert (search.text(), search.hasFocus(), played) == ("small se", True, ["second"])
    browser.dismiss()
    lab.controller.presets.toggle()  # with the words of last time, to be typed over
    lab.key(KEY.Key_Space, on=search)
    assert (search.text(), len(played)) == ("small se", 2)
    lab.key(KEY.Key_Return, on=search)
    assert not browser.isVisible()


def test_a_search_shows_its_first_hit_loads_it_and_filters_the_steps(
    lab: Window, browser: Browser, preset_folder: Path, small_preset: Path
) -> None:
    bar, search = lab.window.presets, browser.search
    lab.qtbot.keyClicks(browser.list, "sec")
    assert (search.text(), browser.listed, lab.choices.preset) == ("sec", ["second"], "first")
    assert "File</td><td style='padding: 3px 0'>second, " in browser.card.text(), "the card is that of the hit"
    with lab.qtbot.waitSignal(browser.favourite_asked) as asked:
        lab.key(KEY.Key_D, CONTROL, on=browser.list)
    assert asked.args == ["second"] and lab.choices.preset == "first"
    lab.qtbot.mouseClick(browser.list.viewport(), LEFT, pos=row_rect(browser, 0).center())
    assert lab.choices.preset == "second"
    for words, marked in (("first", ["first"]), ("", ["second"]), ("zzz", []), ("", ["second"])):
        search.setText(words)
        rows = browser.list.selectionModel().selectedRows()
        assert [browser.list.line(row).name for row in rows] == marked
    lab.change(preset="first")
    search.setText("zzz")
    assert browser.listed == [] and "No matching preset" in browser.card.text() and bar.filtered.isVisible()
    lab.key(KEY.Key_Escape, on=search)
    assert not bar.filtered.isVisible(), "a search without a find ends with the browser"
    lab.controller.presets.toggle()
    search.setText("second")
    rates, models, strings = (browser.filters[name] for name in ("Rate", "Model", "String"))
    assert [strings.itemText(row) for row in range(strings.count())] == ["All strings", "With pitch glide"]
    rates.setCurrentIndex(rates.findData(4000))
    models.setCurrentIndex(models.findData("koopman_var"))
    lab.key(KEY.Key_Return, on=search)
    assert lab.choices.preset == "second" and bar.filtered.text() == "1 of 2  ✕"
    for _ in range(2):
        lab.key(KEY.Key_PageDown)
        assert lab.choices.preset == "second", "round in the filtered list"
    bar.filtered.click()
    assert not bar.filtered.isVisible() and (search.text(), rates.currentIndex()) == ("", 0)
    lab.key(KEY.Key_PageDown)
    assert lab.choices.preset == "first" and len(browser.listed) == 2
    search.setText("second")
    shutil.copy(small_preset, preset_folder / "third.safetensors")
    for _ in range(2):
        lab.controller.presets.toggle()
        assert browser.isHidden() or (search.text() == "" and "third" in browser.listed), "it was just added"


def test_studio_presets_and_favourites_come_first_and_favourites_are_kept(
    lab: Window, browser: Browser, preset_folder: Path, small_preset: Path, tmp_path: Path
) -> None:
    """The headings are passed over by arrows and page keys, which go through both groups in the listed order."""
    assert {path.stem for path in preset_files()} >= set(FIRST_FAVOURITES)
    shutil.copy(small_preset, preset_folder / "studio_zither.safetensors")
    browser.favourite_asked.emit("second")
    browser.dismiss()
    lab.controller.presets.toggle()
    assert groups(browser) == {"STUDIO PRESETS": 1, "RESEARCH PRESETS": 2}
    assert browser.listed == ["studio_zither", "second", "first"]
    for preset in ("second", "studio_zither", "studio_zither"):
        lab.key(KEY.Key_Up, on=browser.list)
        assert lab.choices.preset == preset
    heading = browser.list.visualRect(browser.list.model().index(2, 0)).center()
    lab.qtbot.mouseClick(browser.list.viewport(), LEFT, pos=heading)
    assert lab.choices.preset == "studio_zither"
    browser.starred.click()
    assert browser.listed == ["second"] and groups(browser) == {"RESEARCH PRESETS": 1}
    lab.qtbot.mouseClick(browser.list.viewport(), LEFT, pos=row_rect(browser, 0).topLeft() + QPoint(6, 6))
    assert browser.listed == []
    browser.clear_filter()
    browser.dismiss()
    assert browser.listed == ["studio_zither", "first", "second"]
    lab.change(preset="studio_zither")
    for preset in ("first", "second", "studio_zither"):
        lab.key(KEY.Key_PageDown)
        assert lab.choices.preset == preset
    lab.controller.presets.toggle()
    lab.key(KEY.Key_D, CONTROL, on=browser.search)
    assert "★" in lab.window.presets.name.text()
    lab.close()
    kept = load_settings(tmp_path / "settings.json")[0].favourites
    assert kept == tuple(sorted(("studio_zither", *FIRST_FAVOURITES)))


def test_dropped_presets_and_recipes_are_taken_in_and_bad_files_change_nothing(
    lab: Window, preset_folder: Path, small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, new = tmp_path / "own", tmp_path / "new.safetensors"
    own.mkdir()
    shutil.copy(small_preset, own / "mine.safetensors")
    (own / "bad.safetensors").write_bytes(b"?")
    lab.controller.presets.toggle()
    assert lab.controller.presets.browser.listed == ["first", "mine", "second"]
    assert "bad.safetensors" in lab.window.notices.text
    assert str(own) in lab.controller.presets.browser.state.text()
    new.write_bytes(small_preset.read_bytes().replace(b"A small string", b"Another string"))
    lab.drop(new)
    assert lab.choices.preset == "new" and lab.window.presets.name.text().startswith("Another string")
    assert (own / "new.safetensors").is_file()
    wav = tmp_path / "a.wav"
    first = preset_folder / "first.safetensors"
    export_sound(NoteSound(first, Pluck(0.5, 2.0), 0.6, Ear((0.3,))), wav, "truth")
    lab.drop(wav)
    choices = lab.choices
    assert (choices.pluck, choices.listen, choices.seconds) == (Pluck(0.5, 2.0), 0.3, 0.6)
    assert (choices.preset, choices.source_heard) == ("first", "truth")
    monkeypatch.setattr("app.window.dropped_files.restored_choices", lambda recipe: {"listen": 3})
    (tmp_path / "five.scl").write_text(FIVE)
    for file, words in (
        (wav, "its choices cannot be restored here (listen: "),
        (tmp_path / "foreign.txt", "not a file that is used here"),
        (tmp_path / "five.scl", "choose one first"),
    ):
        lab.drop(file)
        assert words in lab.window.notices.text and lab.choices == choices


def test_a_recipe_of_the_model_that_plays_the_instrument_leaves_the_instrument_and_its_pick_up(
    guitar: Window, tmp_path: Path
) -> None:
    """The instrument is heard in stereo, the recipe in mono; both are of the model of many strings."""
    guitar.change(pickup="displacement", stereo=True)
    before, entry = guitar.choices, guitar.performance.entry
    assert entry is not None and entry.name == before.instrument.preset
    export_sound(NoteSound(entry.path, Pluck(0.3, 2.0), 0.6, Ear((0.22,))), tmp_path / "a.wav")
    guitar.drop(tmp_path / "a.wav")
    choices = guitar.choices
    assert (choices.pluck.position, choices.listen, choices.stereo) == (0.3, 0.22, False)
    assert (choices.single, choices.instrument) == (entry.name, before.instrument)
    guitar.session.play_instrument()
    choices = guitar.choices
    assert (choices.stereo, choices.listen, choices.instrument) == (True, before.listen, before.instrument)


def test_scales_and_mappings_tune_the_instrument_in_either_order_and_undo_takes_them_back(
    guitar: Window, tmp_path: Path
) -> None:
    """A mapping joins a scale: alone its degrees would name steps of twelve equal ones in higher octaves."""

    def written(name: str, text: str) -> Path:
        (tmp_path / name).write_text(text)
        return tmp_path / name

    def cents(low: int, high: int) -> Any:
        tuning = Tuning(guitar.instrument.tuning)
        return pytest.approx(1200 * math.log2(tuning.hz(high) / tuning.hz(low)), abs=1e-3)

    before, history, name = guitar.instrument, guitar.session, guitar.instrument.name
    guitar.drop(written("Five.SCL", FIVE))
    assert cents(60, 61) == 240 and f"Five.SCL tunes {name}" in guitar.window.notices.text
    history.undo()
    assert guitar.instrument == before and cents(60, 61) == 100
    history.redo()
    assert cents(60, 61) == 240
    scale, keys, seven = written("5.scl", FIVE), written("5.kbm", FIVE_KEYS), written("7.kbm", SEVEN_KEYS)
    for files in ((scale, keys), (keys, scale), (seven, scale, keys)):
        guitar.drop(*files)
        assert (guitar.instrument.tuning.scale, guitar.instrument.tuning.keymap) == (FIVE, FIVE_KEYS)
        assert cents(60, 65) == 1200
        guitar.controller.instruments.revert()
    scale = written("31.scl", "31\n31\n" + "".join(f" {1200 * n / 31:.6f}\n" for n in range(1, 32)))
    degrees = "".join(f"{degree}\n" for degree in (0, 3, 5, 8, 10, 13, 16, 18, 21, 23, 26, 28))
    keys = written("31.kbm", f"12\n0\n127\n60\n69\n440\n31\n{degrees}")
    for files, joined in (((scale, keys), "31.kbm tunes {}, with the scale that it had"), ((keys, scale), "")):
        guitar.drop(*files)
        assert joined.format(name) in guitar.window.notices.text
        assert cents(60, 61) == 3 * 1200 / 31 and cents(60, 72) == 1200
        guitar.controller.instruments.revert()
    before = guitar.choices
    for bad, text in (
        ("empty.scl", ""),
        ("words.scl", "no tuning"),
        ("words.kbm", "no tuning"),
        ("missing.scl", None),
    ):
        guitar.drop(tmp_path / bad if text is None else written(bad, text))
        assert bad in guitar.window.notices.text and guitar.choices == before


def knock(path: Path, seconds: float = 0.05) -> Path:
    """A short noise that dies away, and was not exported here."""
    frames = int(seconds * 48_000)
    noise = np.random.default_rng(1).uniform(-0.5, 0.5, frames) * np.geomspace(1, 1e-3, frames)
    soundfile.write(path, noise, 48_000, "PCM_24")
    return path


def test_sounds_are_bodies_of_the_instrument_as_far_as_they_are_short(
    guitar: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, box, start = guitar.instrument, guitar.window.instrument.bar.body, guitar.choices
    for path in (knock(tmp_path / "long.wav", 61.0), knock(tmp_path / "long.flac", 61.0)):
        guitar.drop(path)
        words = f"{path}: lasts 61 s; cut out a note of at most 60 s, or a body's response"
        assert words in guitar.window.notices.text and guitar.choices == start and not own_bodies().exists()
    for ending in ("wav", "flac", "aiff"):
        file = knock(tmp_path / f"knock_{ending}.{ending}")
        guitar.drop(file)
        assert (own_bodies() / file.name).read_bytes() == file.read_bytes()
        assert [box.itemData(row) for row in range(len(BODIES) + 1)] == ["", *BODIES]
        assert box.currentData() == guitar.instrument.body.name == file.stem and guitar.instrument.body.mix > 0
        assert f"now has the body {file.stem}" in guitar.window.notices.text
        guitar.session.undo()
        assert guitar.instrument == before
    for ending in ("wav", "flac"):
        guitar.drop(knock(tmp_path / f"hall_{ending}.{ending}", 6.97))
        dialog = next(each for each in guitar.window.findChildren(LearnDialog) if each.isVisible())
        guitar.wait(dialog.body.isChecked)  # as long as a note: the dialog asks
        dialog.start.click()
        assert guitar.instrument.body.name == f"hall_{ending}"
        assert f"hall_{ending}.{ending} lasts 6.97 s: its first 3 s, faded out, are the body." in guitar.said


def test_a_body_that_comes_back_is_heard_again(opened: Open, tmp_path: Path) -> None:
    """The instrument names it all the time, so that nothing of it changes."""
    heard: list[Effects | None] = []

    class Noting(Sound):
        def set_effects(self, effects: Effects | None) -> None:
            heard.append(effects)
            super().set_effects(effects)

    def is_knock() -> bool:
        effects = heard[-1] if heard else None
        return effects is not None and effects.body is not None and effects.body.impulse is not None

    w = opened("studio_any_string", sound=lambda report: Noting(report, look_up=no_device), instrument=GUITAR)
    w.wait_for_keys()
    w.drop(knock(tmp_path / "knock.wav"))
    chosen = w.choices
    w.wait(is_knock)
    (own_bodies() / "knock.wav").unlink()
    w.performance.choices_changed(frozenset({"instrument"}))
    w.wait(lambda: not is_knock() and any("played without its body" in each for each in w.said))
    w.drop(tmp_path / "knock.wav")
    w.wait(is_knock)
    assert w.choices.instrument == chosen.instrument
