"""The library and what comes into it: refreshing, searching, installing, dropped files."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
from pytestqt.qtbot import QtBot

from app.export.choices import ExportChoices
from app.player.bodies import body_names
from app.presets.install import install_preset
from app.presets.library import Library, PresetEntry, list_presets
from app.rendering.note_sound import NoteSound
from app.shared.parameters import OF_CHOICES
from app.views.controls.browser_rows import listed_rows
from app.views.dialogs.preset_card import preset_row
from app.window.dropped_files import Dropped, receive, receive_body
from engine.pluck import Pluck
from engine.presets import SHIPPED, PresetError, preset_digest
from engine.values.ear import Ear
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


def other_preset(small_preset: Path, path: Path) -> Path:
    """A preset of the same form with other bytes."""
    path.write_bytes(small_preset.read_bytes().replace(b"A small string", b"Another string"))
    return path


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_refresh_reports_only_when_there_are_others(library: Library, small_preset: Path, own: Path) -> None:
    seen: list[None] = []
    library.changed.connect(lambda: seen.append(None))
    assert (library.refresh(), library.names, seen) == ([], ["first", "second"], [])
    own.mkdir()
    shutil.copy(small_preset, own / "mine.safetensors")
    shutil.copy(small_preset, own / "first.safetensors")
    (problem,) = library.refresh()
    assert "first.safetensors: a preset of this name exists already" in problem
    assert library.refresh() == []  # it has been reported
    assert (library.names, len(seen)) == (["first", "mine", "second"], 1)
    mine = library.find("mine")
    assert mine is not None
    first = library.find("first")
    assert first is not None
    assert [mine.title, mine.info.title] == [f"{first.title} (yours)", first.title]
    assert (mine.path, mine.size_bytes) == (own / "mine.safetensors", small_preset.stat().st_size)


def test_a_preset_is_installed_and_a_taken_name_gets_a_number(
    library: Library, small_preset: Path, own: Path, tmp_path: Path
) -> None:
    given = other_preset(small_preset, tmp_path / "first.safetensors")
    present = [entry.path for entry in library.entries]
    path, was_there = install_preset(given, own, present)
    assert (path.name, was_there) == ("first_2.safetensors", False)
    assert path.read_bytes() == given.read_bytes()
    assert install_preset(given, own, [*present, path]) == (path, True)
    assert files(own) == ["first_2.safetensors"]
    assert install_preset(small_preset, own, present)[1]


@pytest.mark.parametrize("data", [b"", b"no preset", None])
def test_what_is_no_preset_is_refused_and_leaves_nothing(
    small_preset: Path, own: Path, tmp_path: Path, data: bytes | None
) -> None:
    given = tmp_path / "bad.safetensors"
    given.write_bytes(small_preset.read_bytes()[:-9] if data is None else data)
    with pytest.raises(PresetError, match=r"bad\.safetensors: not a whole safetensors file"):
        install_preset(given, own, [])
    assert not own.exists()


def test_a_dropped_preset_that_is_there_is_chosen_and_reported(
    library: Library, small_preset: Path, own: Path, tmp_path: Path
) -> None:
    dropped = receive(small_preset, library)
    assert dropped.choices == {"preset": "first"}
    assert "is the factory preset “A small string" in dropped.notice
    assert not own.exists()
    new = other_preset(small_preset, tmp_path / "New.safetensors")
    for notice in ("", "New.safetensors is your own preset “Another string"):
        dropped = receive(new, library)
        assert (dropped.choices, library.names) == ({"preset": "New"}, ["New", "first", "second"])
        assert dropped.notice.startswith(notice) and bool(dropped.notice) == bool(notice)
    assert files(own) == ["New.safetensors"]


@pytest.mark.parametrize("ending", ["WAV", "FLAC"])
def test_a_dropped_export_restores_its_choices(
    library: Library, preset_folder: Path, tmp_path: Path, ending: str
) -> None:
    preset = preset_folder / "second.safetensors"
    other_preset(preset, preset)
    pluck = Pluck(0.61, 2.5, "raised_cosine", 0.2)
    sound = NoteSound(preset, pluck, 0.7, Ear((0.22,)))
    export_sound(sound, tmp_path / f"A.{ending}", "truth")
    (tmp_path / f"A.{ending}").rename(tmp_path / f"b.{ending}")
    dropped = receive(tmp_path / f"b.{ending}", library)
    assert dropped.notice == ""
    assert dropped.choices == {
        "single": "second",
        "string": None,
        "position": 0.61,
        "amplitude_mm": 2.5,
        "shape": "raised_cosine",
        "width": 0.2,
        "listen": 0.22,
        "seconds": 0.7,
        "a": "model",
        "b": "truth",
        "heard": "b",
        "solo": 0,
        "stereo": False,
        "pickup": "displacement",
    }
    shutil.copy(preset_folder / "first.safetensors", preset_folder / "second.safetensors")
    os.utime(preset_folder / "second.safetensors", ns=(1, 1))
    assert "is not the one that made this file" in receive(tmp_path / f"b.{ending}", library).notice
    export_sound(replace(sound, seconds=0.1), tmp_path / "c.wav", "difference")
    dropped = receive(tmp_path / "c.wav", library)
    assert "its duration of 0.1 s" in dropped.notice
    assert "shown are 0.5 s" in dropped.notice
    assert dropped.choices["seconds"] == 0.5
    assert (dropped.choices["a"], dropped.choices["heard"]) == ("difference", "a")


def test_a_dropped_wav_that_ends_by_its_decay_leaves_the_duration(
    library: Library, preset_folder: Path, tmp_path: Path
) -> None:
    """As the export dialog writes it: its longest duration, 30 s, is no choice for the window."""
    export = ExportChoices()
    assert export.until_decayed
    assert export.longest_s > OF_CHOICES["seconds"].limits[1]
    sound = NoteSound(preset_folder / "first.safetensors", Pluck(0.5, 2.0), export.longest_s, Ear((0.3,)))
    export_sound(sound, tmp_path / "a.wav", settings=export.wav)
    dropped = receive(tmp_path / "a.wav", library)
    assert dropped.notice == ""
    assert "seconds" not in dropped.choices
    assert dropped.choices["position"] == 0.5


def test_foreign_and_broken_files_are_one_notice(library: Library, tmp_path: Path) -> None:
    for name, words in (
        ("a.txt", "not a file that is used here"),
        ("a.wav", "no sound file that can be read"),
        ("a.safetensors", "no such preset file"),
    ):
        dropped = receive(tmp_path / name, library)
        assert dropped.choices == {}
        assert words in dropped.notice
    soundfile.write(tmp_path / "a.wav", np.zeros(5), 8000)
    assert "no impulse response" in receive(tmp_path / "a.wav", library).notice
    soundfile.write(tmp_path / "a.wav", np.zeros(8000), 8000)
    assert receive(tmp_path / "a.wav", library) == Dropped(sound=True)
    assert "no impulse response" in receive_body(tmp_path / "a.wav").notice


def entry(**changes: object) -> PresetEntry:
    (one, *_), _ = list_presets()
    return replace(one, name=str(changes.pop("name", one.name)), info=replace(one.info, **changes))  # type: ignore[arg-type]


def test_every_shipped_preset_has_a_title_of_its_own_and_studio_ones_come_first() -> None:
    entries, _ = list_presets(SHIPPED)
    assert len({one.title for one in entries}) == len(entries) > 2
    assert [one.studio for one in entries] == sorted((one.studio for one in entries), reverse=True)


def heard(path: Path, distance_db: float) -> Heard:
    return Heard(path.stem, preset_digest(path), 4.0, distance_db, 0.0, 0.0)


def test_what_was_heard_comes_with_the_preset_and_goes_with_its_change(
    library: Library, preset_folder: Path, small_preset: Path
) -> None:
    first = preset_folder / "first.safetensors"
    seen: list[None] = []
    library.changed.connect(lambda: seen.append(None))
    assert library.entries[0].heard is None
    add_heard(preset_folder, [heard(first, 0.5)])
    assert library.refresh() == []
    assert len(seen) == 1
    assert [entry.heard.distance_db for entry in library.entries if entry.heard] == [0.5, 0.5]  # of one content
    other_preset(small_preset, first)
    library.refresh()
    assert [entry.heard is None for entry in library.entries] == [True, False]


def test_a_hostile_table_is_reported_and_every_preset_listed(library: Library, preset_folder: Path) -> None:
    for content in (b"\x00" * 5000, b"<b>x</b>\n" * 200_000, ",".join(COLUMNS).encode() + b"\n<b>" * 1000):
        (preset_folder / NAME).write_bytes(content)
        entries, problems = list_presets()
        assert [entry.name for entry in entries] == ["first", "second"]
        assert 1 <= len(problems) <= 4


def test_the_most_accurate_come_first_and_what_was_not_measured_last(
    qtbot: QtBot, library: Library, preset_folder: Path, small_preset: Path
) -> None:
    for name, word in (("third", b"Another string"), ("fourth", b"Fourth  string")):
        path = preset_folder / f"{name}.safetensors"
        path.write_bytes(small_preset.read_bytes().replace(b"A small string", word[:14].ljust(14)))
        add_heard(preset_folder, [heard(path, {"third": 3.0, "fourth": 0.1}[name])])
    library.refresh()

    def order(number: int = 0, favourites: tuple[str, ...] = (), words: str = "") -> list[str]:
        rows = [preset_row(entry) for entry in library.entries]
        return [row.name for row in listed_rows(rows, favourites, (words,), order=number)]

    assert order() == ["fourth", "third", "first", "second"]
    assert order(0, ("second", "third")) == ["third", "second", "fourth", "first"]
    assert order(1) == ["first", "fourth", "second", "third"]
    assert order(2) == ["first", "fourth", "second", "third"]
    assert order(words="not measured") == ["first", "second"]


def test_the_filter_finds_words_in_any_order_and_every_kind(qtbot: QtBot, preset_folder: Path) -> None:
    low = preset_row(entry(name="low", title="Nylon B3, plucked"))
    high = preset_row(entry(name="high", title="Steel E4", rate_hz=16_000, tension_modulated=False, model="koopman"))
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


@pytest.mark.parametrize(
    ("name", "form"),
    [("a.wave", "WAV"), ("a.BWF", "RF64"), ("a.aifc", "AIFF"), ("a.ogg", "OGG"), ("a.oga", "OGG"), ("a.opus", "OGG")],
)
def test_a_sound_is_taken_by_every_usual_ending(name: str, form: str, library: Library, tmp_path: Path) -> None:
    subtype = "OPUS" if name == "a.opus" else None
    soundfile.write(tmp_path / name, 0.5 * np.sin(np.arange(24_000) / 20), 48_000, format=form, subtype=subtype)
    assert receive(tmp_path / name, library) == Dropped(sound=True)
    if form != "OGG":
        noise = np.random.default_rng(0).uniform(-0.5, 0.5, 4_000) * np.geomspace(1, 1e-3, 4_000)
        soundfile.write(tmp_path / name, noise, 48_000, format=form)
        assert receive(tmp_path / name, library).body == "a"
        assert body_names()[-1] == "a"
