"""Voices: what one costs as it rings, how far it is from what it stands for, and what a strike costs.

Costs are of this thread's own time, on one core, without what an empty mixer costs: other busy processes lengthen
them little. Errors are relative L2 of what is heard of the first second.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from app.commands.benchmarks.machine import Machine, one_thread
from engine.pluck import DEFAULT_LISTEN, FULL_SCALE_M, Pluck
from engine.presets import SHIPPED, Preset, load_preset, preset_files
from engine.sources import ModelSource, StringSource, TruthSource, project
from engine.voices import Ear, Mixer, Program, Voice, bank_program, truth_program
from engine.voices.voice import ATTACK_S

RATE_HZ = 48_000
PREFIX = "studio_"
EDGES_S = (0.0, 0.05, 1.0, 4.0)  # of the ages that are told apart; the last is the mean age of what is played
REPEATS = 5
ERROR_S = 1.0
STRIKES = 200
EAR = Ear((DEFAULT_LISTEN,))
PLUCK = Pluck()
MODEL_SHARE, TRUTH_SHARE = 0.25, 0.5  # of a core
MODEL_VOICES, TRUTH_VOICES, TRUTH_ERROR = 64, 16, 1e-4  # the targets
STEP_FRAMES = 480


@dataclass(frozen=True)
class VoiceCost:
    """One voice, "model" or "truth".

    Attributes:
        onset, first_second, later: shares of a core over the first 50 ms, the first second, and seconds 1 to 4.
        mean: over the first four seconds.
        error: of the truth from the solver with its default sub-steps, of the model from its own definition.
    """

    preset: str
    kind: str
    modes: int
    onset: float
    first_second: float
    later: float
    mean: float
    error: float

    def voices_at(self, share: float) -> int:
        """How many of all ages fit into a share of a core."""
        return int(share / self.mean)


@dataclass(frozen=True)
class StrikeCost:
    """Making the voices of model and truth of a pluck, in ms."""

    preset: str
    median_ms: float
    worst_ms: float


@dataclass(frozen=True)
class VoicesBenchmark:
    machine: Machine
    rate_hz: int
    voices: tuple[VoiceCost, ...]
    strikes: tuple[StrikeCost, ...]


def measure(report: Callable[[float, str], None]) -> VoicesBenchmark:
    """Of every studio preset."""
    paths = [path for path in preset_files(SHIPPED) if path.stem.startswith(PREFIX)]
    voices: list[VoiceCost] = []
    strikes = []
    with one_thread():
        for number, path in enumerate(paths):
            report(number / len(paths), path.stem)
            found, strike = _measure(path)
            voices += found
            strikes.append(strike)
        return VoicesBenchmark(Machine.here(), RATE_HZ, tuple(voices), tuple(strikes))


def _measure(path: Path) -> tuple[list[VoiceCost], StrikeCost]:
    preset = load_preset(path)
    info = preset.info
    model, truth = bank_program(preset.model, info, RATE_HZ), truth_program(info, RATE_HZ)
    own_rate = bank_program(preset.model, info, info.rate_hz)
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
    """Of a core: over the first age, the first two, the last, and all."""
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
    """Of this thread for each age; of an empty mixer without a voice."""
    mixer = Mixer(RATE_HZ)
    if voice is not None:
        voice.never_ends()
        mixer.add(voice)
    found = []
    for begin_s, end_s in pairwise(EDGES_S):
        began_s = time.thread_time()
        for _ in range(round((end_s - begin_s) * RATE_HZ) // STEP_FRAMES):
            mixer.render(STEP_FRAMES)
        found.append(time.thread_time() - began_s)
    return found


def _error(program: Program, preset: Preset, source: StringSource) -> float:
    """From when the fade-in is over; both at the preset's own rate."""
    info = preset.info
    frames, first = round(ERROR_S * info.rate_hz), round(ATTACK_S * info.rate_hz)
    voice, mixer = _struck(program, preset), Mixer(info.rate_hz, limited=False)
    voice.never_ends()
    mixer.add(voice)
    found = mixer.render(frames)[first:, 0].astype(np.float64)
    initial_m = project(PLUCK.displacement(info.grid_points), info.modes)
    with torch.inference_mode():
        blocks, _ = source.advance(source.start(initial_m[None]), frames - 1, EAR.weights(info.grid_points))
    expected: NDArray[np.float64] = blocks[0, first - 1 :, 0].double().numpy() / FULL_SCALE_M
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def _strikes(preset: Preset, programs: tuple[Program, Program]) -> StrikeCost:
    """All that a gesture waits for before it hands its voices over."""
    times_s = []
    for number in range(STRIKES + 1):
        pluck = PLUCK.moved(position=0.1 + 0.8 * number / STRIKES)
        began_s = time.thread_time()
        for program in programs:
            _struck(program, preset, pluck)
        times_s.append(time.thread_time() - began_s)
    return StrikeCost(preset.name, 1000 * statistics.median(times_s[1:]), 1000 * max(times_s[1:]))
