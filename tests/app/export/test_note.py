"""A note through an instrument: the file is what a device is given, and its recipe renders it again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.export.choices import ExportChoices
from app.export.note import ExportedPluck, NoteExport, musical_name
from app.export.recipe import read_recipe, request_of
from app.export.sound import SoundRequest
from app.export.struck import Struck
from app.instrument.effects import effects_of
from app.instrument.events import NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from engine.pluck import Pluck
from engine.presets import SHIPPED, load_preset
from engine.sources import ModelSource
from engine.values.ear import Ear
from engine.voices import model_program, voice_blocks
from tests.app.sounds import export_sound

PRESET = SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
GUITAR = read_patch(PATCHES / "classical_guitar.json")
FIXED = ExportChoices(until_decayed=False, seconds=0.3, bits="32f", normalise=False)


def a_note(**more: object) -> ExportedPluck:
    return ExportedPluck(PRESET, 4_000, Pluck(0.35, 4.0), 0.37, **more)  # type: ignore[arg-type]


def write(note: ExportedPluck, path: Path, choices: ExportChoices = FIXED, source: str = "model") -> np.ndarray:
    NoteExport(note, {source: path}, choices).run(lambda *_: None)  # type: ignore[dict-item]
    return soundfile.read(path, dtype="float32", always_2d=True)[0]


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
    request = SoundRequest(load_preset(PRESET), Pluck(0.35, 4.0), 0.37, 0.3, source)  # type: ignore[arg-type]
    export_sound(request, first, FIXED.wav)
    recipe = read_recipe(first)
    export_sound(request_of(recipe, load_preset(PRESET), first), again, recipe.settings)
    assert first.read_bytes() == again.read_bytes()


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
