"""The attack: damaged files to every reader. Each is refused in one line by its own error, or does no harm."""

from __future__ import annotations

import contextlib
import io
import json
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
import torch

from app.audio.impulse_file import ImpulseError, read_impulse
from app.export.recipe import InstrumentSound, Recipe, RecipeError, read_recipe, request_of
from app.export.sound import SoundRequest
from app.export.wav import WavSettings
from app.instrument.bodies import own_bodies
from app.instrument.events import Bend, Controller, NoteOff, NoteOn, TimedEvent
from app.instrument.midi_file import LONGEST_S, MOST_EVENTS, MidiFileError, midi_bytes, read_midi, read_song
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import PatchError, list_patches, read_patch
from app.patches.tuning import Tuning, TuningChoice, read_scala
from app.presets.library import Library, list_presets
from app.window.dropped_files import receive
from app.window.settings import Settings, load_settings
from engine.effects import Body, Effects
from engine.pluck import Pluck
from engine.presets import (
    SHIPPED,
    STRINGS,
    PresetError,
    described_parameters,
    load_preset,
    outside_training,
    read_string,
)
from engine.resonators.sine_transform import project
from engine.schema import SchemaError, write
from engine.sources import ModelSource, Runaway, TruthSource
from engine.values.ear import Ear
from engine.voices import model_program, render_voice, truth_program
from tests.fuzz.costs import MOST_MB, Costs
from tests.fuzz.mutations import HOSTILE, attacked, damaged_bytes, damaged_preset, damaged_text, damaged_value
from training.cell import load
from training.fitting.checkpoint import Checkpoint
from training.heard_file import COLUMNS, read_heard
from training.results import Row, add_rows, read_results
from training.sweeping.plan import load_plan

FRAMES = 32


def in_one_line(error: Exception, path: Path) -> None:
    reported = str(error)
    assert len(reported) <= 500 and reported.isprintable() and str(path) in reported, reported[:700]


def use(path: Path, costs: Costs) -> None:
    """Loads a preset and plays it: its model, its physics, and both as they are heard."""
    with costs.reading():
        preset = load_preset(path)
    info = preset.info
    initial_m = project(Pluck().displacement(info.grid_points), info.modes)
    outside_training(info, Pluck())
    described_parameters(path, info)
    truth = TruthSource(info)
    frames, _ = truth.advance(truth.start(initial_m[None]), 2)
    assert np.isfinite(frames).all()
    try:
        source = ModelSource(preset)
    except ValueError:  # it needs a frame before the first
        return
    seconds = FRAMES / info.rate_hz
    try:
        frames, _ = source.advance(source.start(initial_m[None]), FRAMES)
        assert np.isfinite(frames).all()
        for program in (model_program(preset, info.rate_hz), truth_program(info, info.rate_hz)):
            sound = render_voice(program, source if program.rendered else None, info, Pluck(), Ear((0.37,)), seconds)
            assert bool(np.isfinite(sound).all())
    except Runaway:
        return


@pytest.mark.parametrize("name", ["small", "nylon_nonlinear_4k", "dmd", "any_string"])
def test_presets(name: str, small_preset: Path, tmp_path: Path, rounds: int, seed: int) -> None:
    shipped = {
        "nylon_nonlinear_4k": SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors",
        "any_string": SHIPPED / "studio_any_string.safetensors",
        "dmd": SHIPPED / "nylon_linear_gaussian_16k_dmd.safetensors",
    }
    whole = shipped.get(name, small_preset).read_bytes()
    path = tmp_path / "stranger.safetensors"
    shutil.copy(small_preset, tmp_path / "good.safetensors")
    path.write_bytes(whole)
    use(path, Costs())  # what is loaded once costs no later reading
    costs = Costs()

    def attack(draw: random.Random) -> None:
        path.write_bytes(damaged_preset(whole, draw))
        try:
            use(path, costs)
        except PresetError as error:
            in_one_line(error, path)
        with costs.reading():
            entries, problems = list_presets(tmp_path)
        assert "good" in [entry.name for entry in entries] and len(entries) + len(problems) == 2

    attacked(f"presets ({name})", rounds // 4, seed, attack, costs)


def test_patches(tmp_path: Path, rounds: int, seed: int) -> None:
    """A stranger's patch, with a scale and a mapping, is listed or reported, and hides no other."""
    tuning = {"scale": SCALE.decode(), "keymap": "0\n0\n127\n60\n69\n440.0\n5\n"}
    facts = {**json.loads(PATCH.read_bytes()), "tuning": tuning}
    whole, path = json.dumps(facts).encode(), tmp_path / "stranger.json"
    (tmp_path / "good.json").write_bytes(whole)
    list_patches(tmp_path)
    costs = Costs()

    def attack(draw: random.Random) -> None:
        path.write_bytes(json_or_bytes(whole, draw))
        with costs.reading():
            entries, problems = list_patches(tmp_path)
        assert "good" in [entry.name for entry in entries] and len(entries) + len(problems) == 2
        for problem in problems:
            in_one_line(ValueError(problem), path)

    attacked("patches", rounds // 4, seed, attack, costs)


@dataclass(frozen=True)
class Target:
    """A reader, a whole file of its kind, and the error that is its own."""

    name: str
    whole: Callable[[Path], bytes]
    read: Callable[[Path], object]
    errors: tuple[type[Exception], ...]
    damaged: Callable[[bytes, random.Random], bytes] = damaged_bytes


def json_or_bytes(whole: bytes, draw: random.Random) -> bytes:
    return damaged_bytes(whole, draw) if draw.random() < 0.3 else damaged_text(json.loads(whole), draw).encode()


def toml_or_bytes(whole: bytes, draw: random.Random) -> bytes:
    lines = whole.decode().splitlines()
    if draw.random() < 0.3:
        return damaged_bytes(whole, draw)
    place = draw.randrange(len(lines))
    name = lines[place].partition("=")[0] if "=" in lines[place] else "colour "
    value = draw.choice(
        ("-1", "0", "1e300", "nan", "inf", "'x'", "[]", "{}", "true", "9" * 5000, "1000000000", "[1, 'a']",
         "'" + "x" * 50_000 + "'", "[" * 100 + "]" * 100, "[" * 3_000, "[" + "1," * 3000 + "]")
    )  # fmt: skip
    lines[place] = f"{name}= {value}"
    return "\n".join(lines).encode()


def wav(folder: Path, comment: str) -> bytes:
    buffer = io.BytesIO()
    with soundfile.SoundFile(buffer, "w", 4000, 1, "PCM_16", format="WAV") as file:
        file.comment = comment
        file.write(np.zeros(8))
    return buffer.getvalue()


def recipe_text(preset: Path) -> str:
    return Recipe.of(SoundRequest(load_preset(preset), Pluck(), 0.37, 0.1), WavSettings()).model_dump_json()


def played_text() -> str:
    return InstrumentSound(
        program="Learned Strings",
        version="0.2.0",
        instrument="Classical guitar",
        preset="studio_any_string",
        preset_sha256="0" * 64,
        source="truth",
        rate_hz=48_000,
        bits="24",
        midi="take.mid",
        recorded="2026-11-24T11:00:00+01:00",
    ).model_dump_json()


def damaged_wav(whole: bytes, draw: random.Random) -> bytes:
    if draw.random() < 0.4:
        return damaged_bytes(whole, draw)
    with soundfile.SoundFile(io.BytesIO(whole)) as file:
        comment = file.comment
    try:
        return wav(Path(), damaged_text(json.loads(comment), draw).replace("\\u0000", ""))
    except (ValueError, soundfile.LibsndfileError):  # a text that no WAV can hold
        return damaged_bytes(whole, draw)


def impulse(folder: Path, kind: str, subtype: str) -> bytes:
    buffer = io.BytesIO()
    decay = np.geomspace(1, 1e-3, 400)[:, None]
    soundfile.write(buffer, decay * np.random.default_rng(0).uniform(-1, 1, (400, 2)), 44_100, subtype, format=kind)
    return buffer.getvalue()


def sounded(path: Path) -> None:
    """Reads an impulse response and makes it what the mixer would be given."""
    found = Effects(Body(impulse=read_impulse(path))).impulse(48_000)
    assert bool(np.isfinite(found).all()) and len(found) <= 3 * 48_000


def saved(value: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, value)
    return buffer.getvalue()


def row_file(folder: Path) -> bytes:
    row = Row("d" * 16, "a", "done", "koopman", "linear", "noise", 4000, 400, "ours", 0, rel_mse=0.5)
    add_rows(folder / "rows.csv", [row])
    return (folder / "rows.csv").read_bytes()


def checkpoint(folder: Path) -> bytes:
    tensor = torch.zeros(3)
    facts = {"configuration": {"a": [1, 2]}, "step": 3, "loss_total": 0.5}
    Checkpoint({"w": tensor}, {"w": tensor}, {}, {"0": {"exp_avg": tensor}}, facts).save(folder / "whole")
    return (folder / "whole").read_bytes()


def heard(path: Path) -> None:
    for problem in read_heard(path.parent)[1]:
        in_one_line(ValueError(problem), path)


def settings(path: Path) -> None:
    found, notice = load_settings(path)
    assert isinstance(found, Settings) and len(notice) <= 500 and notice.isprintable()
    for aside in path.parent.glob("*.broken.json"):
        aside.unlink()


def scala(path: Path) -> None:
    """Reads a .scl or .kbm, and asks for every pitch."""
    text = read_scala(path)
    tuning = Tuning(TuningChoice.model_validate({"keymap" if path.suffix == ".kbm" else "scale": text}))
    assert all(0 < tuning.hz(key) < np.inf for key in range(128))


def scala_or_bytes(whole: bytes, draw: random.Random) -> bytes:
    if draw.random() < 0.4:
        return damaged_bytes(whole, draw)
    lines = whole.decode().splitlines()
    for _ in range(draw.choice((1, 1, 3))):
        lines[draw.randrange(len(lines))] = draw.choice(
            ("-1", "0", "x", "1e300", "nan", "inf.", "9" * 5000, "2000000000", "-2000000000.", "1/0", "0/1", "-3/2",
             "1/" + "9" * 30, "", "!", "\u00e9", "5" * 200 + ".", "1.2.3", "20000", "128")
        )  # fmt: skip
    return "\n".join(lines).encode()


MPE = read_patch(PATCHES / "long_wire.json").model_copy(update={"mode": "mpe"})


def song(path: Path) -> None:
    """Reads a MIDI file, and writes what it says."""
    events = read_midi(path)
    assert read_song(path, MPE).events == events
    assert all(0 <= each.time_s <= LONGEST_S for each in events) and len(events) <= MOST_EVENTS
    for each in events:
        if isinstance(each.event, Bend):
            assert -1 <= each.event.value <= 1
    midi_bytes(events)


SONG = midi_bytes(
    [
        *(TimedEvent(0.1 * n, NoteOn(40 + n, 90, n % 3)) for n in range(12)),
        *(TimedEvent(0.1 * n + 0.05, Bend(n / 12, n % 3)) for n in range(12)),
        *(TimedEvent(0.1 * n + 0.3, NoteOff(40 + n, n % 3)) for n in range(12)),
        TimedEvent(0.2, Controller(64, 127)),
    ]
)
PATCH = min(PATCHES.glob("*.json"))
SCALE = b"! a.scl\n!\nfifths and thirds\n 5\n!\n 9/8\n 386.3\n 3/2\n 5/3\n 2/1\n"
KEYMAP = b"7\n0\n127\n60\n69\n440.0\n12\n0\n2\n4\n5\n7\n9\n11\n"
PLAN = b"""description = "a plan"
[[block]]
models = ["koopman", "dmd"]
strings = ["linear"]
initials = ["gaussian"]
rates_hz = [4000]
horizons = [400]
seeds = [0, 1]
[data]
count = 20
"""
CONFIGURATION = b"""title = "a run"
model = "koopman_var"
[data]
initial = "gaussian"
rate_hz = 4000
modes = 10
count = 100
[data.string]
length_m = 0.65
tension_n = 60.97
[recipe]
epochs = 1
batch_size = 10
[model_configuration]
state_size = 16
multiplier_widths = [8]
"""
HEARD = f"{','.join(COLUMNS)}\na,{'0' * 64},4,0.5,-1,0,0.1,,,1\n".encode()


TARGETS = (
    Target("settings.json", lambda p: Settings().model_dump_json().encode(), settings, (), json_or_bytes),
    Target("plan.toml", lambda p: PLAN, lambda p: load_plan(str(p)), (SchemaError,), toml_or_bytes),
    Target("run.toml", lambda p: CONFIGURATION, lambda p: load(str(p)), (SchemaError,), toml_or_bytes),
    Target(
        "string.toml", lambda p: (STRINGS / "steel_e4.toml").read_bytes(), read_string, (SchemaError,), toml_or_bytes
    ),
    Target("rows.csv", row_file, read_results, (SchemaError,)),
    Target("heard.csv", lambda p: HEARD, heard, ()),
    Target("checkpoint.safetensors", checkpoint, Checkpoint.load, (ValueError,)),
    Target("patch.json", lambda p: PATCH.read_bytes(), read_patch, (PatchError,), json_or_bytes),
    Target("song.mid", lambda p: SONG, song, (MidiFileError,)),
    Target("scale.scl", lambda p: SCALE, scala, (ValueError,), scala_or_bytes),
    Target("keys.kbm", lambda p: KEYMAP, scala, (ValueError,), scala_or_bytes),
    Target("float.wav", lambda p: impulse(p, "WAV", "FLOAT"), sounded, (ImpulseError,)),
    Target("pcm.wav", lambda p: impulse(p, "WAV", "PCM_16"), sounded, (ImpulseError,)),
    Target("body.flac", lambda p: impulse(p, "FLAC", "PCM_24"), sounded, (ImpulseError,)),
)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_readers(target: Target, tmp_path: Path, rounds: int, seed: int) -> None:
    folder = tmp_path / "there"
    folder.mkdir()
    whole, path = target.whole(tmp_path), folder / target.name
    path.write_bytes(whole)
    with contextlib.suppress(*target.errors):  # what is loaded once costs no later reading
        target.read(path)
    costs = Costs()

    def attack(draw: random.Random) -> None:
        path.write_bytes(target.damaged(whole, draw))
        try:
            with costs.reading():
                target.read(path)
        except target.errors as error:
            in_one_line(error, path)
        assert {each.name for each in folder.iterdir()} <= {target.name}

    attacked(target.name, rounds // len(TARGETS), seed, attack, costs)


@pytest.mark.parametrize("of", ["one string", "many strings"])
def test_recipes(of: str, small_preset: Path, tmp_path: Path, rounds: int, seed: int) -> None:
    file = small_preset if of == "one string" else SHIPPED / "studio_any_string.safetensors"
    preset = load_preset(file)
    whole, path = wav(tmp_path, recipe_text(file)), tmp_path / "stranger.wav"
    path.write_bytes(whole)
    read_recipe(path)
    costs = Costs()

    def attack(draw: random.Random) -> None:
        path.write_bytes(damaged_wav(whole, draw))
        try:
            with costs.reading():
                recipe = read_recipe(path)
            request_of(recipe, preset, path)
            assert recipe.settings.fade_out_s <= 600
        except RecipeError as error:
            in_one_line(error, path)

    attacked(f"recipes of {of}", rounds // 4, seed, attack, costs)


def test_what_is_dropped(
    small_preset: Path, tmp_path: Path, rounds: int, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sound is a recipe's, a recording, a body, or refused: its reader is chosen by what is in it."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    library = Library([])
    recorded = wav(tmp_path, played_text())
    wholes = (wav(tmp_path, recipe_text(small_preset)), recorded, impulse(tmp_path, "WAV", "PCM_16"))
    path = tmp_path / "recorded.wav"
    path.write_bytes(recorded)
    assert "is a recording of Classical guitar" in receive(path, library).notice
    path = tmp_path / "dropped.wav"

    def attack(draw: random.Random) -> None:
        path.write_bytes(damaged_wav(draw.choice(wholes), draw))
        dropped = receive(path, library)
        assert dropped.notice.isprintable() and len(dropped.notice) <= 600
        assert dropped.body in ("", "dropped") or dropped.body.startswith("dropped_")
        for body in own_bodies().glob("*"):
            body.unlink()

    attacked("dropped sounds", rounds // 16, seed, attack)


def test_damage_depends_on_its_seed_alone() -> None:
    """Or a failure could not be repeated: values that were put into one file were damaged for the next."""
    before = repr(HOSTILE)
    for number in range(400):
        damaged_value({"a": [1, 2], "b": {"c": 3}}, random.Random(number))
        assert repr(HOSTILE) == before, number


def test_a_whole_file_of_each_kind_is_read(small_preset: Path, tmp_path: Path) -> None:
    """Or the attack would show nothing."""
    for target in TARGETS[:-1]:
        path = tmp_path / target.name
        path.write_bytes(target.whole(tmp_path))
        target.read(path)
    (tmp_path / "whole.wav").write_bytes(wav(tmp_path, recipe_text(small_preset)))
    read_recipe(tmp_path / "whole.wav")
    use(small_preset, Costs())
    assert write(load(str(tmp_path / "run.toml")).data)["modes"] == 10


HUGE_BYTES = 3 * 2**30


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_a_huge_file_costs_little(target: Target, tmp_path: Path) -> None:
    """Its first bytes are those of a whole one; the rest, which takes no place on the disk, is zero."""
    folder = tmp_path / "there"
    folder.mkdir()
    path = folder / target.name
    path.write_bytes(target.whole(tmp_path))
    with contextlib.suppress(*target.errors):
        target.read(path)
    with path.open("r+b") as file:
        file.truncate(HUGE_BYTES)
    costs = Costs()
    with contextlib.suppress(*target.errors), costs.reading():
        target.read(path)
    assert (costs.largest_mb or 0) <= MOST_MB, costs


def test_what_a_reading_costs_is_measured() -> None:
    """Or the attack would show nothing of it."""
    costs = Costs()
    with costs.reading():
        np.ones(10_000_000)
    assert costs.largest_mb is None or 70 <= costs.largest_mb <= 100
