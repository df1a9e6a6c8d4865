"""Voices: the cost of one while it rings, and of 64 notes of an instrument."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.instruments.instrument import Noise
from app.instruments.library import find_instrument
from app.player.compiled import InstrumentPlayer
from app.player.events import NoteOn
from app.player.strings import Strings
from app.presets.library import STUDIO
from bench.machine import RATE_HZ, Shares, shares
from engine.kernels.constants import MOST_NOTES, MOST_PAIRS
from engine.pluck import DEFAULT_LISTEN, Pluck
from engine.presets import SHIPPED, load_preset, preset_files
from engine.resonators.sine_transform import project
from engine.values.ear import Ear
from engine.voices import Mixer, Program, Voice, model_program, truth_program
from training.cli.console import ProgressReport

MODEL_SHARE, TRUTH_SHARE = 0.25, 0.5  # of a core, for voices of each kind
MOST_KEYS = 64
INSTRUMENTS = ("concert_harp", "steel_string_acoustic", "harpsichord")  # of two polarisations, heard at the bridge
VELOCITY = 100


@dataclass(frozen=True)
class VoiceCost:
    """The cost of a voice of the kind "model" or "truth"."""

    preset: str
    kind: str
    modes: int
    share: Shares

    @property
    def fits(self) -> int:
        """The number of voices, of ages up to four seconds, that fit into the share of a core for their kind."""
        return int((MODEL_SHARE if self.kind == "model" else TRUTH_SHARE) / self.share.mean)


@dataclass(frozen=True)
class NotesCost:
    """Keys of an instrument whose strings have two polarisations and are heard at the bridge, all struck at once.

    They are the model's, by the compiled player. Body, room, noise of contact and strings at rest are left out.

    Attributes:
        modes: of a note, on average.
        share: of 64 such notes, with their strokes.
    """

    instrument: str
    keys: int
    modes: float
    share: Shares


def measure(report: ProgressReport) -> dict[str, Any]:
    """Measure every studio preset, and INSTRUMENTS."""
    voices: list[VoiceCost] = []
    paths = [path for path in preset_files(SHIPPED) if path.stem.startswith(STUDIO)]
    for number, path in enumerate(paths):
        report(number / len(paths), path.stem)
        voices += _voices(path)
    return {"voices": tuple(voices), "notes": tuple(_notes(name) for name in INSTRUMENTS)}


def _voices(path: Path) -> list[VoiceCost]:
    preset = load_preset(path)
    info, model = preset.info, model_program(preset, RATE_HZ)
    assert model is not None
    initial_m = project(Pluck().displacement(info.grid_points), info.modes)

    def ringing(program: Program) -> list[Mixer]:
        mixer, voice = Mixer(RATE_HZ), Voice(program, initial_m, Ear((DEFAULT_LISTEN,)))
        voice.never_ends()
        mixer.add(voice)
        return [mixer]

    programs = {"model": model, "truth": truth_program(info, RATE_HZ)}
    return [
        VoiceCost(preset.name, kind, info.modes, shares(lambda program=program: ringing(program)))  # type: ignore[misc]
        for kind, program in programs.items()
    ]


def _notes(name: str) -> NotesCost:
    instrument = find_instrument(name).instrument
    instrument = instrument.model_copy(update={"sympathy_s_kg": 0.0, "noise": Noise()})
    preset = load_preset(SHIPPED / f"{instrument.preset}.safetensors")
    low, high = instrument.range
    keys = range(low, min(high + 1, low + MOST_KEYS))
    partials = [string.modes for key in keys if (string := Strings(instrument).of_key(key)) is not None]

    def struck() -> list[Mixer]:
        mixer = Mixer(RATE_HZ)
        player = InstrumentPlayer(instrument, preset, RATE_HZ, {"model": 1.0}, most_notes=MOST_NOTES, varied=False)
        mixer.set_player(player.compiled)
        for key in keys:
            player.handle(NoteOn(key, VELOCITY))
        return [mixer]

    modes = statistics.mean(count + min(count, MOST_PAIRS) for count in partials)
    return NotesCost(name, len(keys), modes, shares(struck).times(MOST_KEYS / len(keys)))
