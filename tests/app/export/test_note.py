"""Notes as files: what a device is given, whole or not at all, rendered again by their recipes; also of models."""

import csv
import errno
import hashlib
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
import torch

from app.export import compared, sound
from app.export.choices import ExportChoices
from app.export.compared import TABLE, ComparedExport, ComparedModels
from app.export.note import HeardNote, NoteExport, default_file_name, export_sounds, musical_name
from app.export.recipe import SoundRecipe, read_recipe
from app.export.sound import VOICES, Voices
from app.export.wav import WavSettings
from app.instruments.library import find_instrument
from app.player.events import NoteOn, TimedEvent
from app.player.offline import render_events
from app.playing.ahead_samples import AheadSamples
from app.rendering.motion import ModelMotion
from app.rendering.note_sound import NoteSound, Struck
from app.rendering.subject import StringOf
from app.shared.vocabulary import FORMATS, Source
from app.shared.worker import Cancelled
from engine.kernels.limiter import AHEAD
from engine.levels import FULL_SCALE_M, MATCHED_S
from engine.pluck import Pluck
from engine.presets import SHIPPED, PresetError, load_preset, save_preset
from engine.resonators.sine_transform import listening_weights, project
from engine.sources import ModelSource, TruthSource
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, truth_program
from engine.voices.voice import ATTACK_S
from engine.whole_file import WriteError
from tests.app.sounds import export_sound, render_sound

PLAIN = WavSettings("32f", fade_out_s=0)
COMPILED = SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
RENDERED = SHIPPED / "nylon_nonlinear_gaussian_16k_lru.safetensors"
MANY = SHIPPED / "studio_any_string.safetensors"
GUITAR = find_instrument("Classical guitar").instrument
FIXED = ExportChoices(until_decayed=False, seconds=0.3, format="wav 32f", normalise=False)
OF_COMPILED = NoteSound(COMPILED, Pluck(0.35, 4.0), 0.2, Ear((0.37,)))


@pytest.fixture
def plucked(small_preset: Path) -> NoteSound:
    return replace(OF_COMPILED, preset=small_preset)


@pytest.mark.parametrize("kind", ["model", "truth"])
def test_the_sound_is_the_whole_motion_at_the_listening_point_behind_its_attack(plucked, kind):
    preset = plucked.load()
    source = ModelSource(preset) if kind == "model" else TruthSource(preset.info)
    start_m = project(plucked.pluck.displacement(101), 10)
    frames, _ = source.advance(source.start(start_m[None]), 799)
    whole_m = np.concatenate([start_m[None], frames[0]]) @ listening_weights(np.array([0.37]), 101)[:, 0]
    found = render_sound(plucked, kind)
    assert len(found) == 800
    attack = round(ATTACK_S * preset.info.rate_hz)
    assert found[attack:] == pytest.approx(whole_m[attack:] / FULL_SCALE_M, abs=2e-5)
    assert (np.abs(found[:attack]) < np.abs(whole_m[:attack]) / FULL_SCALE_M).all()


@pytest.mark.parametrize(("preset", "kind"), [("compiled", "model"), ("compiled", "truth"), ("small", "model")])
@pytest.mark.parametrize("ear", [Ear((0.37,)), Ear((0.37, 0.6), "velocity")])
def test_what_is_exported_is_what_a_device_is_given_bit_for_bit(plucked, preset, kind, ear, tmp_path):
    sound = replace(OF_COMPILED if preset == "compiled" else plucked, ear=ear)
    loaded = sound.load()
    info = loaded.info
    export_sound(sound, tmp_path / "a.wav", kind, WavSettings("32f", 48_000, fade_out_s=0))
    exported, _ = soundfile.read(tmp_path / "a.wav", dtype="float32", always_2d=True)
    program = truth_program(info, 48_000) if kind == "truth" else model_program(loaded, 48_000)
    assert program.rendered == (preset == "small")
    initial_m = project(sound.pluck.displacement(101), info.modes)
    voice = Voice(program, initial_m, ear, 1.0, 0.4, info.rate_hz)
    if program.rendered:
        ahead = AheadSamples(voice, ModelMotion(ModelSource(loaded), initial_m, 0.4), "pluck")
        while not ahead.finished:
            ahead.render()
    mixer = Mixer(48_000)
    mixer.add(voice)
    played = np.concatenate([mixer.render(frames) for frames in (256, 100, 7, 9237)])
    assert (played[AHEAD:, : len(ear.points)] == exported[:-AHEAD]).all()  # the limiter looks ahead
    assert not played[:AHEAD].any()


STEPS = {"16": ("PCM_16", 1.5 / 2**15), "24": ("PCM_24", 0.5 / 2**23), "32f": ("FLOAT", 1e-7)}


@pytest.mark.parametrize(("ending", "bits"), [name.split() for name in FORMATS])
def test_a_file_holds_the_sound_to_its_own_step_and_its_recipe(plucked, ending, bits, tmp_path):
    path = tmp_path / f"a.{ending}"
    settings = WavSettings(bits, fade_out_s=0)
    report = export_sound(plucked, path, settings=settings)
    expected = render_sound(plucked)
    with soundfile.SoundFile(path) as file:
        found = file.read(dtype="float64")
        recipe = json.loads(file.comment)
        assert (file.title, file.samplerate, file.format) == ("A small string", 4000, ending.upper())
        assert file.software.startswith("Learned Strings ")
        subtype, step = STEPS[bits]
        assert file.subtype == subtype and np.abs(found - expected).max() <= step * (1 + 1e-9)
    assert (report.frames, report.rate_hz, report.clipped) == (800, 4000, 0)
    assert report.peak_db == pytest.approx(20 * np.log10(np.abs(expected).max()))
    assert recipe == json.loads(SoundRecipe.of(plucked, plucked.load(), "model", settings).model_dump_json())
    assert recipe["preset_sha256"] == hashlib.sha256(plucked.load().path.read_bytes()).hexdigest()
    assert Pluck(**recipe["pluck"]) == plucked.pluck
    if ending == "flac":  # it holds the very samples
        wav = export_sound(plucked, tmp_path / "a.wav", settings=settings).path
        np.testing.assert_array_equal(*(soundfile.read(each, dtype="int32")[0] for each in (path, wav)))
        assert read_recipe(path) == read_recipe(wav)


def test_the_gain_of_files_is_one_which_does_not_depend_on_what_is_written_beside(plucked, tmp_path):
    model, truth = (render_sound(plucked, source) for source in VOICES)
    assert (render_sound(plucked, "both") == np.stack([model, truth], axis=1)).all()
    difference, loud = (
        render_sound(plucked, "difference", WavSettings(difference_gain_db=gain_db)) for gain_db in (0.0, 20.0)
    )
    assert (difference == model - truth).all() and loud == pytest.approx(10 * difference)
    paths = {source: tmp_path / f"{source}.wav" for source in ("model", "truth", "difference")}
    for gain_db in (80.0, 0.0):
        settings = replace(PLAIN, normalise=True, difference_gain_db=gain_db)
        reports = export_sounds(plucked, plucked.load(), paths, settings)  # type: ignore[arg-type]
        for source, path in paths.items():
            export_sound(plucked, tmp_path / "alone.wav", source, settings)  # type: ignore[arg-type]
            assert (tmp_path / "alone.wav").read_bytes() == path.read_bytes()
    assert [report.path for report in reports] == list(paths.values())
    assert len({report.gain_db for report in reports}) == 1
    m, t, d = (soundfile.read(path)[0] for path in paths.values())
    assert d == pytest.approx(m - t, abs=1e-6)
    assert max(np.abs(m).max(), np.abs(t).max()) == pytest.approx(10 ** (-1 / 20), rel=1e-6)


def test_where_an_export_fails_what_was_there_stays(plucked, tmp_path, monkeypatch):
    path, preset = tmp_path / "a.wav", plucked.load()
    path.write_bytes(b"old")

    def fail(*_: object, **__: object) -> None:
        raise errors.pop()

    def refused(error: type[Exception], words: str, preset=preset, progress: Callable = lambda *_: None) -> None:
        with pytest.raises(error, match=words):
            export_sounds(plucked, preset, {"model": path}, PLAIN, progress)
        assert path.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [path]

    errors = [OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), Cancelled()]
    refused(Cancelled, "^$", progress=fail)
    gone = replace(preset, path=tmp_path / "gone.safetensors")
    refused(PresetError, r"gone\.safetensors: the preset cannot be read any more", gone)
    with monkeypatch.context() as full:
        full.setattr(Path, "replace", fail)
        refused(WriteError, r"a\.wav: cannot be written .*; free some space")
    broken = Voices({"model": np.array([[np.inf]])})
    monkeypatch.setattr("app.export.note.render_voices", lambda *_, **__: broken)
    refused(WriteError, r"a\.wav: .*not finite")


def test_a_decay_ends_where_it_is_so_far_down_and_files_of_one_have_one_length(plucked, tmp_path):
    rate_hz, rate = 1000, 10.0  # 1/s: 86.9 dB in a second
    signal = np.exp(-rate * np.arange(3000) / rate_hz)[:, None]
    assert sound.decayed_frames(signal, rate_hz, 60.0) / rate_hz == pytest.approx(6.9 / rate, abs=0.06)
    assert sound.decayed_frames(signal[:200], rate_hz, 60.0) == 200
    assert sound.decayed_frames(np.zeros((500, 1)), rate_hz, 60.0) == 50
    decaying, settings = replace(plucked, seconds=8.0), WavSettings(decay_db=10.0)
    model, truth = (export_sound(decaying, tmp_path / "a.wav", source, settings) for source in VOICES)
    assert model.frames == truth.frames < 8 * 4000
    assert model.decayed
    assert truth.past_training_s == 0 < model.past_training_s
    assert not export_sound(replace(decaying, seconds=0.1), tmp_path / "a.wav", settings=settings).decayed


# Recipes, names and keys


RECIPES = Path(__file__).with_name("recipes")


def test_recipes_of_earlier_files_are_read():
    """Texts that version 0.2.0 wrote."""
    recipe = SoundRecipe.model_validate_json((RECIPES / "string.json").read_bytes())
    sound = recipe.sound(MANY, Path("a.wav"))
    assert isinstance(sound.preset, StringOf) and sound.preset.string.tension_n == 72.592
    assert (sound.load().info.modes, sound.load().info.rate_hz) == (12, 48_000)
    assert (sound.pluck, sound.ear, sound.seconds) == (Pluck(0.3, 2.0, "rounded", 0.1), Ear((0.37,), "bridge"), 0.3)
    assert recipe.settings == WavSettings("24", 44_100, fade_out_s=0.01)
    recipe = SoundRecipe.model_validate_json((RECIPES / "key.json").read_bytes())
    sound = recipe.sound(MANY, Path("a.wav"))
    assert sound.struck == Struck(GUITAR, NoteOn(52, 90, 16, string=1, pluck=Pluck(0.2, 2.0)))
    assert (sound.preset, sound.ear, sound.seconds) == (MANY, Ear((0.1, 0.6), "velocity"), 9.0)
    assert recipe.settings == WavSettings("16", 48_000, True, 0.05, 60.0, 20.0)


@pytest.mark.parametrize(
    ("title", "first_hz", "amplitude_mm", "name"),
    [
        ("Steel-string acoustic", 164.8, 0.2, "Steel-string acoustic E3 soft"),
        ("Nylon B3, 16 kHz", 246.9, 1.0, "Nylon B3 medium"),
        ("Harp <1/2>", 92.5, 9.0, "Harp 1 2 F#2 hard"),
        ("..", 20_000.0, 0.0, "Note 20000 Hz soft"),
    ],
)
def test_a_file_is_named_as_musicians_would(title, first_hz, amplitude_mm, name):
    assert musical_name(title, first_hz, 0.1, 10.0, amplitude_mm) == name
    heard = HeardNote(OF_COMPILED, "model", False, 20.0, "", name, 4_000)
    assert [heard.file_name(source, ".wav") for source in VOICES] == [f"{name}.wav", f"{name} truth.wav"]
    assert default_file_name("nylon", Pluck(0.35, 4), 48_000, "truth", ".wav") == "nylon_x0.35_a4.0_48000_truth.wav"
    assert default_file_name("b", Pluck(0.1234, 0.25), 4000, "both", ".wav") == "b_x0.1234_a0.25_4000_both.wav"


def write(path: Path, struck: Struck | None, choices: ExportChoices = FIXED, source: Source = "model") -> np.ndarray:
    sound = replace(OF_COMPILED, preset=MANY, struck=struck)
    NoteExport(sound, {source: path}, choices).run(lambda *_: None)
    return soundfile.read(path, dtype="float32", always_2d=True)[0]


def test_a_key_can_be_written_without_its_instrument(tmp_path):
    struck = Struck(GUITAR, NoteOn(52, 100))
    alone = FIXED.model_copy(update={"alone": True})
    assert (write(tmp_path / "b.wav", struck, alone) == write(tmp_path / "a.wav", None)).all()
    assert write(tmp_path / "c.wav", struck).shape[1] == 2


def test_the_difference_of_a_key_has_neither_amplifier_nor_body(tmp_path):
    """It is as loud as those of the key's own model and truth: its gain is that of the whole instrument."""
    electric = find_instrument("Electric guitar, bridge pick-up").instrument
    assert electric.amp.drive_db > 0
    event, how = NoteOn(52, 100), {"limited": False, "varied": False, "dry": True}
    found = write(tmp_path / "a.wav", Struck(electric, event), source="difference")
    model, truth = (
        np.concatenate(
            [*render_events(electric, load_preset(MANY), [TimedEvent(0, event)], 48_000, voice, 0.3, **how)]
        )
        for voice in VOICES
    )
    until = len(found) - round(0.010 * 48_000)
    expected = 10 ** (FIXED.difference_gain_db / 20) * (model.astype(np.float64) - truth)
    np.testing.assert_allclose(found[:until], expected[:until], atol=1e-9)
    assert np.abs(found).max() > 0


# Models on one pluck as a folder


@pytest.fixture
def job(small_preset: Path, tmp_path: Path) -> ComparedExport:
    """Three models: half as loud, as it is, and one that runs away."""
    lines = []
    for name, factor, offset in (("soft", 0.5, 0.0), ("small", 1.0, 0.0), ("wild", 1.0, 1e6)):
        path = tmp_path / f"{name}.safetensors"
        shutil.copy(small_preset, path)
        preset = load_preset(path)
        decoder: Any = preset.model.decoder  # type: ignore[union-attr]
        with torch.no_grad():
            decoder.weight.mul_(factor)
            decoder.bias.add_(offset)
        save_preset(path, preset.info, preset.model)
        lines.append((NoteSound(path, Pluck(0.5, 4.0), 1.5, Ear((0.37, 0.6))), {"preset": "=1+1", "rel_mae": 0.5}))
    return ComparedExport(ComparedModels("", "", lines), tmp_path / "out", PLAIN)


@pytest.mark.parametrize("match", [False, True])
def test_each_model_has_its_files_and_its_level_is_matched_where_it_is_chosen(job, tmp_path, match):
    shares: list[float] = []
    job = replace(job, settings=replace(job.settings, level_match=match))
    said = job.run(lambda share, *_: shares.append(share))
    assert "2 models" in said and "Ran away" in said and shares == sorted(shares)
    with (job.file / TABLE).open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    for line, factor in zip(table, (0.5, 1.0), strict=False):
        sounds = [soundfile.read(job.file / line[f"{name}_file"])[0] for name in compared.SOURCES]
        model, truth, difference = sounds
        assert difference == pytest.approx(model - truth, abs=1e-6)
        levels = [np.sqrt(np.square(sound[: round(MATCHED_S * 4000)]).mean()) for sound in (model, truth)]
        assert levels[0] / levels[1] == pytest.approx(1.0 if match else factor, rel=1e-4 if match else 0.1)
    assert [line["model_file"] for line in table[2:]] == [""], "the one that runs away has a line alone"
    assert {line["preset"] for line in table} == {"'=1+1"}, "no formula for a spreadsheet"
    listed = {line[f"{name}_file"] for line in table[:2] for name in compared.SOURCES}
    assert {path.name for path in job.file.iterdir()} == listed | {TABLE} and len(listed) == 6
    for source in compared.SOURCES:
        first, again = job.file / table[0][f"{source}_file"], tmp_path / "again.wav"
        recipe = read_recipe(first)
        assert recipe.settings.level_match == match
        sound = recipe.sound(job.models.lines[0][0].preset, first)  # type: ignore[arg-type]
        export_sound(sound, again, recipe.source, recipe.settings)
        assert first.read_bytes() == again.read_bytes()


def test_a_folder_that_is_there_stays_and_what_is_not_whole_is_not_left(job, tmp_path, monkeypatch):
    def cancel(share: float, *_: object) -> None:
        if share > 0.4:
            raise Cancelled

    with pytest.raises(Cancelled):
        job.run(cancel)
    monkeypatch.setattr(compared, "Columns", lambda _: exec("raise OSError(errno.ENOSPC, 'full')", {"errno": errno}))
    with pytest.raises(WriteError, match=r"out: cannot be written \(full\); free some space"):
        job.run(lambda *_: None)
    assert {path.suffix for path in tmp_path.iterdir()} == {".safetensors"}
    with pytest.raises(WriteError, match="none: no such folder"):
        replace(job, file=tmp_path / "none" / "out").run(lambda *_: None)
    job.file.mkdir()
    with pytest.raises(WriteError, match="is there already"):
        job.run(lambda *_: None)
    assert list(job.file.iterdir()) == []
