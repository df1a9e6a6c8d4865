"""Voices: the cost of one while it rings, its error, the cost of a pluck, and of 64 notes of an instrument.

Costs are processor time of this thread, less that of an empty mixer, so that other processes have little effect.
Errors are relative L2 over the first second of the sound.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import NoteOn
from app.instrument.strings import Strings
from app.patches.library import find_patch
from app.patches.patch import Noise
from app.presets.library import STUDIO
from engine.compare.relative import error_to_signal
from engine.kernels.constants import MOST_NOTES, MOST_PAIRS
from engine.levels import FULL_SCALE_M
from engine.pluck import DEFAULT_LISTEN, Pluck
from engine.presets import SHIPPED, Preset, load_preset, preset_files
from engine.resonators.sine_transform import project
from engine.sources import ModelSource, StringSource, TruthSource
from engine.values.ear import Ear
from engine.voices import Mixer, Program, Voice, model_program, truth_program
from engine.voices.ear import weights_of
from engine.voices.voice import ATTACK_S
from tests.bench.machine import Machine, one_thread

RATE_HZ = 48_000
EDGES_S = (0.0, 0.05, 1.0, 4.0)  # of the ages of a voice that are measured apart
REPEATS = 5
ERROR_S = 1.0
STRIKES = 200
EAR = Ear((DEFAULT_LISTEN,))
PLUCK = Pluck()
MODEL_SHARE, TRUTH_SHARE = 0.25, 0.5  # of a core
MODEL_VOICES, TRUTH_VOICES, TRUTH_ERROR = 64, 16, 1e-4
STEP_FRAMES = 480
INSTRUMENTS = ("concert_harp", "steel_string_acoustic", "harpsichord")  # of two polarisations, heard at the bridge
VELOCITY = 100


@dataclass(frozen=True)
class VoiceCost:
    """A voice of the kind "model" or "truth".

    Attributes:
        onset, first_second, later: shares of a core over the first 50 ms, the first second, and seconds 1 to 4.
        mean: share of a core over the first four seconds.
        error: the truth's against the solver with its default sub-steps, the model's against its definition.
    """

    preset: str
    kind: str
    modes: int
    onset: float
    first_second: float
    later: float
    mean: float
    error: float

    @property
    def fits(self) -> int:
        """How many voices, of ages up to four seconds, fit into the share of a core for their kind."""
        return int((MODEL_SHARE if self.kind == "model" else TRUTH_SHARE) / self.mean)


@dataclass(frozen=True)
class StrikeCost:
    """Time to make the voices of model and truth of a pluck."""

    preset: str
    median_ms: float
    worst_ms: float


@dataclass(frozen=True)
class NotesCost:
    """Keys of an instrument whose strings have two polarisations and are heard at the bridge, all struck at once.

    They are the model's, by the compiled player. Body, room, noise of contact and strings at rest are left out.

    Attributes:
        modes: of a note, on average.
        onset, first_second, later: shares of a core of 64 such notes over the first 50 ms with their strokes, the
            first second, and seconds 1 to 4; mean: over four seconds.
    """

    instrument: str
    keys: int
    modes: float
    onset: float
    first_second: float
    later: float
    mean: float

    @property
    def met(self) -> bool:
        """Whether the mean is within the share of a core."""
        return self.mean <= MODEL_SHARE


@dataclass(frozen=True)
class VoicesBenchmark:
    machine: Machine
    rate_hz: int
    voices: tuple[VoiceCost, ...]
    strikes: tuple[StrikeCost, ...]
    notes: tuple[NotesCost, ...]

    @property
    def targets(self) -> str:
        return (
            f"{MODEL_VOICES} model voices at {MODEL_SHARE:.0%} of a core, {TRUTH_VOICES} truth voices at"
            f" {TRUTH_SHARE:.0%} and an error of {TRUTH_ERROR:g} at most"
        )


def measure(report: Callable[[float, str], None]) -> VoicesBenchmark:
    """Measure every studio preset."""
    paths = [path for path in preset_files(SHIPPED) if path.stem.startswith(STUDIO)]
    voices: list[VoiceCost] = []
    strikes = []
    with one_thread():
        for number, path in enumerate(paths):
            report(number / len(paths), path.stem)
            found, strike = _measure(path)
            voices += found
            strikes.append(strike)
        notes = tuple(_notes(name) for name in INSTRUMENTS)
        return VoicesBenchmark(Machine.here(), RATE_HZ, tuple(voices), tuple(strikes), notes)


def _measure(path: Path) -> tuple[list[VoiceCost], StrikeCost]:
    preset = load_preset(path)
    info = preset.info
    model, truth = model_program(preset, RATE_HZ), truth_program(info, RATE_HZ)
    own_rate = model_program(preset, info.rate_hz)
    assert model is not None and own_rate is not None
    errors = {
        "model": _error(own_rate, preset, ModelSource(preset)),
        "truth": _error(truth_program(info, info.rate_hz), preset, TruthSource(info)),
    }
    voices = [
        VoiceCost(preset.name, kind, info.modes, *_shares(program, preset), errors[kind])
        for kind, program in (("model", model), ("truth", truth))
    ]
    return voices, _strikes(preset, (model, truth))


def _struck(program: Program, preset: Preset, pluck: Pluck = PLUCK) -> Voice:
    info = preset.info
    return Voice(program, project(pluck.displacement(info.grid_points), info.modes), EAR)


def _shares(program: Program, preset: Preset) -> tuple[float, float, float, float]:
    """Shares of a core: over the first age, the first two, the last, and all."""
    empty_s = statistics.median(sum(_times_s(None)) for _ in range(REPEATS)) / EDGES_S[-1]
    runs = [_times_s(_struck(program, preset)) for _ in range(REPEATS)]
    onset_s, rest_s, later_s = (statistics.median(times) for times in zip(*runs, strict=True))
    return (
        onset_s / EDGES_S[1] - empty_s,
        (onset_s + rest_s) / EDGES_S[2] - empty_s,
        later_s / (EDGES_S[3] - EDGES_S[2]) - empty_s,
        (onset_s + rest_s + later_s) / EDGES_S[3] - empty_s,
    )


def _times_s(voice: Voice | None) -> list[float]:
    """Processor time of this thread for each age; None: of an empty mixer."""
    mixer = Mixer(RATE_HZ)
    if voice is not None:
        voice.never_ends()
        mixer.add(voice)
    return _elapsed_s(mixer)


def _elapsed_s(mixer: Mixer) -> list[float]:
    found = []
    for begin_s, end_s in pairwise(EDGES_S):
        began_s = time.thread_time()
        for _ in range(round((end_s - begin_s) * RATE_HZ) // STEP_FRAMES):
            mixer.render(STEP_FRAMES)
        found.append(time.thread_time() - began_s)
    return found


def _notes(name: str) -> NotesCost:
    patch = find_patch(name).patch
    patch = patch.model_copy(update={"sympathy_s_kg": 0.0, "noise": Noise()})
    preset = load_preset(next(path for path in preset_files(SHIPPED) if path.stem == patch.preset))
    low, high = patch.range
    keys = range(low, min(high + 1, low + MODEL_VOICES))
    partials = [string.modes for key in keys if (string := Strings(patch).of_key(key)) is not None]
    runs = []
    for _ in range(REPEATS + 1):  # the first loads what is compiled
        mixer = Mixer(RATE_HZ)
        player = InstrumentPlayer(patch, preset, RATE_HZ, {"model": 1.0}, most_notes=MOST_NOTES, varied=False)
        mixer.set_player(player.compiled)
        for key in keys:
            player.handle(NoteOn(key, VELOCITY))
        runs.append(_elapsed_s(mixer))
    onset_s, rest_s, later_s = (statistics.median(times) for times in zip(*runs[1:], strict=True))
    all_s = MODEL_VOICES / len(keys)
    return NotesCost(
        name,
        len(keys),
        statistics.mean(count + min(count, MOST_PAIRS) for count in partials),
        all_s * onset_s / EDGES_S[1],
        all_s * (onset_s + rest_s) / EDGES_S[2],
        all_s * later_s / (EDGES_S[3] - EDGES_S[2]),
        all_s * (onset_s + rest_s + later_s) / EDGES_S[3],
    )


def _error(program: Program, preset: Preset, source: StringSource) -> float:
    """Relative L2 of a voice against its source from the end of the fade-in on, at the preset's own rate."""
    info = preset.info
    frames, first = round(ERROR_S * info.rate_hz), round(ATTACK_S * info.rate_hz)
    voice, mixer = _struck(program, preset), Mixer(info.rate_hz, limited=False)
    voice.never_ends()
    mixer.add(voice)
    found = mixer.render(frames)[first:, 0].astype(np.float64)
    initial_m = project(PLUCK.displacement(info.grid_points), info.modes)
    blocks, _ = source.advance(source.start(initial_m[None]), frames - 1, weights_of(EAR, info.grid_points))
    expected = blocks[0, first - 1 :, 0].astype(np.float64) / FULL_SCALE_M
    return math.sqrt(error_to_signal(found, expected))


def _strikes(preset: Preset, programs: tuple[Program, Program]) -> StrikeCost:
    """Times to make both voices, for which a key waits."""
    times_s = []
    for number in range(STRIKES + 1):
        pluck = PLUCK.moved(position=0.1 + 0.8 * number / STRIKES)
        began_s = time.thread_time()
        for program in programs:
            _struck(program, preset, pluck)
        times_s.append(time.thread_time() - began_s)
    return StrikeCost(preset.name, 1000 * statistics.median(times_s[1:]), 1000 * max(times_s[1:]))
