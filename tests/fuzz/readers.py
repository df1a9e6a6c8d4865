"""Every reader of files: a whole file of its kind, how it is damaged, and the error that is the reader's own."""

import io
import json
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
import torch

from app.audio.impulse_file import ImpulseError, read_impulse
from app.export.recipe import InstrumentSound, RecipeError, SoundRecipe, read_recipe
from app.export.wav import WavSettings
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import InstrumentError, read_instrument
from app.instruments.tuning import Tuning, TuningChoice, read_scala
from app.player.events import Bend, ControlChange, NoteOff, NoteOn, TimedEvent
from app.player.midi_file import (
    LONGEST_S,
    MOST_EVENTS,
    MidiFileError,
    midi_bytes,
    read_midi,
    read_parts,
    read_song,
)
from app.rendering.note_sound import NoteSound
from app.window.settings import Settings, load_settings
from engine.effects import Body, Effects
from engine.pluck import Pluck
from engine.presets import (
    SHIPPED,
    STRINGS,
    PresetError,
    described_parameters,
    load_preset,
    outside_training,
    read_string,
)
from engine.resonators.sine_transform import project
from engine.schema import SchemaError
from engine.sources import ModelSource, Runaway, TruthSource
from engine.values.ear import Ear
from engine.voices import model_program, render_voice, truth_program
from tests.fuzz.mutations import damaged_bytes, damaged_preset, damaged_text
from tests.training.sweeping.test_plan import PLAN
from training.cell import load
from training.fitting.checkpoint import Checkpoint
from training.heard_file import COLUMNS, read_heard
from training.results import Row, add_rows, read_results
from training.sweeping.plan import load_plan

FRAMES = 32
ONE_STRING, DMD = "nylon_nonlinear_gaussian_4k_koopman_integrated", "nylon_linear_gaussian_16k_dmd"


def in_one_line(error: Exception, path: Path) -> None:
    reported = str(error)
    assert len(reported) <= 500 and reported.isprintable() and str(path) in reported, reported[:700]


def play(path: Path) -> None:
    """Load a preset and play it: its model, its physics, and both as they are heard."""
    preset = load_preset(path)
    info = preset.info
    initial_m = project(Pluck().displacement(info.grid_points), info.modes)
    outside_training(info, Pluck())
    described_parameters(path, info)
    truth = TruthSource(info)
    frames, _ = truth.advance(truth.start(initial_m[None]), 2)
    assert np.isfinite(frames).all()
    try:
        source = ModelSource(preset)
    except ValueError:  # it needs a frame before the first
        return
    seconds = FRAMES / info.rate_hz
    try:
        frames, _ = source.advance(source.start(initial_m[None]), FRAMES)
        assert np.isfinite(frames).all()
        for program in (model_program(preset, info.rate_hz), truth_program(info, info.rate_hz)):
            sound = render_voice(program, source if program.rendered else None, info, Pluck(), Ear((0.37,)), seconds)
            assert bool(np.isfinite(sound).all())
    except Runaway:
        return


@dataclass(frozen=True)
class Target:
    """A reader, a whole file of its kind, and the error that is its own."""

    name: str
    whole: Callable[[Path], bytes]
    read: Callable[[Path], object]
    errors: tuple[type[Exception], ...]
    damaged: Callable[[bytes, random.Random], bytes] = damaged_bytes


def json_or_bytes(whole: bytes, draw: random.Random) -> bytes:
    return damaged_bytes(whole, draw) if draw.random() < 0.3 else damaged_text(json.loads(whole), draw).encode()


def lines_or_bytes(values: str, others: tuple[str, ...]) -> Callable[[bytes, random.Random], bytes]:
    """Damage lines of a text: a few of them, or their values behind a name, become others."""

    def damaged(whole: bytes, draw: random.Random) -> bytes:
        if draw.random() < 0.35:
            return damaged_bytes(whole, draw)
        lines = whole.decode().splitlines()
        for _ in range(draw.choice((1, 1, 3))):
            place = draw.randrange(len(lines))
            name, sign, _ = lines[place].partition("=")
            lines[place] = (name + sign if sign else "") + draw.choice((*values.split(), *others))
        return "\n".join(lines).encode()

    return damaged


NESTED = ("'" + "x" * 50_000 + "'", "[" * 100 + "]" * 100, "[" * 3_000, "[" + "1," * 3000 + "]", "9" * 5000)
toml_or_bytes = lines_or_bytes("-1 0 1e300 nan inf 'x' [] {} true 1000000000 [1,'a'] colour=1", NESTED)
scala_or_bytes = lines_or_bytes(
    "-1 0 x 1e300 nan inf. 2000000000 -2000000000. 1/0 0/1 -3/2 ! \u00e9 1.2.3 20000 128",
    ("9" * 5000, "1/" + "9" * 30, "5" * 200 + ".", ""),
)


def wav(folder: Path, comment: str) -> bytes:
    buffer = io.BytesIO()
    with soundfile.SoundFile(buffer, "w", 4000, 1, "PCM_16", format="WAV") as file:
        file.comment = comment
        file.write(np.zeros(8))
    return buffer.getvalue()


def recipe_text(preset: Path) -> str:
    sound = NoteSound(preset, Pluck(), 0.1, Ear((0.37,)))
    return SoundRecipe.of(sound, sound.load(), "model", WavSettings()).model_dump_json()


def played_text() -> str:
    facts = {"program": "Learned Strings", "version": "0.2.0", "instrument": "Classical guitar", "source": "truth"}
    facts |= {"preset": "studio_any_string", "preset_sha256": "0" * 64, "rate_hz": 48_000, "bits": "24"}
    played = InstrumentSound(**facts, midi="take.mid", recorded="2026-11-24T11:00:00+01:00")
    return played.model_dump_json()


def damaged_wav(whole: bytes, draw: random.Random) -> bytes:
    if draw.random() < 0.4:
        return damaged_bytes(whole, draw)
    with soundfile.SoundFile(io.BytesIO(whole)) as file:
        comment = file.comment
    try:
        return wav(Path(), damaged_text(json.loads(comment), draw).replace("\\u0000", ""))
    except (ValueError, soundfile.LibsndfileError):  # a text that no WAV can hold
        return damaged_bytes(whole, draw)


def impulse(folder: Path, kind: str, subtype: str) -> bytes:
    buffer = io.BytesIO()
    decay = np.geomspace(1, 1e-3, 400)[:, None]
    soundfile.write(buffer, decay * np.random.default_rng(0).uniform(-1, 1, (400, 2)), 44_100, subtype, format=kind)
    return buffer.getvalue()


def sounded(path: Path) -> None:
    """Read an impulse response and make it what the mixer would be given."""
    found = Effects(Body(impulse=read_impulse(path))).impulse(48_000)
    assert bool(np.isfinite(found).all()) and len(found) <= 3 * 48_000


def row_file(folder: Path) -> bytes:
    row = Row("d" * 16, "a", "done", "koopman", "linear", "noise", 4000, 400, "ours", 0, rel_mse=0.5)
    add_rows(folder / "rows.csv", [row])
    return (folder / "rows.csv").read_bytes()


def checkpoint(folder: Path) -> bytes:
    facts, tensors = {"configuration": {"a": [1, 2]}, "step": 3, "loss_total": 0.5}, {"w": torch.zeros(3)}
    Checkpoint(tensors, tensors, {}, {"0": {"exp_avg": torch.zeros(3)}}, facts).save(folder / "whole")
    return (folder / "whole").read_bytes()


def heard(path: Path) -> None:
    for problem in read_heard(path.parent)[1]:
        in_one_line(ValueError(problem), path)


def settings(path: Path) -> None:
    found, notice = load_settings(path)
    assert isinstance(found, Settings) and len(notice) <= 500 and notice.isprintable()
    for aside in path.parent.glob("*.broken.json"):
        aside.unlink()


def scala(path: Path) -> None:
    """Read a .scl or .kbm, and ask for every pitch."""
    text = read_scala(path)
    tuning = Tuning(TuningChoice.model_validate({"keymap" if path.suffix == ".kbm" else "scale": text}))
    assert all(0 < tuning.hz(key) < np.inf for key in range(128))


MPE = read_instrument(INSTRUMENTS / "long_wire.json").model_copy(update={"mode": "mpe"})


def song(path: Path) -> None:
    """Read a MIDI file, and write what it says."""
    events = read_midi(path)
    assert read_song(path, MPE).events == events
    parts = [each for _, part in read_parts(path)[0] for each in part.events]
    notes = [sum(isinstance(each.event, NoteOn) for each in some) for some in (events, parts)]
    assert notes[0] == notes[1], "each has one instrument"
    assert all(0 <= each.time_s <= LONGEST_S for each in events) and len(events) <= MOST_EVENTS
    assert all(-1 <= each.event.value <= 1 for each in events if isinstance(each.event, Bend))
    midi_bytes(events)


SONG = midi_bytes(
    [
        *(TimedEvent(0.1 * n, NoteOn(40 + n, 90, n % 3)) for n in range(12)),
        *(TimedEvent(0.1 * n + 0.05, Bend(n / 12, n % 3)) for n in range(12)),
        *(TimedEvent(0.1 * n + 0.3, NoteOff(40 + n, n % 3)) for n in range(12)),
        TimedEvent(0.2, ControlChange(64, 127)),
    ]
)
INSTRUMENT = min(INSTRUMENTS.glob("*.json"))
SCALE = b"! a.scl\n!\nfifths and thirds\n 5\n!\n 9/8\n 386.3\n 3/2\n 5/3\n 2/1\n"
KEYMAP = b"7\n0\n127\n60\n69\n440.0\n12\n0\n2\n4\n5\n7\n9\n11\n"
CONFIGURATION = b"""title = "a run"
model = "koopman_var"
[data]
initial = "gaussian"
rate_hz = 4000
modes = 10
count = 100
[data.string]
length_m = 0.65
tension_n = 60.97
[recipe]
epochs = 1
batch_size = 10
[model_configuration]
state_size = 16
multiplier_widths = [8]
"""
HEARD = f"{','.join(COLUMNS)}\na,{'0' * 64},4,0.5,-1,0,0.1,,,1\n".encode()


def recipe(preset: Path) -> Callable[[Path], None]:
    def read(path: Path) -> None:
        found = read_recipe(path)
        found.sound(preset, path)
        assert found.settings.fade_out_s <= 600

    return read


PRESETS = [SHIPPED / f"{name}.safetensors" for name in (ONE_STRING, "studio_any_string", DMD)]
PRESET = play, (PresetError,), damaged_preset
IMPULSES = {"float.wav": ("WAV", "FLOAT"), "pcm.wav": ("WAV", "PCM_16"), "body.flac": ("FLAC", "PCM_24")}
STRING = (STRINGS / "steel_e4.toml").read_bytes()


TARGETS = (
    *(Target(f"{of.stem}.safetensors", lambda p, of=of: of.read_bytes(), *PRESET) for of in PRESETS),
    *(
        Target(f"{of.stem}.wav", lambda p, of=of: wav(p, recipe_text(of)), recipe(of), (RecipeError,), damaged_wav)
        for of in PRESETS[:2]
    ),
    Target("settings.json", lambda p: Settings().model_dump_json().encode(), settings, (), json_or_bytes),
    Target("plan.toml", lambda p: PLAN.encode(), lambda p: load_plan(str(p)), (SchemaError,), toml_or_bytes),
    Target("run.toml", lambda p: CONFIGURATION, lambda p: load(str(p)), (SchemaError,), toml_or_bytes),
    Target("string.toml", lambda p: STRING, read_string, (SchemaError,), toml_or_bytes),
    Target("rows.csv", row_file, read_results, (SchemaError,)),
    Target("heard.csv", lambda p: HEARD, heard, ()),
    Target("checkpoint.safetensors", checkpoint, Checkpoint.load, (ValueError,)),
    Target("instrument.json", lambda p: INSTRUMENT.read_bytes(), read_instrument, (InstrumentError,), json_or_bytes),
    Target("song.mid", lambda p: SONG, song, (MidiFileError,)),
    Target("scale.scl", lambda p: SCALE, scala, (ValueError,), scala_or_bytes),
    Target("keys.kbm", lambda p: KEYMAP, scala, (ValueError,), scala_or_bytes),
    *(Target(name, lambda p, of=of: impulse(p, *of), sounded, (ImpulseError,)) for name, of in IMPULSES.items()),
)
