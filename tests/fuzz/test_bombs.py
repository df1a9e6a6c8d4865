"""Small files that would cost much: each is refused by its reader's own error, or does no harm, at once.

The costs of reading are held to `MOST_MB`; before, each of these took gigabytes or minutes.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from app.audio.impulse_file import ImpulseError, read_impulse
from app.export.recipe import RecipeError, read_recipe
from app.instrument.midi_file import MOST_EVENTS, MidiFileError, read_midi
from app.patches.library import PatchError, read_patch
from app.patches.tuning import Tuning, TuningChoice, read_scala
from app.presets.library import list_presets
from app.window.settings import Settings, load_settings
from engine.folders import usable_files
from engine.presets import PresetError, load_preset, preset_digest, read_string
from engine.read_file import UnusableFile, read_bounded
from engine.schema import SchemaError, read_toml
from tests.fuzz.costs import MOST_MB, Costs
from training.cell import load
from training.fitting.checkpoint import Checkpoint
from training.heard_file import read_heard
from training.results import read_results
from training.sweeping.plan import load_plan


def midi(track: bytes) -> bytes:
    head = b"MThd" + (6).to_bytes(4, "big") + b"\x00\x00\x00\x01\x01\xe0"
    return head + b"MTrk" + len(track).to_bytes(4, "big") + track


def cheap(read: Callable[[], object]) -> None:
    costs = Costs()
    with costs.reading():
        read()
    assert (costs.largest_mb or 0) <= MOST_MB, costs


def refused(read: Callable[[Path], object], path: Path, error: type[Exception]) -> None:
    """Cheaply, and by the reader's own error, which names the file."""

    def attempt() -> None:
        with pytest.raises(error) as caught:
            read(path)
        assert str(path) in str(caught.value)

    cheap(attempt)


DOTTED = {
    "bare": "a." * 30_000 + "a=1",
    "quoted": '"=".' * 15_000 + "a=1",
    "literal": "'='." * 15_000 + "a=1",
    "escaped": r'"\"".' * 12_000 + "a=1",
    "spaced": "a . " * 15_000 + "a=1",
    "inline": "x={" + "a." * 30_000 + "a=1}",
    "table": "[" + "a." * 30_000 + "a]",
    "quotes without end": '"\\"' + '\\"' * 30_000,
    "quotes of both kinds": "\"'" * 30_000,
    "words": "a" * 60_000,
}


@pytest.mark.parametrize("kind", DOTTED)
def test_a_key_of_many_parts(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "string.toml"
    path.write_text(DOTTED[kind])
    refused(read_toml, path, SchemaError)


def test_ordinary_dots_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(f'a.b."c.d".e = [{", ".join(["0.5"] * 900)}]\nversion = "1.2.3.4.5.6.7.8"\n[x.y.z]\nk = 1e-3\n')
    assert read_toml(path)["a"]["b"]["c.d"]["e"] == [0.5] * 900


MIDI = {
    "a time without end": midi(b"\xff" * (2**20 - 40)),
    "a length without end": midi(b"\x00\xff\x01" + b"\xff" * (2**20 - 40)),
    "a time within a chunk of another name": midi(b"\x00\x90\x3c\x40" + b"\x80" * 9),
    "too many messages": midi(b"\x00\x90\x3c\x40" + b"\x00\x3c\x40" * MOST_EVENTS),
    "a system message that never ends": midi(b"\x00\xf0\x01\xf7\x00\x05" + b"\xff" * 1000),
}


@pytest.mark.parametrize("kind", MIDI)
def test_midi_files(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "song.mid"
    path.write_bytes(MIDI[kind])
    refused(read_midi, path, MidiFileError)


def test_the_largest_song_is_read_at_an_ordinary_cost(tmp_path: Path) -> None:
    path = tmp_path / "song.mid"
    path.write_bytes(midi(b"\x00\x90\x3c\x40" + b"\x00\x3c\x40" * (MOST_EVENTS - 2) + b"\x00\xff\x2f\x00"))
    cheap(lambda: read_midi(path))


def many(field: str, value: object) -> str:
    return json.dumps({field: [value] * 150_000})


MANY_CHOICES = json.dumps({"choices": {f"{n}": 1 for n in range(80_000)}})


@pytest.mark.parametrize("text", [many("favourites", 1), many("patch_favourites", {}), MANY_CHOICES])
def test_settings_with_very_many_faults(text: str, tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text(text)

    def attempt() -> None:
        settings, notice = load_settings(path)
        assert settings == Settings() and "set aside" in notice and len(notice) <= 500

    cheap(attempt)


def test_settings_with_some_faults_keep_the_rest(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text(json.dumps({"favourites": [1] * 30_000, "window_geometry": "kept"}))

    def attempt() -> None:
        settings, _ = load_settings(path)
        assert settings.window_geometry == "kept" and settings.favourites == Settings().favourites

    cheap(attempt)


@pytest.mark.parametrize("text", ["\n" * 2**21, ",\n" * 2**20, "digest\n" + "a\n" * 2**20])
def test_tables_of_nothing(text: str, tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    path.write_text(text)
    refused(read_results, path, SchemaError)
    path.write_text("file,status,\n" + text[:-100])


def test_a_rate_of_a_recipe_of_four_hundred_digits() -> None:
    from app.export.recipe import Recipe

    field = Recipe.model_fields["preset_rate_hz"]
    assert field.metadata  # bounds, so that no arithmetic is done with it
    with pytest.raises(ValueError, match="preset_rate_hz"):
        Recipe.model_validate({"preset_rate_hz": 10**400})


@pytest.mark.parametrize("first", ["610000.", "-610000."])
def test_a_scale_whose_pitches_cannot_be_squared(first: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="scale"):
        Tuning(TuningChoice.model_validate({"scale": f"! a\na\n 2\n {first}\n 2/1\n"}))


PIPES: dict[str, tuple[Callable[[Path], object], type[Exception] | tuple[type[Exception], ...]]] = {
    "a.safetensors": (load_preset, PresetError),
    "b.safetensors": (preset_digest, PresetError),
    "recipe.wav": (read_recipe, RecipeError),
    "body.wav": (read_impulse, ImpulseError),
    "song.mid": (read_midi, MidiFileError),
    "string.toml": (read_string, SchemaError),
    "plan.toml": (lambda path: load_plan(str(path)), SchemaError),
    "run.toml": (lambda path: load(str(path)), SchemaError),
    "rows.csv": (read_results, SchemaError),
    "c.safetensors": (Checkpoint.load, ValueError),
    "patch.json": (read_patch, PatchError),
    "a.scl": (read_scala, ValueError),
    "any": (lambda path: read_bounded(path, 10), UnusableFile),
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
@pytest.mark.parametrize("name", PIPES)
def test_a_pipe_keeps_nobody_waiting(name: str, tmp_path: Path) -> None:
    read, error = PIPES[name]
    path = tmp_path / name
    os.mkfifo(path)
    reported: list[BaseException | object] = []

    def attempt() -> None:
        try:
            reported.append(read(path))
        except BaseException as caught:
            reported.append(caught)

    thread = threading.Thread(target=attempt, daemon=True)
    thread.start()
    thread.join(20)
    assert reported and isinstance(reported[0], error), reported


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_pipes_in_the_users_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.mkfifo(tmp_path / "settings.json")
    assert load_settings(tmp_path / "settings.json")[0] == Settings()
    os.mkfifo(tmp_path / "heard.csv")
    assert read_heard(tmp_path)[0] == {}
    os.mkfifo(tmp_path / "x.safetensors")
    entries, problems = list_presets(tmp_path)
    assert entries == [] and len(problems) == 2


def test_a_folder_that_cannot_be_looked_into_hides_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small_preset: Path
) -> None:
    unreadable = tmp_path / ("x" * 300)  # its name is too long for any disk
    entries, problems = list_presets(small_preset.parent, unreadable)
    assert small_preset.stem in [entry.name for entry in entries]
    assert any("cannot be looked into" in problem for problem in problems)
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(unreadable))
    assert usable_files()


def test_what_is_no_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UnusableFile, match="ordinary"):
        read_bounded(tmp_path, 10)
    with pytest.raises(UnusableFile, match="name"):
        read_bounded(Path("a\0b"), 10)
    (tmp_path / "a").write_bytes(b"12345678901")
    with pytest.raises(UnusableFile, match="larger than"):
        read_bounded(tmp_path / "a", 10)
    assert read_bounded(tmp_path / "a", 11) == b"12345678901"
