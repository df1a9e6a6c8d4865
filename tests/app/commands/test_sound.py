"""Sounds that commands write: render, its recipes, play, and drums."""

from __future__ import annotations

import json
import os
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
from app.player.events import NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from app.shared.version import program_version
from engine.plain_text import name_text
from engine.pluck import Pluck
from engine.presets import SHIPPED as PRESETS
from engine.presets import find_string, read_string
from engine.values.string import StringParameters
from tests.app.commands.conftest import Outcome, Run

PLUCK = ("--position", 0.41, "--amplitude-mm", 3.3, "--seconds", 0.15)
MANY = "studio_any_string"


@pytest.mark.parametrize(
    ("more", "subtype", "rate_hz", "frames"),
    [
        (["--bits", "16", "--rate", 44_100], "PCM_16", 44_100, 6615),
        (["--bits", "32f", "--normalise", "--pickup", "velocity"], "FLOAT", 4000, 600),
        (["--source", "both", "--shape", "triangular"], "PCM_24", 4000, 600),
        (["--source", "difference", "--difference-gain-db", 12, "--listen-right", 0.7], "PCM_24", 4000, 600),
        (["--shape", "raised_cosine", "--width", 0.2, "--listen", 0.2, "--source", "truth"], "PCM_24", 4000, 600),
        (["--decay-db", 10], "PCM_24", 4000, None),
    ],
)
def test_a_file_has_what_was_asked_and_its_recipe_makes_the_same_bytes(
    run: Run, installed: Path, folder: Path, more: list[Any], subtype: str, rate_hz: int, frames: int | None
) -> None:
    first, again = folder / "first.wav", folder / "again.wav"
    assert run("render", "good", first, *PLUCK, *more).status == 0
    with soundfile.SoundFile(first) as file:
        recipe = json.loads(file.comment)
        assert (file.subtype, file.samplerate) == (subtype, rate_hz)
        assert frames in (None, file.frames)
    for option, value in zip(more, [*more[1:], None], strict=True):
        field = str(option).strip("-").replace("-", "_")
        assert not str(option).startswith("--") or value in (recipe | recipe["pluck"]).values() or recipe[field]
    assert list(folder.iterdir()) == [first]
    found = run("render", "--recipe", first, again)
    assert (found.status, found.out[: len(str(again))]) == (0, str(again))
    assert again.read_bytes() == first.read_bytes()


def test_the_difference_is_model_minus_truth_and_silence_is_explained(
    run: Run, small_preset: Path, folder: Path
) -> None:
    out, sounds = folder / "a.wav", {}
    for source in ("model", "truth", "difference"):
        assert run("render", small_preset, out, *PLUCK, "--source", source, "--bits", "32f").status == 0
        sounds[source], _ = soundfile.read(out)
    assert np.abs(sounds["difference"]).max() > 1e-3
    assert sounds["difference"] == pytest.approx(sounds["model"] - sounds["truth"], abs=1e-6)
    silent = run("render", small_preset, out, *PLUCK, "--source", "truth", "--amplitude-mm", 0)
    assert silent.status == 0 and "the file is silent; amplitude 0" in silent.err


@pytest.fixture
def first(run: Run, installed: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A sound of the preset `good`."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder.parent / "own"))
    assert run("render", "good", folder / "first.wav", *PLUCK, "--bits", "16").status == 0
    return folder / "first.wav"


def test_without_a_name_it_lies_in_this_folder_and_replaces_nothing(
    run: Run, first: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert run("render", "--recipe", "first.wav").status == 0
    assert (folder / "good_x0.41_a3.3_4000_model.wav").read_bytes() == first.read_bytes()
    assert "is there already" in run("render", "--recipe", "first.wav").failure
    assert run("render", "--recipe", "first.wav", "first.flac").status == 0
    assert run("render", "--recipe", "first.flac").status == 0
    flac = folder / "good_x0.41_a3.3_4000_model.flac"
    assert (soundfile.read(flac)[0] == soundfile.read(first)[0]).all() and flac.stat().st_size < first.stat().st_size


def test_a_preset_is_found_by_its_content_and_a_changed_or_lost_one_is_reported(
    run: Run, first: Path, installed: Path, folder: Path
) -> None:
    again, own = folder / "again.wav", folder.parent / "own" / "renamed.safetensors"
    own.parent.mkdir()
    (installed / "good.safetensors").rename(own)
    found = run("render", "--recipe", first, again)
    assert found.status == 0 and "the preset good" not in found.err
    assert (soundfile.read(again)[0] == soundfile.read(first)[0]).all()
    assert "renamed.safetensors" in run("info", first).out
    changed = installed / "good.safetensors"
    changed.write_bytes(own.read_bytes().replace(b"A small string", b"A SMALL string"))
    own.unlink()
    found = run("render", "--recipe", first, again)
    assert found.status == 0 and "the preset good is not the one that made this file" in found.err
    changed.unlink()
    assert "the preset good of this recipe is not here" in run("render", "--recipe", first, again).failure
    assert "the preset is not here" in run("info", first).out


def forged(file: Path, path: Path, keep: Callable[[str], bool] = lambda name: True, **changes: object) -> Path:
    """A WAV whose recipe says something else, as a stranger may send it, or has fewer fields."""
    with soundfile.SoundFile(file) as sound:
        recipe, samples, rate_hz = json.loads(sound.comment), sound.read(), sound.samplerate
    for name, value in changes.items():
        (recipe if name in recipe else recipe["pluck"])[name] = value
    with soundfile.SoundFile(path, "w", rate_hz, 1, "PCM_16", format="WAV") as sound:
        sound.comment = json.dumps({name: value for name, value in recipe.items() if keep(name)})
        sound.write(samples)
    return path


@pytest.mark.parametrize("name", ["../escaped", "/tmp/escaped", "..", "a/../../b", "C:\\x", "\x1b[2J"])
def test_a_preset_name_of_a_recipe_is_never_a_path(
    run: Run, first: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    bad = forged(first, tmp_path / "bad.wav", preset=name)
    inside = tmp_path / "deep" / "inside"
    inside.mkdir(parents=True)
    monkeypatch.chdir(inside)
    before = set(tmp_path.rglob("*.wav"))
    assert run("render", "--recipe", bad).status == 0  # its digest is known
    (made,) = set(tmp_path.rglob("*.wav")) - before
    assert made.parent == inside
    plain = default_file_name(name, Pluck(), 48_000, "model", ".wav")
    assert Path(plain).name == plain and plain.isprintable() and not plain.startswith(".") and "\\" not in plain


STRING = {  # of a recipe for a model of many strings
    "length_m": 0.65,
    "area_m2": 5e-7,
    "second_moment_m4": 1e-14,
    "density_kg_m3": 1140.0,
    "youngs_modulus_pa": 5e9,
    "damping_d1_kg_m_s": 1e-4,
    "damping_d3_kg_m_s": 1e-5,
    "tension_n": 60.0,
}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"decay_db": 1e9}, "decay_db must lie in"),
        ({"difference_gain_db": -5}, "difference_gain_db must lie in"),
        ({"horizon_s": float("inf")}, "horizon_s"),
        ({"fade_out_s": 1e300}, "fade_out_s"),
        ({"position": 7}, "position must lie in"),
        ({"source": "both", "listen_right": 0.5}, "cannot share one file"),
        ({"format": 2}, "format: "),
        ({"modes": -1}, "modes"),
        ({"preset_rate_hz": 10**9}, "preset_rate_hz"),
        ({"string": STRING | {"tension_n": -1.0}}, "string: string parameter tension_n must lie in"),
        ({"string": STRING | {"tension_n": "60"}}, "string.tension_n"),
        ({"string": STRING | {"length_m": 1e9}}, "length_m must lie in"),
        ({"string": STRING | {"colour": 1.0}}, "unknown field 'colour'"),
    ],
)
def test_a_recipe_out_of_range_is_reported_with_its_file(
    run: Run, first: Path, tmp_path: Path, changes: dict[str, object], message: str
) -> None:
    bad = forged(first, tmp_path / "bad.wav", **changes)
    reported = run("render", "--recipe", bad, tmp_path / "again.wav").failure
    assert f"{bad}: its recipe cannot be used" in reported and message in reported
    assert not (tmp_path / "again.wav").exists()


def test_escapes_and_forged_lines_of_a_recipe_do_not_reach_the_terminal(
    run: Run, first: Path, tmp_path: Path
) -> None:
    evil = "\x1b]0;owned\x07\nseconds  999\r\x9b2J\u202e"
    bad = forged(first, tmp_path / "bad.wav", preset=evil, preset_sha256="0" * 64, program=evil, version=evil)
    shown = run("info", bad)
    assert shown.status == 0
    assert all(line.isprintable() for line in shown.out.splitlines())
    assert [line.split()[1] for line in shown.out.splitlines() if line.startswith("seconds ")] == ["0.15"]
    assert all(c.isprintable() or c == "\n" for c in run("info", bad, "--json").out)
    assert run("render", "--recipe", bad, tmp_path / "again.wav").failure.isprintable()


def test_a_recipe_holds_the_string_that_a_model_of_many_played_and_an_old_one_has_none(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    """Its file may be gone: the eight parameters are in the recipe, and rate and modes beside them."""
    string, first, again = tmp_path / "mine.toml", folder / "first.wav", folder / "again.wav"
    string.write_bytes(find_string("steel_g3").read_bytes())
    reported = ("--string", string, "--rate", 44_100, "--modes", 30)
    assert run("render", MANY, first, *PLUCK, *reported).status == 0
    string.unlink()
    facts = json.loads(run("info", first, "--json").out)
    assert StringParameters(**facts["string"]) == read_string(find_string("steel_g3"))
    assert (facts["modes"], facts["preset_rate_hz"], facts["rate_hz"]) == (30, 44_100, 44_100)
    assert "string tension n" in run("info", first).out
    assert run("render", "--recipe", first, again).status == 0
    assert again.read_bytes() == first.read_bytes()
    assert run("render", MANY, again, *PLUCK).status == 0
    assert again.read_bytes() != first.read_bytes()
    heavy = forged(first, tmp_path / "heavy.wav", string=facts["string"] | {"damping_d1_kg_m_s": 900.0})
    assert "overdamped" in run("render", "--recipe", heavy, tmp_path / "none.wav").failure
    assert not (tmp_path / "none.wav").exists()


def test_a_recipe_from_before_there_were_strings_is_rendered(run: Run, first: Path, tmp_path: Path) -> None:
    old = forged(first, tmp_path / "old.wav", keep=lambda name: name not in ("string", "modes"))
    assert run("render", "--recipe", old, tmp_path / "again.wav").status == 0
    assert (tmp_path / "again.wav").read_bytes() == first.read_bytes()


# MIDI files

TONE = [TimedEvent(0.0, NoteOn(57, 90)), TimedEvent(0.2, NoteOff(57))]
Play = Callable[..., tuple[NDArray[np.float64], Outcome]]


@pytest.fixture
def play(run: Run, tmp_path: Path) -> Play:
    """Play events by an instrument, half a second: the sound, and what the command printed."""

    def played(events: list[TimedEvent], instrument: object, *more: object) -> tuple[NDArray[np.float64], Outcome]:
        midi, out = tmp_path / "one.mid", tmp_path / "one.wav"
        midi.write_bytes(midi_bytes(events))
        done = run("play", midi, "--instrument", instrument, "--out", out, "--seconds", "0.5", *more)
        assert done.status == 0, done.err
        return soundfile.read(out, always_2d=True)[0], done

    return played


def test_a_midi_file_is_played_by_model_and_truth_the_same_each_time_without_drums(play: Play) -> None:
    model, plain = play(TONE, "jazz_guitar")
    truth, _ = play(TONE, "jazz_guitar", "--source", "truth")
    again, with_drums = play([TimedEvent(0.0, NoteOn(40, 127, 9)), *TONE], "jazz_guitar")
    assert (again == model).all() and np.abs(model).max() > 0.01
    assert np.abs(model - truth).max() < 1e-4 * np.abs(truth).max()
    assert "one.mid is played without its drums (channel 10)" in with_drums.err
    assert "drums" not in plain.err


def test_parts_of_a_song_sound_together_as_each_alone_and_softer_where_they_would_clip(
    run: Run, tmp_path: Path
) -> None:
    out = tmp_path / "song.wav"

    def played(notes: dict[int, int], velocity: int, *more: str) -> tuple[NDArray[np.float64], Outcome]:
        """Notes by channel, of which the first two are a guitar's and a bass's."""
        song = [mido.Message("program_change", channel=channel, program=24 + 9 * channel) for channel in (0, 1)]
        song += [mido.Message("note_on", channel=n, note=key, velocity=velocity) for n, key in notes.items()]
        mido.MidiFile(tracks=[mido.MidiTrack(song)]).save(tmp_path / "song.mid")
        done = run("play", tmp_path / "song.mid", "--out", out, "--seconds", "0.3", "--bits", "32f", *more)
        assert done.status == 0, done.err
        return soundfile.read(out, always_2d=True)[0], done

    parts = {0: ("classical_guitar", 52), 1: ("electric_bass", 33), 9: ("concert_toms", 40)}
    alone = [played({n: key}, 60, "--instrument", name)[0] for n, (name, key) in parts.items()]
    together, done = played({n: key for n, (_, key) in parts.items()}, 60)
    assert np.abs(together - sum(alone)).max() < 1e-6 and all(np.abs(sound).max() > 1e-3 for sound in alone)
    assert done.out.splitlines()[:3] == [
        "channel 1, program 25 (guitar): Classical guitar",
        "channel 2, program 34 (bass): Electric bass",
        "channel 10, drums: Concert toms",
    ]
    assert "a rendering of Classical guitar + Electric bass + Concert toms" in run("info", out).err
    assert "softer" not in done.err
    loud, done = played(dict.fromkeys((0, *range(2, 9), *range(10, 16)), 52), 127)
    assert np.abs(loud).max() == pytest.approx(10 ** (-1 / 20), abs=1e-4) and "made softer by " in done.err


def test_a_body_that_is_not_here_is_reported_and_the_rest_is_played(play: Play, tmp_path: Path) -> None:
    instrument = json.loads((INSTRUMENTS / "classical_guitar.json").read_text(encoding="utf-8"))
    (tmp_path / "mine.json").write_text(json.dumps({**instrument, "body": {"name": "a cello", "mix": 0.5}}))
    sound, done = play(TONE, tmp_path / "mine.json")
    assert "is played without its body: the body a cello is not here" in done.err
    assert done.out.startswith(f"{tmp_path / 'one.wav'}: 0.5 s of model in ")
    assert abs(sound).max() > 0.01


def test_a_file_of_one_channel_sounds_in_chords_by_a_guitars_instrument(play: Play) -> None:
    def spectrum(*keys: int) -> NDArray[np.float64]:
        sound = play([TimedEvent(0.0, NoteOn(key, 90, 2)) for key in keys], "oud")[0][:, 0]
        return np.abs(np.fft.rfft(sound * np.hanning(len(sound))))

    together = spectrum(60, 64, 67)  # all on the oud's highest string
    for key in (60, 64, 67):
        near = round(0.5 * 440 * 2 ** ((key - 69) / 12))
        assert together[near - 2 : near + 3].max() > 0.5 * spectrum(key)[near - 2 : near + 3].max()


def test_info_names_the_instrument_that_played(run: Run, play: Play, tmp_path: Path) -> None:
    play(TONE, "jazz_guitar", "--source", "truth", "--rate", 44_100, "--bits", "16")
    out = tmp_path / "one.wav"
    facts = json.loads(run("info", out, "--json").out)
    assert facts["preset_file"] == str(PRESETS / f"{MANY}.safetensors")
    assert (facts["instrument"], facts["preset"], facts["source"]) == ("Jazz guitar", MANY, "truth")
    assert (facts["rate_hz"], facts["bits"], facts["midi"]) == (44_100, "16", "one.mid")
    assert (facts["version"], facts["recorded"]) == (program_version(), None)
    shown = run("info", out)
    assert "instrument          Jazz guitar\n" in shown.out
    assert "a rendering of Jazz guitar (the truth)" in shown.err
    again = run("render", "--recipe", out, tmp_path / "again.wav").failure
    assert f"{out}: is a rendering of Jazz guitar (the truth). It has no recipe to render again" in again


def test_a_blow_at_another_place_is_another_sound_and_model_and_truth_agree(run: Run, tmp_path: Path) -> None:
    sounds, out = {}, tmp_path / "a.wav"
    centre = ("--place", "0", "0")
    for name, options in {"own": (), "centre": centre, "truth": (*centre, "--source", "truth")}.items():
        assert run("drums", "render", "thin_bars", out, "--key", "72", "--seconds", "0.2", *options).status == 0
        sounds[name] = soundfile.read(out)[0]
    largest = np.abs(sounds["centre"]).max()
    assert largest > 0.01
    assert np.abs(sounds["own"] - sounds["centre"]).max() > 0.1 * largest
    assert np.abs(sounds["truth"] - sounds["centre"]).max() < 1e-3 * largest


# File names that are no UTF-8, as old archives have

CAFE = os.fsdecode(b"caf\xe9")
SAMPLED = ("--keys", "57-57", "--layers", "1", "--seconds", "0.2")
COMMANDS: tuple[tuple[str, ...], ...] = (
    ("play", "{}.mid", "--instrument", "{}.json", "--out", "{} out.wav", "--seconds", "0.1"),
    ("render", "{}.safetensors", "{} out.wav", "--position", "0.3", "--amplitude-mm", "2", "--seconds", "0.1"),
    ("render", "--recipe", "{} out.wav", "{} again.wav"),
    ("info", "{} out.wav"),
    ("sampled", "{}.json", "{} out.sfz", *SAMPLED),
    ("sampled", "{}.json", "{} out.sf2", *SAMPLED),
    ("predict", "{}.safetensors", "{}.npy", "{} out.npy", "--steps", "5"),
    ("simulate", "{}.npy", "{} out.npy", "--string", "linear", "--steps", "10", "--rate", "4000"),
    ("compare", "{}.safetensors", "--seconds", "0.1", "--position", "0.3", "--amplitude-mm", "2"),
    ("plugin", "{}.json", "--dry-run"),
    ("instruments", "{}.json"),
)


def test_names_that_are_no_utf_8_are_read_written_and_printed(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / CAFE
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("this system has no such names")
    (folder / f"{CAFE}.mid").write_bytes(midi_bytes(TONE))
    shutil.copy(INSTRUMENTS / "classical_guitar.json", folder / f"{CAFE}.json")
    preset = PRESETS / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
    shutil.copy(preset, folder / f"{CAFE}.safetensors")
    np.save(folder / f"{CAFE}.npy", 1e-3 * np.sin(np.pi * np.linspace(0, 1, 101))[None])
    for command in COMMANDS:
        words = [str(folder / word.format(CAFE)) if "{}" in word else word for word in command]
        found = run(*words)
        assert found.status == 0, found.err
        found.out.encode()
        assert all(Path(word).stat().st_size > 0 for word in words if " out." in word)
        assert [each for each in folder.iterdir() if each.name.startswith(".")] == []
    assert name_text(CAFE) == "caf\ufffd" and name_text("café.mid") == "café.mid"
    name_text("\ud800").encode()
