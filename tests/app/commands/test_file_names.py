"""File names that are no UTF-8, as old archives have, in commands that read or write files."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.instrument.events import NoteOff, NoteOn, TimedEvent
from app.instrument.midi_file import midi_bytes
from app.patches.library import SHIPPED as PATCHES
from engine.plain_text import name_text
from engine.presets import SHIPPED as PRESETS
from tests.training.recording.synthetic import synthetic_note

PRESET = PRESETS / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"
CAFE = os.fsdecode(b"caf\xe9")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With a file of each kind of that name, in a folder of that name."""
    folder = tmp_path / CAFE
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("this system has no such names")
    (folder / f"{CAFE}.mid").write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(57, 90)), TimedEvent(0.1, NoteOff(57))]))
    shutil.copy(PATCHES / "classical_guitar.json", folder / f"{CAFE}.json")
    shutil.copy(PRESET, folder / f"{CAFE}.safetensors")
    np.save(folder / f"{CAFE}.npy", 1e-3 * np.sin(np.pi * np.linspace(0, 1, 101))[None])
    return folder


def test_a_rendered_file_is_shown_and_rendered_again(run, folder: Path) -> None:
    preset, wav, again = (str(folder / f"{CAFE}{ending}") for ending in (".safetensors", ".wav", " 2.wav"))
    words = ("--position", "0.3", "--amplitude-mm", "2", "--seconds", "0.5", "--normalise")
    assert run("render", preset, wav, *words).status == 0
    found = run("info", wav)
    assert found.status == 0, found.err
    found.out.encode()
    assert run("render", "--recipe", wav, again).status == 0
    assert Path(again).stat().st_size > 0


def test_a_note_is_learned(run, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(folder / "own"))
    made, note = synthetic_note(4, seconds=0.8), folder / f"{CAFE}.wav"
    with note.open("wb") as file:
        soundfile.write(file, made.samples, made.rate_hz, subtype="PCM_24", format="WAV")
    found = run("learn", note, "--name", CAFE)
    assert found.status == 0, found.err
    found.out.encode()
    assert len(list((folder / "own").glob("*.safetensors"))) == 1


def test_a_name_is_text_that_can_be_written() -> None:
    assert name_text(CAFE) == "caf\ufffd" and name_text("café.mid") == "café.mid"
    name_text("\ud800").encode()


COMMANDS: dict[str, tuple[str, ...]] = {
    "play": ("play", "{}.mid", "--instrument", "{}.json", "--out", "{} out.wav", "--seconds", "0.1"),
    "render": (
        "render",
        "{}.safetensors",
        "{} out.wav",
        "--position",
        "0.3",
        "--amplitude-mm",
        "2",
        "--seconds",
        "0.1",
    ),
    "sampled": ("sampled", "{}.json", "{} out.sfz", "--keys", "57-57", "--layers", "1", "--seconds", "0.2"),
    "soundfont": ("sampled", "{}.json", "{} out.sf2", "--keys", "57-57", "--layers", "1", "--seconds", "0.2"),
    "predict": ("predict", "{}.safetensors", "{}.npy", "{} out.npy", "--steps", "5"),
    "simulate": ("simulate", "{}.npy", "{} out.npy", "--string", "linear", "--steps", "10", "--rate", "4000"),
    "compare": ("compare", "{}.safetensors", "--seconds", "0.1", "--position", "0.3", "--amplitude-mm", "2"),
    "plugin": ("plugin", "{}.json", "--dry-run"),
    "instruments": ("instruments", "{}.json"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_works_with_such_names(run, folder: Path, command: str) -> None:
    words = [str(folder / word.format(CAFE)) if "{}" in word else word for word in COMMANDS[command]]
    found = run(*words)
    assert found.status == 0, found.err
    found.out.encode()
    if wanted := [Path(word) for word in words if " out." in word]:
        assert wanted[0].stat().st_size > 0
        assert [each for each in folder.iterdir() if each.name.startswith(".")] == []
