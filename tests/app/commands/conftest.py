"""Command lines in this process, and the files that they read: each is made when a line names it."""

import gc
import json
import math
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import soundfile
import torch
import typer

from app.commands.cli import main
from app.export.recipe import SoundRecipe
from app.export.wav import WavSettings
from app.player.events import NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from app.rendering.note_sound import NoteSound
from app.rendering.subject import StringOf
from engine.excitation import displacement
from engine.models import build_model
from engine.models.base import Physics
from engine.pluck import Pluck
from engine.presets import SHIPPED, find_string, load_preset, read_string, save_preset
from engine.resonators.string import resonator_of
from engine.schema import write
from engine.values.ear import Ear
from training.cli import console
from training.configuration import DatasetConfiguration, Recipe, TrainingConfiguration

DATA = DatasetConfiguration(initial="gaussian", rate_hz=4000, modes=10, tension_modulated=False, steps=600, count=20)
HORIZON = 500  # frames of `tiny`
STEEL_G3 = find_string("steel_g3")
EVENTS = [TimedEvent(0.0, NoteOn(57, 90)), TimedEvent(0.1, NoteOff(57))]
CONFIGURATION, PLAN = (Path(__file__).with_name(name).read_text() for name in ("tiny.toml", "plan.toml"))
ARRAYS = {
    "flat": np.zeros(101),
    "deep": np.zeros((1, 2, 101)),
    "empty": np.zeros((0, 101)),
    "coarse": np.zeros((2, 50)),
    "complex": np.zeros((1, 101), complex),
    "words": np.full((1, 101), "a"),
    "objects": np.full((1, 101), None),
    "nan": np.full((1, 101), np.nan),
    "infinite": np.full((1, 101), np.inf),
    "millimetres": 1e3 * displacement("gaussian", 0.3, 0.05, 2e-3, 101)[None],
    "endless": 1e6 * displacement("gaussian", 0.3, 0.05, 2e-3, 101)[None],
}
BYTES = {
    "nothing": b"",
    "text": b"1 2 3",
    "riff": b"RIFF nothing",
    "table": b"a,b\n1,2\n",
    "tiny": CONFIGURATION.encode(),
    "plan": PLAN.encode(),
    "dmd": CONFIGURATION.replace("koopman_var", "dmd")
    .replace("state_size = 8, multiplier_widths = [4]", "rank = 20")
    .encode(),
    "wild": CONFIGURATION.encode() + b"peak_learning_rate = 1e30\nclip_norm = 1e30\nschedule = 'constant'",
    "epoch": CONFIGURATION.replace("epochs", "epoch").encode(),
    "koopmann": PLAN.replace('"koopman"', '"koopmann"').encode(),
}


@pytest.fixture(autouse=True)
def later_imports_are_frozen() -> Iterator[None]:
    """Training brings 800 modules of torch's compiler; as no window is here, all that is left is kept for good."""
    known = len(sys.modules)
    yield
    if len(sys.modules) > known:
        gc.collect()
        gc.freeze()


class Outcome(NamedTuple):
    """What a command line did."""

    status: int
    out: str
    err: str

    @property
    def failure(self) -> str:
        """The one line of a failure."""
        (line,) = self.err.splitlines()
        assert (self.status, self.out) == (1, ""), self.err
        return line

    @property
    def usage(self) -> str:
        """The message of bad usage in one line, without a frame and quotation marks."""
        assert (self.status, self.out) == (2, "")
        return " ".join(self.err.replace("│", " ").replace("'", "").split())


Run = Callable[..., Outcome]

get_command = cache(typer.main.get_command)  # reads every signature, for a twentieth of a second


@pytest.fixture
def run(request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a command line in this process, and more words; a name in its braces is a fixture's.

    Lines of progress come only after an hour. The parser is built once, as in a process.
    """
    monkeypatch.setattr(typer.main, "get_command", get_command)
    monkeypatch.setattr(console, "bars", partial(console.bars, 3600.0))

    class Fixtures(dict[str, Any]):
        def __missing__(self, name: str) -> Any:
            return request.getfixturevalue(name)

    def run(line: str, *more: object) -> Outcome:
        words = [word.format_map(Fixtures()) for word in line.split()]
        capsys.readouterr()
        return Outcome(main([*words, *map(str, more)]), *capsys.readouterr())

    return run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An empty folder for results."""
    (path := tmp_path / "results").mkdir()
    return path


@pytest.fixture
def out(folder: Path) -> Path:
    return folder / "out"


@pytest.fixture
def u0(tmp_path: Path) -> Path:
    """Three plucks (3, 101) in m."""
    path = tmp_path / "u0.npy"
    np.save(path, np.stack([displacement("gaussian", 0.3 + 0.1 * i, 0.05, (2 + i) * 1e-3, 101) for i in range(3)]))
    return path


@pytest.fixture
def tiny(small_preset: Path, tmp_path: Path) -> Path:
    """The linear string in closed form, its decay rates too high by a tenth."""
    model = build_model("koopman_integrated")
    physics = Physics(resonator_of(DATA.string, DATA.modes, tension_modulated=False), DATA.rate_hz, 1e-3)
    model.initialise("physics", physics, torch.Generator().manual_seed(0))
    with torch.no_grad():
        model.get_parameter("nu_log").add_(math.log(1.1))
    run = TrainingConfiguration("Tiny", "koopman_integrated", DATA, Recipe(epochs=1), horizon=HORIZON)
    info = replace(
        load_preset(small_preset).info,
        model="koopman_integrated",
        model_configuration={},
        tension_modulated=False,
        horizon_steps=HORIZON,
        training=write(run),
        test_rel_mse=0.75,
    )
    path = tmp_path / "tiny.safetensors"
    save_preset(path, info, model)
    return path


@pytest.fixture
def installed(small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of shipped presets with one file, `good`."""
    (shipped := tmp_path / "shipped").mkdir()
    shutil.copy(small_preset, shipped / "good.safetensors")
    monkeypatch.setattr("engine.presets.finding.SHIPPED", shipped)
    return shipped


def with_recipe(path: Path, recipe: dict[str, Any]) -> Path:
    """A WAV with a recipe, as a stranger may send it."""
    with soundfile.SoundFile(path, "w", 4000, 1, "PCM_16", format="WAV") as file:
        file.comment = json.dumps(recipe)
        file.write(np.zeros(8))
    return path


class Made:
    """Files of a folder: `{made:flat.npy}` in a line is that array's path, and others are made alike."""

    def __init__(self, folder: Path, preset: Path) -> None:
        self.folder = folder
        self.preset = preset

    def __format__(self, name: str) -> str:
        path = self.folder / name
        stem, _, kind = name.partition(".")
        if path.exists():
            pass
        elif stem == "place":
            path.mkdir()
        elif stem == "recipe":
            path = with_recipe(self.folder / "recipe.wav", self._changed_recipe(kind))
        elif stem in BYTES:
            path.write_bytes(BYTES[stem])
        elif kind == "npy":
            np.save(path, ARRAYS[stem], allow_pickle=True)
        elif kind == "npz":
            np.savez(path, a=np.zeros((1, 101)))
        elif kind == "mid":
            path.write_bytes(midi_bytes(EVENTS))
        elif kind == "wav":
            seconds, noise = np.arange(48_000) / 48_000, np.random.default_rng(0).uniform(-0.2, 0.2, 48_000)
            note = 0.5 * np.sin(2400 * seconds) * np.exp(-5.3 * seconds)
            soundfile.write(path, noise if stem == "noise" else note, 48_000)
        elif kind == "toml":
            self._write_string(path, *stem.split("="))
        elif kind == "safetensors":
            path.write_bytes(self.preset.read_bytes()[:-50])
        return str(path)

    def _write_string(self, path: Path, field: str, value: str) -> None:
        """A string of another value, FIELD=VALUE.toml, or without it."""
        lines = STEEL_G3.read_text(encoding="utf-8").splitlines()
        others = [line for line in lines if not line.startswith(field)]
        path.write_text("\n".join([*others, f"{field} = {value}" if value else ""]), encoding="utf-8")

    def _changed_recipe(self, changes: str) -> dict[str, Any]:
        """The recipe of a model of many strings with other values: FIELD=VALUE, or PLACE.FIELD=VALUE, …"""
        many = StringOf(SHIPPED / "studio_any_string.safetensors", read_string(STEEL_G3), 44_100, 30)
        sound = NoteSound(many, Pluck(), 0.1, Ear((0.37,)))
        recipe = json.loads(SoundRecipe.of(sound, sound.load(), "model", WavSettings()).model_dump_json())
        for change in changes.split(","):
            field, _, value = change.partition("=")
            *place, field = field.split(".")
            (recipe[place[0]] if place else recipe)[field] = json.loads(value.replace(";", ","))
        return recipe


@pytest.fixture
def made(small_preset: Path, tmp_path: Path) -> Made:
    return Made(tmp_path, small_preset)
