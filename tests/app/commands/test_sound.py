"""Sounds that commands write: render, its recipes, play, and drums."""

import io
import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mido
import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from app.export.note import default_file_name
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.player.events import NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from engine.plain_text import name_text
from engine.pluck import Pluck
from engine.presets import SHIPPED as PRESETS
from engine.presets import read_string
from engine.values.string import StringParameters
from tests.app.commands.conftest import EVENTS, STEEL_G3, Outcome, Run, with_recipe

PLUCK = "--position 0.41 --amplitude-mm 3.3 --seconds 0.15"
AGAIN = "render --recipe {folder}/first.wav {folder}/again.wav"
MANY = "studio_any_string"


@pytest.mark.parametrize(
    ("more", "subtype", "rate_hz", "frames"),
    [
        ("--bits 16 --rate 44100", "PCM_16", 44_100, 6615),
        ("--bits 32f --normalise --pickup velocity", "FLOAT", 4000, 600),
        ("--source both --shape triangular", "PCM_24", 4000, 600),
        ("--source difference --difference-gain-db 12 --listen-right 0.7", "PCM_24", 4000, 600),
        ("--shape raised_cosine --width 0.2 --listen 0.2 --source truth", "PCM_24", 4000, 600),
        ("--decay-db 10", "PCM_24", 4000, None),
    ],
)
@pytest.mark.usefixtures("installed")
def test_a_file_has_what_was_asked_and_its_recipe_makes_the_same_bytes(run, folder, more, subtype, rate_hz, frames):
    first, again = folder / "first.wav", folder / "again.wav"
    assert run(f"render good {{folder}}/first.wav {PLUCK} {more}").status == 0
    facts, recipe = soundfile.info(first), recipe_of(first)
    assert (facts.subtype, facts.samplerate) == (subtype, rate_hz)
    assert frames in (None, facts.frames)
    recipe |= recipe["pluck"] | recipe["ear"] | recipe["settings"]
    recipe |= dict(zip(("listen", "listen_right"), recipe["points"], strict=False))
    for option, value in re.findall(r"--(\S+) ?([^-\s]\S*)?", more):
        found = recipe[option.replace("-", "_").replace("rate", "rate_hz")]
        assert found == (type(found)(value) if value else True)
    assert list(folder.iterdir()) == [first]
    found = run(AGAIN)
    assert (found.status, found.out[: len(str(again))]) == (0, str(again))
    assert again.read_bytes() == first.read_bytes()


def test_the_difference_is_model_minus_truth_and_silence_is_explained(run, folder):
    render, sounds = f"render {{small_preset}} {{out}}.wav {PLUCK} --bits 32f --source", {}
    for source in ("model", "truth", "difference"):
        assert run(f"{render} {source}").status == 0
        sounds[source], _ = soundfile.read(folder / "out.wav")
    assert np.abs(sounds["difference"]).max() > 1e-3
    assert sounds["difference"] == pytest.approx(sounds["model"] - sounds["truth"], abs=1e-6)
    silent = run(f"{render} truth --amplitude-mm 0")
    assert silent.status == 0 and "the file is silent; amplitude 0" in silent.err


@pytest.fixture
def first(run: Run, installed: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A sound of the preset `good`."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder.parent / "own"))
    assert run(f"render good {{folder}}/first.wav {PLUCK} --bits 16").status == 0
    return folder / "first.wav"


def test_a_default_name_replaces_nothing(run, first, folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert run("render --recipe first.wav").status == 0
    assert (folder / "good_x0.41_a3.3_4000_model.wav").read_bytes() == first.read_bytes()
    assert "is there already" in run("render --recipe first.wav").failure
    assert [run(f"render --recipe {files}").status for files in ("first.wav first.flac", "first.flac")] == [0, 0]
    flac = folder / "good_x0.41_a3.3_4000_model.flac"
    assert (soundfile.read(flac)[0] == soundfile.read(first)[0]).all() and flac.stat().st_size < first.stat().st_size


def test_a_preset_is_found_by_its_content_or_missed(run, first, installed, folder):
    again, own = folder / "again.wav", folder.parent / "own" / "renamed.safetensors"
    own.parent.mkdir()
    (installed / "good.safetensors").rename(own)
    found = run(AGAIN)
    assert found.status == 0 and "the preset good" not in found.err
    assert (soundfile.read(again)[0] == soundfile.read(first)[0]).all()
    assert "renamed.safetensors" in run("info", first).out
    changed = installed / "good.safetensors"
    changed.write_bytes(own.read_bytes().replace(b"A small string", b"A SMALL string"))
    own.unlink()
    found = run(AGAIN)
    assert found.status == 0 and "the preset good is not the one that made this file" in found.err
    changed.unlink()
    assert "the preset good of this recipe is not here" in run(AGAIN).failure
    assert "the preset is not here" in run("info", first).out


def recipe_of(file: Path) -> dict[str, Any]:
    with soundfile.SoundFile(file) as sound:
        recipe: dict[str, Any] = json.loads(sound.comment)
        return recipe


def test_no_name_in_a_recipe_is_a_path(run, first, tmp_path, monkeypatch):
    inside = tmp_path / "deep" / "inside"
    inside.mkdir(parents=True)
    monkeypatch.chdir(inside)
    for name in ("../escaped", "/tmp/escaped", "..", "a/../../b", "C:\\x", "\x1b[2J"):
        facts = {field: value for field, value in recipe_of(first).items() if field not in ("string", "modes")}
        bad = with_recipe(tmp_path / "bad.wav", facts | {"preset": name})  # without fields, as an earlier one
        before = set(tmp_path.rglob("*.wav"))
        assert run("render --recipe", bad).status == 0  # its digest is known
        (made,) = set(tmp_path.rglob("*.wav")) - before
        assert made.parent == inside
        made.unlink()
        plain = default_file_name(name, Pluck(), 48_000, "model", ".wav")
        assert Path(plain).name == plain and plain.isprintable() and not plain.startswith(".") and "\\" not in plain


def test_escapes_of_a_recipe_do_not_reach_the_terminal(run, first, tmp_path):
    evil = "\x1b]0;owned\x07\nseconds  999\r\x9b2J\u202e"
    words = {"preset": evil, "preset_sha256": "0" * 64, "program": evil, "version": evil}
    bad = with_recipe(tmp_path / "bad.wav", recipe_of(first) | words)
    shown = run("info", bad)
    assert shown.status == 0
    assert all(line.isprintable() for line in shown.out.splitlines())
    assert [line.split()[1] for line in shown.out.splitlines() if line.startswith("seconds ")] == ["0.15"]
    assert all(c.isprintable() or c == "\n" for c in run("info --json", bad).out)
    assert run("render --recipe", bad, tmp_path / "again.wav").failure.isprintable()


def test_a_recipe_holds_the_string_that_a_model_of_many_played(run, folder, tmp_path):
    """Its file may be gone: the eight parameters are in the recipe, and rate and modes beside them."""
    string, first, again = tmp_path / "mine.toml", folder / "first.wav", folder / "again.wav"
    string.write_bytes(STEEL_G3.read_bytes())
    render = f"render {MANY} {{folder}}/first.wav {PLUCK}"
    assert run(f"{render} --rate 44100 --modes 30 --string", string).status == 0
    string.unlink()
    facts = json.loads(run("info --json", first).out)
    assert StringParameters(**facts["string"]) == read_string(STEEL_G3)
    assert (facts["modes"], facts["preset_rate_hz"], facts["settings"]["rate_hz"]) == (30, 44_100, 44_100)
    assert "string tension n" in run("info", first).out
    assert run(AGAIN).status == 0
    assert again.read_bytes() == first.read_bytes()
    assert run(render).status == 0
    assert again.read_bytes() != first.read_bytes()


# MIDI files

Play = Callable[..., tuple[NDArray[np.float64], Outcome]]


@pytest.fixture
def play(run: Run, tmp_path: Path) -> Play:
    """Play a MIDI file for half a second: the sound, and what the command printed."""

    def played(midi: bytes, more: str = "") -> tuple[NDArray[np.float64], Outcome]:
        (tmp_path / "one.mid").write_bytes(midi)
        done = run(f"play {{tmp_path}}/one.mid --out {{out}}.wav --seconds 0.5 {more}")
        assert done.status == 0, done.err
        return soundfile.read(tmp_path / "results" / "out.wav", always_2d=True)[0], done

    return played


def test_a_midi_file_is_played_by_model_and_truth_the_same_each_time_without_drums(play):
    guitar, tone = "--instrument jazz_guitar", midi_bytes(EVENTS)
    model, plain = play(tone, guitar)
    truth, _ = play(tone, f"{guitar} --source truth")
    again, with_drums = play(midi_bytes([TimedEvent(0.0, NoteOn(40, 127, 9)), *EVENTS]), guitar)
    assert (again == model).all() and np.abs(model).max() > 0.01
    assert np.abs(model - truth).max() < 1e-4 * np.abs(truth).max()
    assert "one.mid is played without its drums (channel 10)" in with_drums.err
    assert "drums" not in plain.err


def song(notes: dict[int, int], velocity: int) -> bytes:
    """Notes by channel, of which the first two are a guitar's and a bass's."""
    messages = [mido.Message("program_change", channel=channel, program=24 + 9 * channel) for channel in (0, 1)]
    messages += [mido.Message("note_on", channel=n, note=key, velocity=velocity) for n, key in notes.items()]
    mido.MidiFile(tracks=[mido.MidiTrack(messages)]).save(file=(data := io.BytesIO()))
    return data.getvalue()


def test_parts_of_a_song_sound_together_as_each_alone_and_softer_where_they_would_clip(run, play):
    parts = {0: (52, "classical_guitar"), 1: (33, "electric_bass"), 9: (40, "concert_toms")}
    alone = [play(song({n: key}, 60), f"--bits 32f --instrument {name}")[0] for n, (key, name) in parts.items()]
    together, done = play(song({n: key for n, (key, _) in parts.items()}, 60), "--bits 32f")
    assert np.abs(together - sum(alone)).max() < 1e-6 and all(np.abs(sound).max() > 1e-3 for sound in alone)
    assert done.out.splitlines()[:3] == [
        "channel 1, program 25 (guitar): Classical guitar",
        "channel 2, program 34 (bass): Electric bass",
        "channel 10, drums: Concert toms",
    ]
    assert "a rendering of Classical guitar + Electric bass + Concert toms" in run("info {out}.wav").err
    assert "softer" not in done.err
    loud, done = play(song(dict.fromkeys((0, *range(2, 9), *range(10, 16)), 52), 127), "--bits 32f")
    assert np.abs(loud).max() == pytest.approx(10 ** (-1 / 20), abs=1e-4) and "made softer by " in done.err


def test_a_body_that_is_not_here_is_reported_and_the_rest_is_played(play, tmp_path):
    instrument = json.loads((INSTRUMENTS / "classical_guitar.json").read_text(encoding="utf-8"))
    (tmp_path / "mine.json").write_text(json.dumps({**instrument, "body": {"name": "a cello", "mix": 0.5}}))
    sound, done = play(midi_bytes(EVENTS), "--instrument {tmp_path}/mine.json")
    assert "is played without its body: the body a cello is not here" in done.err
    assert abs(sound).max() > 0.01


# File names that are no UTF-8, as old archives have

CAFE = os.fsdecode(b"caf\xe9")
COMMANDS = """
play {}.mid --instrument {}.json --out {}_out.wav --seconds 0.1
render {}.safetensors {}_out.wav --position 0.3 --amplitude-mm 2 --seconds 0.1
render --recipe {}_out.wav {}_again.wav
info {}_out.wav
sampled {}.json {}_out.sfz --keys 57-57 --layers 1 --seconds 0.2
sampled {}.json {}_out.sf2 --keys 57-57 --layers 1 --seconds 0.2
predict {}.safetensors {}.npy {}_out.npy --steps 5
simulate {}.npy {}_out.npy --string linear --steps 10 --rate 4000
compare {}.safetensors --seconds 0.1 --position 0.3 --amplitude-mm 2
plugin {}.json --dry-run
instruments {}.json
"""


def test_names_that_are_no_utf_8_are_read_written_and_printed(run, tmp_path):
    folder = tmp_path / CAFE
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("this system has no such names")
    (folder / f"{CAFE}.mid").write_bytes(midi_bytes(EVENTS))
    shutil.copy(INSTRUMENTS / "classical_guitar.json", folder / f"{CAFE}.json")
    preset = PRESETS / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
    shutil.copy(preset, folder / f"{CAFE}.safetensors")
    np.save(folder / f"{CAFE}.npy", 1e-3 * np.sin(np.pi * np.linspace(0, 1, 101))[None])
    for command in COMMANDS.strip().splitlines():
        words = command.format(*[folder / CAFE] * 3).split()
        found = run(*words)
        assert found.status == 0, found.err
        found.out.encode()
        assert all(Path(word).stat().st_size > 0 for word in words if "_out." in word)
        assert [each for each in folder.iterdir() if each.name.startswith(".")] == []
    assert name_text(CAFE) == "caf\ufffd" and name_text("café.mid") == "café.mid"
    name_text("\ud800").encode()
