"""Hostile files to every reader: each is refused in one line by its own error, or does no harm, at little cost."""

import contextlib
import json
import os
import random
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.instruments.library import list_instruments
from app.player.bodies import own_bodies
from app.player.midi_file import MOST_EVENTS
from app.presets.library import Library, list_presets
from app.window.dropped_files import receive
from app.window.settings import Settings, load_settings
from engine import bounds
from engine.folders import usable_files
from engine.plain_text import LONGEST_MESSAGE, one_line
from engine.presets import preset_digest
from engine.resonators.string import resonator_of
from engine.schema import SchemaError, parse_json, read_toml, write
from engine.truth import SplittingSolver
from engine.values.string import StringParameters
from engine.whole_file import UnusableFile, read_bounded
from tests.fuzz.mutations import MOST_MB, Costs, attacked, damaged_preset
from tests.fuzz.readers import (
    INSTRUMENT,
    KEYMAP,
    SCALE,
    TARGETS,
    Target,
    damaged_wav,
    impulse,
    in_one_line,
    json_or_bytes,
    played_text,
    recipe_text,
    wav,
)
from training.heard_file import read_heard

EVERY = pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
OF_NAME = {target.name: target for target in TARGETS}
HUGE_BYTES = 3 * 2**30


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "there"
    path.mkdir()
    return path


def cost_of(target: Target, path: Path, costs: Costs | None = None) -> Costs:
    """The cost of a reading, which is refused by the reader's own error, or does no harm."""
    costs = costs or Costs()
    try:
        with costs.reading():
            target.read(path)
    except target.errors as error:
        in_one_line(error, path)
    return costs


@EVERY
def test_a_whole_file_is_read_and_a_damaged_or_huge_one_does_no_harm(target, folder, tmp_path, rounds, seed):
    """Only the first reading pays what is loaded once. The rest of a huge file takes no place on the disk."""
    whole, path = target.whole(tmp_path), folder / target.name
    path.write_bytes(whole)
    target.read(path)
    costs = Costs()

    def attack(draw: random.Random) -> None:
        path.write_bytes(target.damaged(whole, draw))
        cost_of(target, path, costs)
        assert {each.name for each in folder.iterdir()} <= {target.name}

    attacked(target.name, rounds // 10, seed, attack, costs)
    path.write_bytes(whole)
    with path.open("r+b") as file:
        file.truncate(HUGE_BYTES)
    costs = cost_of(target, path)
    assert costs.largest_mb <= MOST_MB, costs


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
@EVERY
def test_a_pipe_keeps_nobody_waiting(target, folder):
    os.mkfifo(folder / target.name)
    refused: list[bool] = []

    def attempt() -> None:
        with pytest.raises(target.errors) if target.errors else contextlib.nullcontext():
            target.read(folder / target.name)
        refused.append(True)

    thread = threading.Thread(target=attempt, daemon=True)
    thread.start()
    thread.join(20)
    assert refused


def midi(track: bytes) -> bytes:
    head = b"MThd" + (6).to_bytes(4, "big") + b"\x00\x00\x00\x01\x01\xe0"
    return head + b"MTrk" + len(track).to_bytes(4, "big") + track


BOMBS: dict[str, tuple[str, bytes | str]] = {  # small files that would cost gigabytes or minutes
    "a key of bare parts": ("string.toml", "a." * 30_000 + "a=1"),
    "a key of quoted parts": ("string.toml", '"=".' * 15_000 + "a=1"),
    "a key of escaped parts": ("string.toml", r'"\"".' * 12_000 + "a=1"),
    "a key of parts inline": ("string.toml", "x={" + "a." * 30_000 + "a=1}"),
    "a table of many parts": ("string.toml", "[" + "a." * 30_000 + "a]"),
    "quotes without end": ("string.toml", '"\\"' + '\\"' * 30_000),
    "quotes of both kinds": ("string.toml", "\"'" * 30_000),
    "a time without end": ("song.mid", midi(b"\xff" * (2**20 - 40))),
    "a length without end": ("song.mid", midi(b"\x00\xff\x01" + b"\xff" * (2**20 - 40))),
    "a time within a chunk of another name": ("song.mid", midi(b"\x00\x90\x3c\x40" + b"\x80" * 9)),
    "too many messages": ("song.mid", midi(b"\x00\x90\x3c\x40" + b"\x00\x3c\x40" * MOST_EVENTS)),
    "a system message that never ends": ("song.mid", midi(b"\x00\xf0\x01\xf7\x00\x05" + b"\xff" * 1000)),
    "empty lines": ("rows.csv", "\n" * 2**21),
    "empty rows": ("rows.csv", ",\n" * 2**20),
    "rows of one column": ("rows.csv", "digest\n" + "a\n" * 2**20),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_a_small_file_that_would_cost_much_is_refused(kind, folder):
    name, content = BOMBS[kind]
    path, target, costs = folder / name, OF_NAME[name], Costs()
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(target.errors) as caught, costs.reading():
        target.read(path)
    in_one_line(caught.value, path)
    assert costs.largest_mb <= MOST_MB, costs


def test_ordinary_dots_are_read(folder):
    path = folder / "a.toml"
    path.write_text(f'a.b."c.d".e = [{", ".join(["0.5"] * 900)}]\nversion = "1.2.3.4.5.6.7.8"\n[x.y.z]\nk = 1e-3\n')
    assert read_toml(path)["a"]["b"]["c.d"]["e"] == [0.5] * 900


@pytest.mark.parametrize(
    ("facts", "kept"),
    [
        ({"favourites": [1] * 150_000}, False),
        ({"choices": {f"{n}": 1 for n in range(80_000)}}, False),
        ({"favourites": [1] * 30_000, "window_geometry": "kept"}, True),
    ],
)
def test_settings_with_very_many_faults_keep_the_rest_or_are_set_aside(facts, kept, folder):
    path, costs = folder / "settings.json", Costs()
    path.write_text(json.dumps(facts))
    with costs.reading():
        settings, notice = load_settings(path)
    assert settings.model_copy(update={"window_geometry": ""}) == Settings() and len(notice) <= 500
    assert (settings.window_geometry == "kept") if kept else ("set aside" in notice)
    assert costs.largest_mb <= MOST_MB, costs


# Folders: a stranger's file is listed or reported, and hides no other


@pytest.mark.parametrize("kind", ["presets", "instruments"])
def test_a_strangers_file_hides_no_other(kind, folder, small_preset, rounds, seed):
    facts = {**json.loads(INSTRUMENT.read_bytes()), "tuning": {"scale": SCALE.decode(), "keymap": KEYMAP.decode()}}
    whole, damage, lister, ending = {
        "presets": (small_preset.read_bytes(), damaged_preset, list_presets, "safetensors"),
        "instruments": (json.dumps(facts).encode(), json_or_bytes, list_instruments, "json"),
    }[kind]
    (folder / f"good.{ending}").write_bytes(whole)
    path, costs = folder / f"stranger.{ending}", Costs()
    lister(folder)

    def attack(draw: random.Random) -> None:
        path.write_bytes(damage(whole, draw))
        with costs.reading():
            entries, problems = lister(folder)
        assert "good" in [entry.name for entry in entries] and len(entries) + len(problems) == 2
        for problem in problems:
            in_one_line(ValueError(problem), path)

    attacked(kind, rounds // 4, seed, attack, costs)


def test_a_dropped_sound_is_a_recipe_a_recording_a_body_or_refused(small_preset, tmp_path, rounds, seed, monkeypatch):
    """Its reader is chosen by what is in it."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    library = Library([])
    recorded = wav(tmp_path, played_text())
    wholes = (wav(tmp_path, recipe_text(small_preset)), recorded, impulse(tmp_path, "WAV", "PCM_16"))
    (tmp_path / "recorded.wav").write_bytes(recorded)
    assert "is a recording of Classical guitar" in receive(tmp_path / "recorded.wav", library).notice
    path = tmp_path / "dropped.wav"

    def attack(draw: random.Random) -> None:
        path.write_bytes(damaged_wav(draw.choice(wholes), draw))
        dropped = receive(path, library)
        assert dropped.notice.isprintable() and len(dropped.notice) <= 600
        assert dropped.body in ("", "dropped") or dropped.body.startswith("dropped_")
        for body in own_bodies().glob("*"):
            body.unlink()

    attacked("dropped sounds", rounds // 16, seed, attack)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_pipes_and_folders_that_cannot_be_looked_into_hide_nothing(folder, monkeypatch, small_preset):
    for name in ("settings.json", "heard.csv", "x.safetensors"):
        os.mkfifo(folder / name)
    assert load_settings(folder / "settings.json")[0] == Settings()
    assert read_heard(folder)[0] == {}
    with contextlib.suppress(ValueError):
        preset_digest(folder / "x.safetensors")
    entries, problems = list_presets(folder)
    assert entries == [] and len(problems) == 2
    unreadable = folder / ("x" * 300)  # its name is too long for any disk
    entries, problems = list_presets(small_preset.parent, unreadable)
    assert small_preset.stem in [entry.name for entry in entries]
    assert any("cannot be looked into" in problem for problem in problems)
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(unreadable))
    assert usable_files()


def test_a_reading_is_bounded_and_of_an_ordinary_file(tmp_path):
    (tmp_path / "a").write_bytes(b"12345678901")
    for path, reported in ((tmp_path, "ordinary"), (Path("a\0b"), "name"), (tmp_path / "a", "larger than")):
        with pytest.raises(UnusableFile, match=reported):
            read_bounded(path, 10)
    assert read_bounded(tmp_path / "a", 11) == b"12345678901"


@given(
    factors=st.lists(st.floats(1e-8, 1e8), min_size=8, max_size=8),
    modes=st.integers(-5, 20_000),
    points=st.integers(-5, 20_000),
    rate_hz=st.floats(0.01, 1e9),
)
def test_a_string_within_bounds_can_be_computed(factors, modes, points, rate_hz):
    """Whatever passes has tables of ordinary size, modes that oscillate, and finite motion."""
    plain = {name: value * by for (name, value), by in zip(write(StringParameters()).items(), factors, strict=True)}
    try:
        string = StringParameters(**plain)
        string.check_motion(modes, points, rate_hz, tension_modulated=True)
    except ValueError as error:
        assert str(error).isprintable()
        return
    if modes * points > 50_000:
        return  # it may take a moment
    resonator = resonator_of(string, modes, grid_points=points)
    resonator.eigenvalues()
    solver = SplittingSolver(resonator, rate_hz, silence=1e-9)
    assert solver.substeps <= bounds.MOST_SUBSTEPS
    assert all(bool(np.isfinite(table).all()) for table in solver.constants)


@given(st.binary(max_size=300) | st.text(max_size=3_000))
def test_a_message_is_one_printable_line_and_json_is_plain_data_or_refused(text):
    line = one_line(str(text))
    assert line.isprintable() and len(line) <= LONGEST_MESSAGE and one_line(line) == line
    try:
        parse_json(text, "there")
    except SchemaError as error:
        assert str(error).startswith("there: ")
