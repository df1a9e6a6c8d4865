"""A WAV's recipe on the command line: shown, and rendered again."""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import soundfile

from engine.presets import find_string, read_string
from engine.values.string import StringParameters

PLUCK = ("--position", 0.41, "--amplitude-mm", 3.3, "--seconds", 0.15)


@pytest.fixture
def installed(small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One shipped preset `good`, and a folder of the user's own that is not made yet."""
    shipped = tmp_path / "shipped"
    shipped.mkdir()
    shutil.copy(small_preset, shipped / "good.safetensors")
    monkeypatch.setattr("engine.presets.finding.SHIPPED", shipped)
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    return shipped / "good.safetensors"


@pytest.mark.parametrize(
    "more",
    [
        ["--bits", "16", "--rate", 44_100],
        ["--bits", "32f", "--normalise", "--pickup", "velocity"],
        ["--source", "both", "--shape", "triangular"],
        ["--source", "difference", "--difference-gain-db", 12, "--listen-right", 0.7],
        ["--decay-db", 10],
    ],
)
def test_a_recipe_makes_the_same_bytes(run, installed: Path, folder: Path, more: list[object]) -> None:
    first, again = folder / "first.wav", folder / "again.wav"
    assert run("render", "good", first, *PLUCK, *more).status == 0
    found = run("render", "--recipe", first, again)
    assert (found.status, found.out[: len(str(again))]) == (0, str(again))
    assert again.read_bytes() == first.read_bytes()


def test_without_a_name_it_lies_in_this_folder_and_replaces_nothing(
    run, installed: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = folder / "first.wav"
    run("render", "good", first, *PLUCK)
    monkeypatch.chdir(folder)
    assert run("render", "--recipe", "first.wav").status == 0
    assert (folder / "good_x0.41_a3.3_4000_model.wav").read_bytes() == first.read_bytes()
    assert "is there already" in run("render", "--recipe", "first.wav").failure


def test_a_preset_is_found_by_its_content_under_another_name(run, installed: Path, folder: Path) -> None:
    first, again = folder / "first.wav", folder / "again.wav"
    run("render", "good", first, *PLUCK)
    own = installed.parents[1] / "own"
    own.mkdir()
    installed.rename(own / "renamed.safetensors")
    found = run("render", "--recipe", first, again)
    assert found.status == 0
    assert "another version" not in found.err
    assert (soundfile.read(again)[0] == soundfile.read(first)[0]).all()
    assert "renamed.safetensors" in run("info", first).out


def test_another_version_of_a_preset_is_reported(run, installed: Path, folder: Path) -> None:
    first = folder / "first.wav"
    run("render", "good", first, *PLUCK)
    data = installed.read_bytes()
    installed.write_bytes(data.replace(b"A small string", b"A SMALL string"))
    os.utime(installed, ns=(1, 1))
    found = run("render", "--recipe", first, folder / "again.wav")
    assert found.status == 0
    assert "the preset good is not the one that made this file" in found.err


def test_a_recipe_whose_preset_is_gone_is_reported(run, installed: Path, folder: Path) -> None:
    first = folder / "first.wav"
    run("render", "good", first, *PLUCK)
    installed.unlink()
    assert "the preset good of this recipe is not here" in run("render", "--recipe", first, folder / "a.wav").failure
    assert "the preset is not here" in run("info", first).out


def test_info_shows_every_choice(run, installed: Path, folder: Path) -> None:
    first = folder / "first.wav"
    run("render", "good", first, *PLUCK, "--listen-right", 0.6)
    facts = json.loads(run("info", first, "--json").out)
    assert facts["pluck"] == {"position": 0.41, "amplitude_mm": 3.3, "shape": "gaussian", "width": 0.06}
    assert (facts["listen_right"], facts["preset"], facts["preset_file"]) == (0.6, "good", str(installed))
    shown = run("info", first)
    assert "pluck position      0.41\n" in shown.out
    assert "past its training" in shown.err


def test_files_without_a_usable_recipe_are_reported_in_one_line(run, folder: Path) -> None:
    path = folder / "foreign.wav"
    assert f"{path}: no sound file that can be read" in run("info", path).failure
    path.write_bytes(b"RIFF nothing")
    assert f"{path}: no sound file that can be read" in run("render", "--recipe", path).failure
    soundfile.write(path, np.zeros(10), 8000)
    assert f"{path}: has no recipe" in run("info", path).failure
    for comment, field in (
        ('{"format":2}', "format: "),
        ("{broken", "the text: "),
        ('{"program":"x"}', "field 'version' is missing"),
    ):
        with soundfile.SoundFile(path, "w", 8000, 1) as file:
            file.comment = comment
            file.write(np.zeros(10))
        failure = run("info", path).failure
        assert "its recipe cannot be used" in failure
        assert field in failure or "pluck" in failure


def test_recipe_and_other_choices_exclude_each_other(run, folder: Path) -> None:
    others = ("--position=0.3", "--source=model", "--bits=16", "--normalise", "--listen=0.37", "--shape=gaussian")
    for more in (("a", "b.wav"), *((other,) for other in others)):
        assert "--recipe: holds all" in run("render", "--recipe", "c.wav", *more).usage.replace("'", "")
    assert "PRESET: is missing" in run("render").usage.replace("'", "")
    assert "--seconds: is missing" in run(
        "render", "a", "b.wav", "--position", 0.3, "--amplitude-mm", 1
    ).usage.replace("'", "")


def forged(file: Path, path: Path, **changes: object) -> Path:
    """A WAV whose recipe says something else, as a stranger may send it."""
    with soundfile.SoundFile(file) as sound:
        recipe, samples, rate_hz = json.loads(sound.comment), sound.read(), sound.samplerate
    for name, value in changes.items():
        (recipe if name in recipe else recipe["pluck"])[name] = value
    with soundfile.SoundFile(path, "w", rate_hz, 1, "PCM_16", format="WAV") as sound:
        sound.comment = json.dumps(recipe)
        sound.write(samples)
    return path


@pytest.mark.parametrize("name", ["../escaped", "/tmp/escaped", "..", "a/../../b", "C:\\x", "\x1b[2J"])
def test_a_preset_name_of_a_recipe_is_never_a_path(
    run, installed: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    from app.export.files import default_file_name
    from engine.pluck import Pluck

    run("render", "good", folder / "first.wav", *PLUCK)
    bad = forged(folder / "first.wav", tmp_path / "bad.wav", preset=name)
    inside = tmp_path / "deep" / "inside"
    inside.mkdir(parents=True)
    monkeypatch.chdir(inside)
    before = set(tmp_path.rglob("*.wav"))
    assert run("render", "--recipe", bad).status == 0  # its digest is known
    (made,) = set(tmp_path.rglob("*.wav")) - before
    assert made.parent == inside
    plain = default_file_name(name, Pluck(), 48_000, "model")
    assert Path(plain).name == plain and plain.isprintable() and not plain.startswith(".") and "\\" not in plain


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"decay_db": 1e9}, "decay_db must lie in"),
        ({"difference_gain_db": -5}, "difference_gain_db must lie in"),
        ({"horizon_s": float("inf")}, "horizon_s"),
        ({"fade_out_s": 1e300}, "fade_out_s"),
        ({"position": 7}, "position must lie in"),
        ({"source": "both", "listen_right": 0.5}, "cannot share one file"),
    ],
)
def test_a_recipe_out_of_range_is_reported_with_its_file(
    run, installed: Path, folder: Path, tmp_path: Path, changes: dict[str, object], message: str
) -> None:
    run("render", "good", folder / "first.wav", *PLUCK)
    bad = forged(folder / "first.wav", tmp_path / "bad.wav", **changes)
    reported = run("render", "--recipe", bad, tmp_path / "again.wav").failure
    assert f"{bad}: its recipe cannot be used" in reported and message in reported
    assert not (tmp_path / "again.wav").exists()


def test_escapes_and_forged_lines_of_a_recipe_do_not_reach_the_terminal(
    run, installed: Path, folder: Path, tmp_path: Path
) -> None:
    run("render", "good", folder / "first.wav", *PLUCK)
    evil = "\x1b]0;owned\x07\nseconds  999\r\x9b2J\u202e"
    bad = forged(
        folder / "first.wav", tmp_path / "bad.wav", preset=evil, preset_sha256="0" * 64, program=evil, version=evil
    )
    shown = run("info", bad)
    assert shown.status == 0
    assert all(line.isprintable() for line in shown.out.splitlines())
    assert [line.split()[1] for line in shown.out.splitlines() if line.startswith("seconds ")] == ["0.15"]
    assert all(c.isprintable() or c == "\n" for c in run("info", bad, "--json").out)
    assert run("render", "--recipe", bad, tmp_path / "again.wav").failure.isprintable()


def test_a_recipe_holds_the_string_that_a_model_of_many_played(run, folder: Path, tmp_path: Path) -> None:
    """Its file may be gone: the eight parameters are in the recipe, and rate and modes beside them."""
    string, first, again = tmp_path / "mine.toml", folder / "first.wav", folder / "again.wav"
    string.write_bytes(find_string("steel_g3").read_bytes())
    reported = ("--string", string, "--rate", 44_100, "--modes", 30)
    assert run("render", "studio_any_string", first, *PLUCK, *reported).status == 0
    string.unlink()
    facts = json.loads(run("info", first, "--json").out)
    assert StringParameters(**facts["string"]) == read_string(find_string("steel_g3"))
    assert (facts["modes"], facts["preset_rate_hz"], facts["rate_hz"]) == (30, 44_100, 44_100)
    assert "string tension n" in run("info", first).out
    assert run("render", "--recipe", first, again).status == 0
    assert again.read_bytes() == first.read_bytes()
    own = folder / "own.wav"
    assert run("render", "studio_any_string", own, *PLUCK).status == 0
    assert own.read_bytes() != first.read_bytes()


def test_a_recipe_from_before_there_were_strings_is_rendered(run, installed: Path, folder: Path) -> None:
    first, old, again = folder / "first.wav", folder / "old.wav", folder / "again.wav"
    run("render", "good", first, *PLUCK, "--bits", "16")
    with soundfile.SoundFile(first) as sound:
        recipe = json.loads(sound.comment)
    assert recipe.pop("string") is None and recipe.pop("modes") is None
    with soundfile.SoundFile(old, "w", 4000, 1, "PCM_16", format="WAV") as sound:
        sound.comment = json.dumps(recipe)
        sound.write(np.zeros(10))
    assert run("render", "--recipe", old, again).status == 0
    assert again.read_bytes() == first.read_bytes()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tension_n": -1.0}, "string: string parameter tension_n must lie in"),
        ({"tension_n": "60"}, "string.tension_n"),
        ({"length_m": 1e9}, "length_m must lie in"),
        ({"colour": 1.0}, "unknown field 'colour'"),
        ({"damping_d1_kg_m_s": 900.0}, "overdamped"),
    ],
)
def test_an_impossible_string_of_a_recipe_is_reported(
    run, folder: Path, tmp_path: Path, changes: dict[str, object], message: str
) -> None:
    run("render", "studio_any_string", folder / "first.wav", *PLUCK)
    with soundfile.SoundFile(folder / "first.wav") as sound:
        string = json.loads(sound.comment)["string"]
    bad = forged(folder / "first.wav", tmp_path / "bad.wav", string=string | changes)
    reported = run("render", "--recipe", bad, tmp_path / "again.wav").failure
    assert f"{bad}: its recipe cannot be used" in reported and message in reported


@pytest.mark.parametrize("changes", [{"modes": 100}, {"modes": -1}, {"preset_rate_hz": 10**9}])
def test_modes_and_rate_of_a_recipe_are_bounded(
    run, folder: Path, tmp_path: Path, changes: dict[str, object]
) -> None:
    run("render", "studio_any_string", folder / "first.wav", *PLUCK)
    bad = forged(folder / "first.wav", tmp_path / "bad.wav", **changes)
    assert "its recipe cannot be used" in run("render", "--recipe", bad, tmp_path / "again.wav").failure


def test_a_string_beyond_the_family_is_rendered_to_a_file_and_reported(run, folder: Path, tmp_path: Path) -> None:
    text = find_string("steel_g3").read_text(encoding="utf-8")
    slack = re.sub("d3_kg_m_s = .*", "d3_kg_m_s = 1e-8", text.replace("tension_n = 74.173", "tension_n = 0.74173"))
    (tmp_path / "slack.toml").write_text(slack, encoding="utf-8")
    found = run("render", "studio_any_string", folder / "a.wav", *PLUCK, "--string", tmp_path / "slack.toml")
    assert found.status == 0
    assert "decay time near 3 kHz" in found.err and "raises the tension" in found.err
    heavy = slack.replace("d1_kg_m_s = 0.00098472", "d1_kg_m_s = 900.0")
    (tmp_path / "heavy.toml").write_text(heavy, encoding="utf-8")
    reported = run(
        "render", "studio_any_string", folder / "b.wav", *PLUCK, "--string", tmp_path / "heavy.toml"
    ).failure
    assert f"{tmp_path / 'heavy.toml'}: " in reported and "overdamped" in reported
    assert not (folder / "b.wav").exists()


def test_a_preset_of_one_string_plays_no_other(run, installed: Path, folder: Path) -> None:
    reported = run("render", "good", folder / "a.wav", *PLUCK, "--string", "steel_g3").failure
    assert "choose a preset of many strings" in reported
    assert "--recipe: holds all" in run("render", "--recipe", "c.wav", "--string", "steel_g3").usage.replace("'", "")
