from __future__ import annotations

import errno
import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.export import sound
from app.export.note import (
    default_file_name,
    export_sounds,
)
from app.export.recipe import SoundRecipe, read_recipe
from app.export.sound import VOICES, Voices, check_sources
from app.export.wav import WavSettings
from app.playing.ahead import AheadSamples
from app.rendering.motion import ModelMotion
from app.rendering.note_sound import NoteSound
from app.shared.vocabulary import FORMATS, Bits, Source
from app.shared.worker import Cancelled
from engine.kernels.limiter import AHEAD
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S
from engine.pluck import Pluck
from engine.presets import SHIPPED, PresetError
from engine.resonators.sine_transform import listening_weights, project
from engine.sources import ModelSource, TruthSource
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, truth_program
from engine.voices.voice import ATTACK_S
from engine.whole_file import WriteError
from tests.app.sounds import export_sound, render_sound

PLAIN = WavSettings("32f", fade_out_s=0)


@pytest.fixture
def plucked(small_preset: Path) -> NoteSound:
    return NoteSound(small_preset, Pluck(0.35, 4.0), 0.2, Ear((0.37,)))


@pytest.mark.parametrize("kind", ["model", "truth"])
def test_the_sound_is_the_whole_motion_at_the_listening_point_behind_its_attack(
    plucked: NoteSound, kind: Source
) -> None:
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


COMPILED = SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"


@pytest.mark.parametrize(("preset", "kind"), [("compiled", "model"), ("compiled", "truth"), ("small", "model")])
def test_what_is_exported_is_what_a_device_is_given_bit_for_bit(
    plucked: NoteSound, preset: str, kind: Source, tmp_path: Path
) -> None:
    sound = replace(plucked, preset=COMPILED) if preset == "compiled" else plucked
    loaded = sound.load()
    info = loaded.info
    export_sound(sound, tmp_path / "a.wav", kind, WavSettings("32f", 48_000, fade_out_s=0))
    exported, _ = soundfile.read(tmp_path / "a.wav", dtype="float32")
    program = truth_program(info, 48_000) if kind == "truth" else model_program(loaded, 48_000)
    assert program.rendered == (preset == "small")
    initial_m, ear = project(sound.pluck.displacement(101), info.modes), Ear((0.37,))
    voice = Voice(program, initial_m, ear, 1.0, 0.4, info.rate_hz)
    if program.rendered:
        ahead = AheadSamples(voice, ModelMotion(ModelSource(loaded), initial_m, 0.4), "pluck")
        while not ahead.finished:
            ahead.render()
    mixer = Mixer(48_000)
    mixer.add(voice)
    played = np.concatenate([mixer.render(frames) for frames in (256, 100, 7, 9237)])
    assert (played[AHEAD:, 0] == exported[:-AHEAD]).all()  # the limiter looks ahead
    assert not played[:AHEAD].any()


@pytest.mark.parametrize(("ending", "bits"), [name.split() for name in FORMATS])
def test_a_file_holds_the_sound_and_its_recipe(plucked: NoteSound, ending: str, bits: Bits, tmp_path: Path) -> None:
    path = tmp_path / f"a.{ending}"
    settings = WavSettings(bits, fade_out_s=0)
    report = export_sound(plucked, path, settings=settings)
    expected = render_sound(plucked)
    with soundfile.SoundFile(path) as file:
        found = file.read(dtype="float64")
        recipe = json.loads(file.comment)
        assert (file.title, file.samplerate, file.format) == ("A small string", 4000, ending.upper())
        assert file.software.startswith("Learned Strings ")
    assert np.abs(found - expected).max() < {"16": 5e-5, "24": 1e-7, "32f": 1e-7}[bits]
    assert (report.frames, report.rate_hz, report.clipped) == (800, 4000, 0)
    assert report.peak_db == pytest.approx(20 * np.log10(np.abs(expected).max()))
    assert recipe == json.loads(SoundRecipe.of(plucked, plucked.load(), "model", settings).model_dump_json())
    assert recipe["preset_sha256"] == hashlib.sha256(plucked.load().path.read_bytes()).hexdigest()
    assert Pluck(**recipe["pluck"]) == plucked.pluck


def test_flac_holds_the_very_samples_of_wav_and_refuses_what_it_cannot_hold(
    plucked: NoteSound, tmp_path: Path
) -> None:
    formats: tuple[tuple[Bits, bool], ...] = (("16", True), ("24", False))
    for bits, normalise in formats:
        for ending in ("wav", "flac"):
            export_sound(plucked, tmp_path / f"a.{ending}", settings=WavSettings(bits, normalise=normalise))
        wav, flac = (soundfile.read(tmp_path / f"a.{ending}", dtype="int32")[0] for ending in ("wav", "flac"))
        np.testing.assert_array_equal(flac, wav)
    assert read_recipe(tmp_path / "a.flac") == read_recipe(tmp_path / "a.wav")
    for settings, words in (
        (WavSettings("32f"), "no floating point"),
        (WavSettings("24", 96_001), "rate of 96001 Hz"),
    ):
        with pytest.raises(ValueError, match=rf"b\.flac: FLAC has .*{words}"):
            export_sound(plucked, tmp_path / "b.flac", settings=settings)
    assert not (tmp_path / "b.flac").exists()


def test_the_gain_of_a_file_does_not_depend_on_what_is_written_beside_it(plucked: NoteSound, tmp_path: Path) -> None:
    settings = WavSettings("24", normalise=True, difference_gain_db=80.0)
    paths = {source: tmp_path / f"{source}.wav" for source in ("model", "difference")}
    export_sounds(plucked, plucked.load(), paths, settings)  # type: ignore[arg-type]
    alone = tmp_path / "alone.wav"
    for source, path in paths.items():
        export_sound(plucked, alone, source, settings)  # type: ignore[arg-type]
        assert (soundfile.read(alone)[0] == soundfile.read(path)[0]).all()


def test_cancelling_leaves_no_file(plucked: NoteSound, tmp_path: Path) -> None:
    def cancel(*_: object) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        export_sound(plucked, tmp_path / "a.wav", progress=cancel)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_what_was_there(
    plucked: NoteSound, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.wav"
    path.write_bytes(b"old")

    def full(self: Path, target: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(WriteError, match=r"a\.wav: cannot be written .*; free some space"):
        export_sound(plucked, path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_preset_that_vanished_is_reported(plucked: NoteSound, tmp_path: Path) -> None:
    gone = replace(plucked.load(), path=tmp_path / "gone.safetensors")
    with pytest.raises(PresetError, match=r"gone\.safetensors: the preset cannot be read any more"):
        export_sounds(plucked, gone, {"model": tmp_path / "a.wav"}, PLAIN)


def test_samples_that_are_not_finite_are_refused(
    plucked: NoteSound, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = Voices({"model": np.array([[np.inf]])})
    monkeypatch.setattr("app.export.note.render_voices", lambda *_, **__: broken)
    with pytest.raises(WriteError, match=r"a\.wav: .*not finite"):
        export_sound(plucked, tmp_path / "a.wav")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": (1.2,)}, "0 … 1, not 1.2"),
        ({"seconds": 0.0}, "at most 600, not 0"),
        ({"seconds": 601.0}, "at most 600, not 601"),
        ({"seconds": float("nan")}, "not nan"),
        ({"source": "all"}, "model, truth, difference, both"),
        ({"source": "both", "points": (0.3, 0.5)}, "choose two files, or mono"),
        ({"points": (0.3, -0.1)}, "right listening point must lie in 0 … 1"),
        ({"pickup": "magnet"}, "displacement, velocity, bridge"),
        ({"decay_db": 5.0}, "decay_db must lie in 10 … 120, not 5"),
        ({"difference_gain_db": 99.0}, "difference_gain_db must lie in 0 … 80, not 99"),
    ],
)
def test_a_sound_out_of_range_is_refused(plucked: NoteSound, change: dict, message: str) -> None:
    wanted = {"points": (0.3,), "pickup": "displacement", "seconds": 0.2, "source": "model", **change}
    with pytest.raises(ValueError, match=message):
        ear = Ear(wanted.pop("points"), wanted.pop("pickup"))
        sound = replace(plucked, seconds=wanted.pop("seconds"), ear=ear)
        check_sources(sound, [wanted.pop("source")], 4_000)
        WavSettings(**wanted)


def test_the_file_name_reports_what_is_in_it() -> None:
    assert default_file_name("nylon", Pluck(0.35, 4), 48_000, "truth", ".wav") == "nylon_x0.35_a4.0_48000_truth.wav"
    assert default_file_name("b", Pluck(0.1234, 0.25), 4000, "both", ".wav") == "b_x0.1234_a0.25_4000_both.wav"


def test_both_sources_lie_side_by_side_or_in_two_files_of_one_gain(plucked: NoteSound, tmp_path: Path) -> None:
    model, truth = (render_sound(plucked, source) for source in VOICES)
    assert (render_sound(plucked, "both") == np.stack([model, truth], axis=1)).all()
    paths = {"model": tmp_path / "m.wav", "truth": tmp_path / "t.wav", "difference": tmp_path / "d.wav"}
    settings = WavSettings("32f", normalise=True, fade_out_s=0)
    reports = export_sounds(plucked, plucked.load(), paths, settings)  # type: ignore[arg-type]
    assert [report.path for report in reports] == list(paths.values())
    assert len({report.gain_db for report in reports}) == 1
    difference, loud = (
        render_sound(plucked, "difference", WavSettings(difference_gain_db=gain_db)) for gain_db in (0.0, 20.0)
    )
    assert (difference == model - truth).all() and loud == pytest.approx(10 * difference)
    m, t, d = (soundfile.read(path)[0] for path in paths.values())
    assert d == pytest.approx(m - t, abs=1e-6)
    assert max(np.abs(m).max(), np.abs(t).max()) == pytest.approx(10 ** (-1 / 20), rel=1e-6)


def test_a_right_listening_point_makes_stereo(plucked: NoteSound) -> None:
    stereo = render_sound(replace(plucked, ear=Ear((0.37, 0.6))))
    assert stereo[:, 0] == pytest.approx(render_sound(plucked), abs=1e-6)
    assert stereo[:, 1] == pytest.approx(render_sound(replace(plucked, ear=Ear((0.6,)))), abs=1e-6)


def test_velocity_is_the_derivative_of_displacement(plucked: NoteSound) -> None:
    displacement_m = render_sound(plucked) * FULL_SCALE_M
    expected = np.gradient(displacement_m, 1 / 4000) / FULL_SCALE_M_S
    found = render_sound(replace(plucked, ear=Ear((0.37,), "velocity")))
    slow = np.convolve(found - expected, np.ones(16) / 16, "valid")  # central differences are low at high partials
    assert np.abs(slow[4:]).max() < 0.05 * np.abs(found).max()
    assert found[0] == pytest.approx(0, abs=1e-9)


def test_a_decay_ends_where_it_is_so_far_down_and_not_before() -> None:
    rate_hz, rate = 1000, 10.0  # 1/s: 86.9 dB in a second
    signal = np.exp(-rate * np.arange(3000) / rate_hz)[:, None]
    assert sound.decayed_frames(signal, rate_hz, 60.0) / rate_hz == pytest.approx(6.9 / rate, abs=0.06)
    assert sound.decayed_frames(signal[:200], rate_hz, 60.0) == 200
    assert sound.decayed_frames(np.zeros((500, 1)), rate_hz, 60.0) == 50


def test_files_of_a_decay_have_one_length_and_an_unfinished_one_is_reported(
    plucked: NoteSound, tmp_path: Path
) -> None:
    decaying, settings = replace(plucked, seconds=8.0), WavSettings(decay_db=10.0)
    model = export_sound(decaying, tmp_path / "m.wav", settings=settings)
    truth = export_sound(decaying, tmp_path / "t.wav", "truth", settings)
    assert model.frames == truth.frames < 8 * 4000
    assert model.decayed
    assert truth.past_training_s == 0 < model.past_training_s
    assert not export_sound(replace(decaying, seconds=0.1), tmp_path / "m.wav", settings=settings).decayed
