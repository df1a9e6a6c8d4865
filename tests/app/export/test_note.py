"""A note through an instrument: the file is what a device is given, and its recipe renders it again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.export.choices import ExportChoices
from app.export.files import export_sound
from app.export.note import ExportedPluck, HeardNote, NoteExport, musical_name
from app.export.recipe import read_recipe, request_of
from app.export.sound import SoundRequest, Through, render_sound
from app.export.struck import Struck
from app.instrument.effects import effects_of
from app.instrument.events import NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset
from engine.resonators.sine_transform import project
from engine.sources import ModelSource
from engine.values.ear import Ear
from engine.voices import Mixer, Voice, model_program, voice_blocks

PRESET = SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
GUITAR = read_patch(PATCHES / "classical_guitar.json")
FIXED = ExportChoices(until_decayed=False, seconds=0.3, bits="32f", normalise=False)


def a_note(**more: object) -> ExportedPluck:
    return ExportedPluck(PRESET, 4_000, Pluck(0.35, 4.0), 0.37, **more)  # type: ignore[arg-type]


def of_an_earlier_version(source: str = "model") -> SoundRequest:
    """A pluck by hand that an instrument's body, room and level were added to."""
    added = {name: getattr(GUITAR, name) for name in ("body", "room", "amp", "level_db")}
    through = Through(instrument=GUITAR.name, gain=0.5, **added)
    return SoundRequest(load_preset(PRESET), Pluck(0.35, 4.0), 0.37, 0.3, source, through=through)  # type: ignore[arg-type]


def write(note: ExportedPluck, path: Path, choices: ExportChoices = FIXED, source: str = "model") -> np.ndarray:
    NoteExport(note, {source: path}, choices).run(lambda *_: None)  # type: ignore[dict-item]
    return soundfile.read(path, dtype="float32", always_2d=True)[0]


def test_body_room_and_level_of_earlier_recipes_are_those_that_a_device_was_given() -> None:
    found = render_sound(of_an_earlier_version(), 48_000).astype(np.float32)
    preset = load_preset(PRESET)
    program = model_program(preset, 48_000)
    voice = Voice(program, project(Pluck(0.35, 4.0).displacement(101), preset.info.modes), Ear((0.37,)), 0.5)
    voice.sound_through_effects()
    mixer = Mixer(48_000, limited=False)
    mixer.set_effects(effects_of(GUITAR))
    mixer.add(voice)
    played = mixer.render(len(found))
    assert found.shape == (14_400, 2)
    assert (found == played).all()
    assert np.abs(found).max() > 0.01


@pytest.mark.parametrize("preset", [PRESET, SHIPPED / "nylon_nonlinear_gaussian_16k_lru.safetensors"])
def test_what_is_compared_is_the_string_alone(preset: Path) -> None:
    """Of a compiled voice, and of a model that is rendered."""
    note = replace(a_note(listen_right=0.6), preset=preset)
    loaded = load_preset(preset)
    model, ear = model_program(loaded, 48_000), Ear((0.37, 0.6))
    source = ModelSource(loaded) if model.rendered else None
    found = note.compared(0.2, 48_000)
    assert {name: samples.shape for name, samples in found.items()} == dict.fromkeys(("model", "truth"), (9_600, 2))
    alone = np.concatenate([*voice_blocks(model, source, loaded.info, note.pluck, ear, 0.2)])
    assert (found["model"] == alone).all()
    assert 0 < np.abs(found["model"] - found["truth"]).max() < np.abs(found["truth"]).max()


@pytest.mark.parametrize("source", ["model", "difference"])
def test_the_recipe_renders_it_again(tmp_path: Path, source: str) -> None:
    first, again = tmp_path / "a.wav", tmp_path / "b.wav"
    export_sound(of_an_earlier_version(source), first, FIXED.wav)
    recipe = read_recipe(first)
    export_sound(request_of(recipe, load_preset(PRESET), first), again, recipe.settings)
    assert first.read_bytes() == again.read_bytes()


def test_a_difference_of_an_earlier_recipe_has_its_level_alone() -> None:
    old = of_an_earlier_version("difference")
    dry, levelled = (render_sound(each) for each in (replace(old, through=None), old))
    assert (levelled == 0.5 * dry).all()


def test_a_key_can_be_written_without_its_instrument(tmp_path: Path) -> None:
    struck = Struck(GUITAR, NoteOn(52, 100))
    many = {"preset": SHIPPED / "studio_any_string.safetensors", "preset_rate_hz": 48_000}
    plain = write(replace(a_note(), **many), tmp_path / "a.wav")
    alone = FIXED.model_copy(update={"alone": True})
    assert (write(replace(a_note(struck=struck), **many), tmp_path / "b.wav", alone) == plain).all()
    assert write(replace(a_note(struck=struck), **many), tmp_path / "c.wav").shape[1] == 2


def test_a_room_rings_out_after_the_string() -> None:
    preset = load_preset(PRESET)
    program, effects = model_program(preset, 48_000), effects_of(GUITAR)
    assert effects is not None
    dry, wet = (
        np.concatenate(
            list(voice_blocks(program, None, preset.info, Pluck(), Ear((0.37,)), 9.0, until_db=20, effects=each))
        )
        for each in (None, effects)
    )
    silence = round(0.2 * 48_000)
    tail = wet[len(dry) - silence :]
    assert not dry[-silence:].any()
    assert len(tail) == round(effects.tail_s(48_000) * 48_000) and np.abs(tail[:4_800]).max() > 1e-4
    assert np.abs(tail[-4_800:]).max() < 0.01 * np.abs(wet).max()


def test_a_body_that_has_changed_is_reported() -> None:
    body = GUITAR.body.model_copy(update={"name": "mine", "mix": 0.5})
    through = Through(instrument=GUITAR.name, gain=0.5, body=body, body_sha256="0" * 64)
    with pytest.raises(ValueError, match="the body mine is not the one of Classical guitar"):
        SoundRequest(load_preset(PRESET), Pluck(), 0.3, 1.0, "both", through=through)


@pytest.mark.parametrize(
    ("source", "another", "last", "chosen"),
    [
        ("truth", False, "model", "truth"),
        ("model", False, "files", "files"),
        ("difference", False, "files", "difference"),
        ("model", True, "files", "model"),
    ],
)
def test_what_is_heard_is_saved_and_both_again(source: str, another: bool, last: str, chosen: str) -> None:
    assert HeardNote(a_note(), source, another, 20.0, "").chosen(last) == chosen  # type: ignore[arg-type]


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
    assert a_note(name=name).file_name("model") == f"{name}.wav"
    assert a_note(name=name).file_name("truth") == f"{name} truth.wav"


def test_the_difference_of_a_key_has_neither_amplifier_nor_body(tmp_path: Path) -> None:
    """It is as loud as those of the key's own model and truth: its gain is that of the whole instrument."""
    electric = read_patch(PATCHES / "electric_guitar_bridge_pick_up.json")
    assert electric.amp.drive_db > 0
    event = NoteOn(52, 100)
    preset = SHIPPED / "studio_any_string.safetensors"
    note = ExportedPluck(preset, 48_000, Pluck(), 0.1, struck=Struck(electric, event))
    found = write(note, tmp_path / "a.wav", source="difference")
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
