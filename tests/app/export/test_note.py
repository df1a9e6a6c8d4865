"""A note through an instrument: the file is what a device is given, and its recipe renders it again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.export.choices import ExportChoices
from app.export.note import HeardNote, NoteExport, musical_name
from app.export.recipe import SoundRecipe, read_recipe
from app.export.sound import compared_sounds
from app.export.wav import WavSettings
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import NoteOn, TimedEvent
from app.player.offline import render_events
from app.rendering.note_sound import NoteSound, Struck
from app.rendering.subject import StringOf
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset
from engine.sources import ModelSource
from engine.values.ear import Ear
from engine.voices import model_program, voice_blocks
from tests.app.sounds import export_sound

PRESET = SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
GUITAR = read_instrument(INSTRUMENTS / "classical_guitar.json")
FIXED = ExportChoices(until_decayed=False, seconds=0.3, format="wav 32f", normalise=False)


PLUCKED = NoteSound(PRESET, Pluck(0.35, 4.0), 0.2, Ear((0.37,)))


def write(sound: NoteSound, path: Path, choices: ExportChoices = FIXED, source: str = "model") -> np.ndarray:
    NoteExport(sound, {source: path}, choices).run(lambda *_: None)  # type: ignore[dict-item]
    return soundfile.read(path, dtype="float32", always_2d=True)[0]


@pytest.mark.parametrize("preset", [PRESET, SHIPPED / "nylon_nonlinear_gaussian_16k_lru.safetensors"])
def test_what_is_compared_is_the_string_alone(preset: Path) -> None:
    """Of a compiled voice, and of a model that is rendered."""
    loaded, ear = load_preset(preset), Ear((0.37, 0.6))
    model = model_program(loaded, 48_000)
    source = ModelSource(loaded) if model.rendered else None
    found = compared_sounds(replace(PLUCKED, preset=preset, ear=replace(ear, solo=2)), 48_000)
    assert {name: samples.shape for name, samples in found.items()} == dict.fromkeys(("model", "truth"), (9_600, 2))
    alone = np.concatenate([*voice_blocks(model, source, loaded.info, PLUCKED.pluck, ear, 0.2)])
    assert (found["model"] == alone).all()
    assert 0 < np.abs(found["model"] - found["truth"]).max() < np.abs(found["truth"]).max()


@pytest.mark.parametrize("source", ["model", "difference"])
def test_the_recipe_renders_it_again(tmp_path: Path, source: str) -> None:
    first, again = tmp_path / "a.wav", tmp_path / "b.wav"
    export_sound(PLUCKED, first, source, FIXED.wav)  # type: ignore[arg-type]
    recipe = read_recipe(first)
    export_sound(recipe.sound(PRESET, first), again, recipe.source, recipe.settings)
    assert first.read_bytes() == again.read_bytes()


RECIPES = {
    "string": '{"format":1,"program":"Learned Strings","version":"0.2.0","preset":"studio_any_string",'
    '"preset_sha256":"c2","pluck":{"position":0.3,"amplitude_mm":2.0,"shape":"rounded","width":0.1},"listen":0.37,"listen_right":null,'
    '"pickup":"bridge","seconds":0.3,"decay_db":null,"source":"model","difference_gain_db":0.0,"preset_rate_hz":48000,'
    '"horizon_s":0.5,"full_scale_m":0.01,"rate_hz":44100,"bits":"24","normalise":false,"fade_out_s":0.01,"string":'
    '{"length_m":0.648,"area_m2":5.0671e-8,"second_moment_m4":2.0432e-16,"density_kg_m3":7850.0,"youngs_modulus_pa":'
    '220000000000.0,"damping_d1_kg_m_s":0.00039498,"damping_d3_kg_m_s":2.679e-6,"tension_n":72.592},"modes":12,'
    '"through":null,"struck":null}',
    "key": '{"format":1,"program":"Learned Strings","version":"0.2.0","preset":"studio_any_string",'
    '"preset_sha256":"c2","pluck":{"position":0.4,"amplitude_mm":4.0,"shape":"gaussian","width":0.06},"listen":0.1,"listen_right":0.6,'
    '"pickup":"velocity","seconds":9.0,"decay_db":60.0,"source":"difference","difference_gain_db":20.0,'
    '"preset_rate_hz":48000,"horizon_s":0.5,"full_scale_m":0.01,"rate_hz":48000,"bits":"16","normalise":true,'
    '"fade_out_s":0.05,"string":null,"modes":null,"through":null,"struck":{"instrument":"Classical guitar",'
    '"instrument_sha256":"7d","key":52,"velocity":90,"channel":16,"place":null,"string":1,"pluck":{"position":0.2,'
    '"amplitude_mm":2.0,"shape":"gaussian","width":0.06}}}',
}


def test_recipes_of_earlier_files_are_read() -> None:
    """Texts that version 0.2.0 wrote."""
    many = SHIPPED / "studio_any_string.safetensors"
    recipe = SoundRecipe.model_validate_json(RECIPES["string"])
    sound = recipe.sound(many, Path("a.wav"))
    assert isinstance(sound.preset, StringOf) and sound.preset.string.tension_n == 72.592
    assert (sound.load().info.modes, sound.load().info.rate_hz) == (12, 48_000)
    assert (sound.pluck, sound.ear, sound.seconds) == (Pluck(0.3, 2.0, "rounded", 0.1), Ear((0.37,), "bridge"), 0.3)
    assert recipe.settings == WavSettings("24", 44_100, fade_out_s=0.01)
    recipe = SoundRecipe.model_validate_json(RECIPES["key"])
    sound = recipe.sound(many, Path("a.wav"))
    assert sound.struck == Struck(GUITAR, NoteOn(52, 90, 16, string=1, pluck=Pluck(0.2, 2.0)))
    assert (sound.preset, sound.ear, sound.seconds) == (many, Ear((0.1, 0.6), "velocity"), 9.0)
    assert recipe.settings == WavSettings("16", 48_000, True, 0.05, 60.0, 20.0)


def test_a_key_can_be_written_without_its_instrument(tmp_path: Path) -> None:
    struck = Struck(GUITAR, NoteOn(52, 100))
    sound = replace(PLUCKED, preset=SHIPPED / "studio_any_string.safetensors")
    plain = write(sound, tmp_path / "a.wav")
    alone = FIXED.model_copy(update={"alone": True})
    assert (write(replace(sound, struck=struck), tmp_path / "b.wav", alone) == plain).all()
    assert write(replace(sound, struck=struck), tmp_path / "c.wav").shape[1] == 2


def heard(source: str = "model", another: bool = False, name: str = "") -> HeardNote:
    return HeardNote(PLUCKED, source, another, 20.0, "", name, 4_000)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("title", "first_hz", "amplitude_mm", "name"),
    [
        ("Steel-string acoustic", 164.8, 0.2, "Steel-string acoustic E3 soft"),
        ("Nylon B3, 16 kHz", 246.9, 1.0, "Nylon B3 medium"),
        ("Harp <1/2>", 92.5, 9.0, "Harp 1 2 F#2 hard"),
        ("..", 20_000.0, 0.0, "Note 20000 Hz soft"),
    ],
)
def test_a_file_is_named_as_musicians_would(title: str, first_hz: float, amplitude_mm: float, name: str) -> None:
    assert musical_name(title, first_hz, 0.1, 10.0, amplitude_mm) == name
    assert heard(name=name).file_name("model", ".wav") == f"{name}.wav"
    assert heard(name=name).file_name("truth", ".wav") == f"{name} truth.wav"


def test_the_difference_of_a_key_has_neither_amplifier_nor_body(tmp_path: Path) -> None:
    """It is as loud as those of the key's own model and truth: its gain is that of the whole instrument."""
    electric = read_instrument(INSTRUMENTS / "electric_guitar_bridge_pick_up.json")
    assert electric.amp.drive_db > 0
    event = NoteOn(52, 100)
    preset = SHIPPED / "studio_any_string.safetensors"
    sound = replace(PLUCKED, preset=preset, struck=Struck(electric, event))
    found = write(sound, tmp_path / "a.wav", source="difference")
    dry = {
        source: np.concatenate(
            list(
                render_events(
                    electric,
                    load_preset(preset),
                    [TimedEvent(0.0, event)],
                    48_000,
                    source,
                    0.3,
                    limited=False,
                    varied=False,
                    dry=True,
                )
            )
        )
        for source in ("model", "truth")
    }
    until = len(found) - round(0.010 * 48_000)
    expected = 10 ** (FIXED.difference_gain_db / 20) * (dry["model"].astype(np.float64) - dry["truth"])
    np.testing.assert_allclose(found[:until], expected[:until], atol=1e-9)
    assert np.abs(found).max() > 0
