"""Presets, scales and bodies: chosen in the browser, stepped through, dropped on the window."""

import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from PySide6.QtCore import QRect

from app.audio.sound import Sound
from app.instruments.library import own_instruments
from app.instruments.tuning import Tuning
from app.player.bodies import own_bodies
from app.rendering.note_sound import NoteSound
from app.views.controls.browser import Browser
from app.views.dialogs.learn_dialog import ON_KEYS, LearnDialog
from app.window.settings import FIRST_FAVOURITES, load_settings
from engine.effects import BODIES
from engine.pluck import Pluck
from engine.presets import preset_files
from engine.values.ear import Ear
from tests.app.questions import answered
from tests.app.sounds import export_sound
from tests.app.window.driver import CONTROL, KEY, LEFT, Window
from tests.training.recording.synthetic import synthetic_note

FIVE = "! five.scl\n!\nFive equal steps\n 5\n!\n" + "".join(f" {240 * n}.\n" for n in range(1, 6))
FIVE_KEYS, SEVEN_KEYS = (
    f"{n}\n0\n127\n60\n69\n440\n{n}\n" + "".join(f"{degree}\n" for degree in range(n)) for n in (5, 7)
)


@pytest.fixture
def browser(lab) -> Browser:
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


def test_a_search_filters_the_steps(lab, browser):
    bar, search = lab.window.presets, browser.search
    lab.key(KEY.Key_Space, on=search)
    lab.wait(lambda: lab.performance.playing)
    lab.qtbot.keyClicks(browser.list, "sec")
    assert (search.text(), browser.listed, lab.choices.preset) == ("sec", ["second"], "first")
    lab.qtbot.mouseClick(browser.list.viewport(), LEFT, pos=row_rect(browser, 0).center())
    assert lab.choices.preset == "second"
    search.setText("second")
    rates, models = browser.filters["Rate"], browser.filters["Model"]
    rates.setCurrentIndex(rates.findData(4000))
    models.setCurrentIndex(models.findData("koopman_var"))
    lab.key(KEY.Key_Return, on=search)
    assert lab.choices.preset == "second" and bar.filtered.text() == "1 of 2  ✕" and not browser.isVisible()
    lab.key(KEY.Key_PageDown)
    assert lab.choices.preset == "second", "round in the filtered list"
    bar.filtered.click()
    assert not bar.filtered.isVisible() and (search.text(), rates.currentIndex()) == ("", 0)
    lab.key(KEY.Key_PageDown)
    assert lab.choices.preset == "first" and len(browser.listed) == 2


def test_favourites_come_first(lab, browser, preset_folder, small_preset, tmp_path):
    """The headings are passed over by page keys, which go through both groups in the listed order."""
    assert {path.stem for path in preset_files()} >= set(FIRST_FAVOURITES)
    shutil.copy(small_preset, preset_folder / "studio_zither.safetensors")
    browser.favourite_asked.emit("second")
    browser.dismiss()
    lab.controller.presets.toggle()
    assert [row.heading for row in browser.list.rows] == ["STUDIO PRESETS", *2 * ["RESEARCH PRESETS"]]
    assert browser.listed == ["studio_zither", "second", "first"]
    browser.dismiss()
    lab.change(preset="studio_zither")
    for preset in ("second", "first", "studio_zither"):
        lab.key(KEY.Key_PageDown)
        assert lab.choices.preset == preset
    lab.controller.presets.toggle()
    lab.key(KEY.Key_D, CONTROL, on=browser.search)
    assert "★" in lab.window.presets.name.text()
    lab.close()
    kept = load_settings(tmp_path / "settings.json")[0].favourites
    assert kept == tuple(sorted(("second", "studio_zither", *FIRST_FAVOURITES)))


def test_dropped_presets_and_recipes_are_taken_in_and_bad_files_change_nothing(
    lab, preset_folder, small_preset, tmp_path, monkeypatch
):
    own, new, wav = tmp_path / "own", tmp_path / "new.safetensors", tmp_path / "a.wav"
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
    export_sound(NoteSound(preset_folder / "first.safetensors", Pluck(0.5, 2.0), 0.6, Ear((0.3,))), wav, "truth")
    lab.drop(wav)
    choices = lab.choices
    assert (choices.pluck, choices.listen, choices.seconds) == (Pluck(0.5, 2.0), 0.3, 0.6)
    assert (choices.preset, choices.source_heard) == ("first", "truth")
    monkeypatch.setattr("app.window.dropped_files.restored_choices", lambda recipe: {"listen": 3})
    (tmp_path / "five.scl").write_text(FIVE)
    for file, words in (
        (wav, "its choices cannot be restored here (listen must"),
        (tmp_path / "foreign.txt", "not a file that is used here"),
        (tmp_path / "five.scl", "choose one first"),
    ):
        lab.drop(file)
        assert words in lab.window.notices.text and lab.choices == choices


def test_scales_and_mappings_tune_the_instrument_in_either_order(guitar, tmp_path):
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
    scale, keys, seven = written("5.scl", FIVE), written("5.kbm", FIVE_KEYS), written("7.kbm", SEVEN_KEYS)
    for files in ((scale, keys), (keys, scale), (seven, scale, keys)):
        guitar.drop(*files)
        assert (guitar.instrument.tuning.scale, guitar.instrument.tuning.keymap) == (FIVE, FIVE_KEYS)
        assert cents(60, 65) == 1200
        joined = f"5.kbm tunes {name}, with the scale that it had" in guitar.window.notices.text
        assert joined == (files[-1] == keys)
        guitar.controller.instruments.revert()
    before_all = guitar.choices
    for bad, text in (("empty.scl", ""), ("words.kbm", "no tuning"), ("missing.scl", None)):
        guitar.drop(tmp_path / bad if text is None else written(bad, text))
        assert bad in guitar.window.notices.text and guitar.choices == before_all


def knock(path: Path, seconds: float = 0.05) -> Path:
    """A short noise that dies away, and was not exported here."""
    frames = int(seconds * 48_000)
    noise = np.random.default_rng(1).uniform(-0.5, 0.5, frames) * np.geomspace(1, 1e-3, frames)
    soundfile.write(path, noise, 48_000, "PCM_24")
    return path


@pytest.fixture
def effects(monkeypatch) -> list[Any]:
    """What windows that are opened afterwards are heard through, the latest last."""
    heard, set_effects = list[Any](), Sound.set_effects
    noted = lambda sound, effects: heard.append(effects) or set_effects(sound, effects)  # noqa: E731
    monkeypatch.setattr(Sound, "set_effects", noted)
    return heard


def test_short_sounds_are_bodies(effects, guitar, tmp_path):
    """One that comes back is heard again, though the instrument names it all the time."""
    before, box, start = guitar.instrument, guitar.window.instrument.bar.body, guitar.choices

    def is_heard() -> bool:
        body = effects[-1].body if effects[-1] is not None else None
        return body is not None and body.impulse is not None

    guitar.drop(knock(tmp_path / "long.wav", 61.0))
    words = f"{tmp_path / 'long.wav'}: lasts 61 s; cut out a note of at most 60 s, or a body's response"
    assert words in guitar.window.notices.text and guitar.choices == start and not own_bodies().exists()
    for ending in ("wav", "flac", "aiff"):
        if guitar.instrument != before:
            guitar.session.undo()
        assert guitar.instrument == before
        file = knock(tmp_path / f"knock_{ending}.{ending}")
        guitar.drop(file)
        assert (own_bodies() / file.name).read_bytes() == file.read_bytes()
        assert [box.itemData(row) for row in range(len(BODIES) + 1)] == ["", *BODIES]
        assert box.currentData() == guitar.instrument.body.name == file.stem and guitar.instrument.body.mix > 0
        assert f"now has the body {file.stem}" in guitar.window.notices.text
    guitar.wait(is_heard)
    chosen = guitar.instrument
    (own_bodies() / file.name).unlink()
    guitar.performance.choices_changed(frozenset({"instrument"}))
    guitar.wait(lambda: not is_heard() and any("played without its body" in each for each in guitar.said))
    guitar.drop(file)
    guitar.wait(is_heard)
    assert guitar.instrument == chosen
    guitar.drop(knock(tmp_path / "hall.flac", 6.97))
    dialog = next(each for each in guitar.window.findChildren(LearnDialog) if each.isVisible())
    guitar.wait(dialog.body.isChecked)  # as long as a note: the dialog asks
    dialog.start.click()
    assert guitar.instrument.body.name == "hall"
    assert "hall.flac lasts 6.97 s: its first 3 s, faded out, are the body." in guitar.said


UNWRITTEN = "Nothing is written yet. "
Samples = tuple[np.ndarray, int]


@pytest.fixture(scope="module")
def note(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("note") / "Low string.wav"
    made = synthetic_note(2, seconds=0.6, highest_hz=600.0)
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


def test_a_note_is_learned_compared_kept_and_played(guitar, note):
    dialog = dialog_of(guitar, note)
    assert dialog.string.isChecked() and dialog.name.text() == "Low string"
    assert dialog.length_m.text() == dialog.gauge_mm.text() == "assumed"
    dialog.name.setText("studio any string")
    dialog.start.click()
    guitar.wait(lambda: "exists already" in dialog.state.text())
    dialog.name.setText("Low string")
    dialog.start.click()
    dialog.reject()
    guitar.wait(lambda: "Cancelled" in dialog.state.text())
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
    entry = guitar.controller.library.find("low_string")
    assert entry is not None and entry.info.recorded is not None and entry.info.recorded.errors["esr"] < 0.1
    guitar.wait_for_keys()
    guitar.play(43, hold=True)
    guitar.wait(lambda: guitar.keys.sounding().get(43, 0.0) > 0.3)
