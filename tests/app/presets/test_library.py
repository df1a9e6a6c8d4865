"""The library and what comes into it: refreshing, searching, installing, dropped files, and figures in words."""

import math
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.instruments.instrument import Pickup
from app.player.bodies import body_names
from app.presets.install import install_preset
from app.presets.library import Library, PresetEntry, list_presets
from app.presets.words import judged, percent
from app.rendering.note_sound import NoteSound
from app.views.controls.browser_rows import listed_rows
from app.views.dialogs.preset_card import preset_row
from app.window.dropped_files import Dropped, receive
from engine.pluck import Pluck
from engine.presets import SHIPPED, PresetError, preset_digest
from engine.values.ear import Ear
from tests.app.gestures import reported
from tests.app.sounds import export_sound
from training.heard_file import COLUMNS, NAME, Heard, add_heard


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder, not made yet."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    return tmp_path / "own"


@pytest.fixture
def library(preset_folder: Path, own: Path) -> Library:
    made = Library([])
    made.refresh()
    return made


def other_preset(small_preset: Path, path: Path, title: bytes = b"Another string") -> Path:
    """A preset of the same form with other bytes."""
    path.write_bytes(small_preset.read_bytes().replace(b"A small string", title))
    return path


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_refresh_reports_only_when_there_are_others(library, small_preset, own):
    seen = reported(library.changed)
    assert (library.refresh(), library.names, seen) == ([], ["first", "second"], [])
    own.mkdir()
    for name in ("mine", "first"):
        shutil.copy(small_preset, own / f"{name}.safetensors")
    (problem,) = library.refresh()
    assert "first.safetensors: a preset of this name exists already" in problem
    assert library.refresh() == []  # it has been reported
    assert (library.names, len(seen)) == (["first", "mine", "second"], 1)
    mine, first = library.find("mine"), library.find("first")
    assert mine is not None and first is not None
    assert [mine.title, mine.info.title] == [f"{first.title} (yours)", first.title]
    assert (mine.path, mine.size_bytes) == (own / "mine.safetensors", small_preset.stat().st_size)


def test_a_preset_of_a_taken_name_gets_a_number(library, small_preset, own, tmp_path):
    given = other_preset(small_preset, tmp_path / "first.safetensors")
    present, bad = [entry.path for entry in library.entries], tmp_path / "bad.safetensors"
    for data in (b"", b"no preset", small_preset.read_bytes()[:-9]):
        bad.write_bytes(data)
        with pytest.raises(PresetError, match=r"bad\.safetensors: not a whole safetensors file"):
            install_preset(bad, own, [])
    assert not own.exists()
    path, was_there = install_preset(given, own, present)
    assert (path.name, was_there, path.read_bytes()) == ("first_2.safetensors", False, given.read_bytes())
    assert install_preset(given, own, [*present, path]) == (path, True)
    assert install_preset(small_preset, own, present)[1]
    assert files(own) == ["first_2.safetensors"]
    dropped = receive(small_preset, library)
    assert dropped.choices == {"preset": "first"} and "is the factory preset “A small string" in dropped.notice


@pytest.mark.parametrize("ending", ["WAV", "FLAC"])
def test_an_export_restores_its_choices(library, preset_folder, tmp_path, ending):
    preset = preset_folder / "second.safetensors"
    other_preset(preset, preset)
    sound = NoteSound(preset, Pluck(0.61, 2.5, "raised_cosine", 0.2), 0.7, Ear((0.22,)))
    export_sound(sound, tmp_path / f"A.{ending}", "truth")
    (tmp_path / f"A.{ending}").rename(tmp_path / f"b.{ending}")
    dropped = receive(tmp_path / f"b.{ending}", library)
    assert dropped.notice == ""
    pluck = {"pluck": sound.pluck, "string": None}
    ear = {"string_pickup": Pickup(points=(0.22,)), "solo": 0}
    slots = {"single": "second", "seconds": 0.7, "a": "model", "b": "truth", "heard": "b"}
    assert dropped.choices == {**pluck, **ear, **slots}
    shutil.copy(preset_folder / "first.safetensors", preset)
    os.utime(preset, ns=(1, 1))
    assert "is not the one that made this file" in receive(tmp_path / f"b.{ending}", library).notice
    export_sound(replace(sound, seconds=0.1), tmp_path / "c.wav", "difference")
    dropped = receive(tmp_path / "c.wav", library)
    assert "its duration of 0.1 s" in dropped.notice and "shown are 0.5 s" in dropped.notice
    assert [dropped.choices[name] for name in ("seconds", "a", "heard")] == [0.5, "difference", "a"]


@pytest.mark.parametrize(
    ("name", "form"),
    [("a.wave", "WAV"), ("a.BWF", "RF64"), ("a.aifc", "AIFF"), ("a.ogg", "OGG"), ("a.oga", "OGG"), ("a.opus", "OGG")],
)
def test_a_sound_is_taken_by_every_usual_ending(name, form, library, tmp_path):
    subtype = "OPUS" if name == "a.opus" else None
    soundfile.write(tmp_path / name, 0.5 * np.sin(np.arange(24_000) / 20), 48_000, format=form, subtype=subtype)
    assert receive(tmp_path / name, library) == Dropped(sound=True)
    if form != "OGG":
        noise = np.random.default_rng(0).uniform(-0.5, 0.5, 4_000) * np.geomspace(1, 1e-3, 4_000)
        soundfile.write(tmp_path / name, noise, 48_000, format=form)
        assert receive(tmp_path / name, library).body == "a" == body_names()[-1]


def test_a_broken_sound_is_a_notice(library, tmp_path):
    for size, words in ((None, "no sound file that can be read"), (5, "no impulse response")):
        if size:
            soundfile.write(tmp_path / "a.wav", np.zeros(size), 8000)
        assert words in receive(tmp_path / "a.wav", library).notice


def test_every_shipped_preset_has_a_title_of_its_own_and_studio_ones_come_first():
    entries, _ = list_presets(SHIPPED)
    assert len({one.title for one in entries}) == len(entries) > 2
    assert [one.studio for one in entries] == sorted((one.studio for one in entries), reverse=True)


def heard(path: Path, distance_db: float) -> Heard:
    return Heard(path.stem, preset_digest(path), 4.0, distance_db, 0.0, 0.0)


def test_a_measured_distance_comes_and_goes_with_it(library, preset_folder, small_preset):
    first, seen = preset_folder / "first.safetensors", reported(library.changed)
    assert library.entries[0].heard is None
    add_heard(preset_folder, [heard(first, 0.5)])
    assert (library.refresh(), len(seen)) == ([], 1)
    assert [entry.heard.distance_db for entry in library.entries if entry.heard] == [0.5, 0.5]  # of one content
    other_preset(small_preset, first)
    library.refresh()
    assert [entry.heard is None for entry in library.entries] == [True, False]
    for content in (b"\x00" * 5000, b"<b>x</b>\n" * 200_000, ",".join(COLUMNS).encode() + b"\n<b>" * 1000):
        (preset_folder / NAME).write_bytes(content)
        entries, problems = list_presets()
        assert [entry.name for entry in entries] == ["first", "second"] and 1 <= len(problems) <= 4


def test_the_filter_finds_words_in_any_order_and_every_kind(qtbot, preset_folder):
    one, *_ = list_presets()[0]
    nylon = replace(one.info, title="Nylon B3, plucked")
    steel = replace(one.info, title="Steel E4", rate_hz=16_000, tension_modulated=False, model="koopman")
    low, high = (preset_row(PresetEntry(name, one.path, info)) for name, info in (("low", nylon), ("high", steel)))
    for words, kinds, starred, found in (
        ("", (), False, [high, low]),  # a favourite is on top
        ("b3 nyl", (), False, [low]),
        ("steel 16", (), False, [high]),
        ("steel nylon", (), False, []),
        ("glide", (), False, [low]),
        ("", ("linear", "", ""), False, [high]),
        ("", ("", "koopman", ""), False, [high]),
        ("", ("", "", 4000), False, [low]),
        ("koopman", ("", "", 16_000), False, [high]),
        ("", (), True, [high]),
    ):
        assert listed_rows([low, high], {"high"}, words.split(), kinds, starred) == found, (words, kinds)


def test_figures_have_few_digits_and_the_measured_error_decides_whether_to_warn():
    shares = (0.0, 1e-7, 1.2e-5, 0.0345, 0.5, 1.16)
    assert [*map(percent, shares)] == ["< 0.001 %", "< 0.001 %", "0.0012 %", "3.5 %", "50 %", "116 %"]
    outside = "decay time near 3 kHz 1.9 s is outside the trained 0.1 … 1 s"
    for error, words in ((math.nan, "{}"), (1e-6, "accurate, although {}"), (0.03, "inaccurate: {}")):
        assert judged(outside, error) == (words.format(outside), error == 0.03)
        assert judged("", error) == ("", False)
