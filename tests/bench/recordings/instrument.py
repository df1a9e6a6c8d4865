"""Learned notes as instruments: the attack of the own key, and keys of neighbouring pitch against recordings."""

from __future__ import annotations

import itertools
import math
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.instrument.learned import keep
from app.instrument.offline import render_note
from app.patches.library import find_patch
from app.patches.patch import Patch
from app.shared.parameters import NOISE_DB
from engine.folders import FOLDER_VARIABLE
from engine.kernels.constants import PART_S
from engine.presets import Preset, load_preset
from tests.bench.recordings.synthetic import synthetic_note
from training.recording.attack import first_distance_db
from training.recording.learn import Learned, examined, learn
from training.recording.note import FIT_BEGINS_S, FIT_LASTS_S, RecordingError
from training.recording.preset import Source
from training.recording.report import bands_of, errors_of

Array = NDArray[np.float64]
Recordings = Mapping[str, tuple[Array, int]]
Progress = Callable[[float], None]

VELOCITY = 100  # of the recorded note
SEMITONES = (1.5, 4.5)  # between neighbours: a whole tone to a major third
FRETTED = 3.0  # of synthetic ones: as between most of the recordings
HIGHEST_PARTIAL = 12  # whose frequency is compared
MOST_CENTS, MOST_DECAY_OFF, MOST_DISTANCE_DB = 3.0, 0.3, 8.0


@dataclass(frozen=True)
class Instrument:
    """What `learn` makes of one recording."""

    learned: Learned
    patch: Patch
    preset: Preset

    def sound(self, f0_hz: float, seconds: float, rate_hz: int, attack: bool = True) -> Array:
        """The key that is nearest to a pitch, tuned to it, (frames,)."""
        key = round(69 + 12 * math.log2(f0_hz / 440))
        tuning = self.patch.tuning.model_copy(update={"a4_hz": f0_hz * 2 ** ((69 - key) / 12)})
        patch = self.patch.model_copy(update={"tuning": tuning})
        if not attack:
            patch = patch.with_value("noise.onset_db", NOISE_DB[0])
        return render_note(patch, self.preset, key, VELOCITY, seconds, seconds, rate_hz)[:, 0].astype(np.float64)


def attacks(recordings: Recordings, progress: Progress) -> dict[str, list[float]]:
    """The own key: log spectral distance of its first 30 ms without and with an attack; distance and decays after."""
    values: dict[str, list[float]] = {}
    with _instruments(recordings, progress) as instruments:
        for each in instruments.values():
            note = each.learned.note
            switched = each.patch.noise.onset_db > NOISE_DB[0]
            values.setdefault("attack switched on by it", []).append(float(switched))
            truth = note.part(0, PART_S)
            for name, attack in (("without an attack", False), ("as learned", True)):
                found = each.sound(each.learned.physics.f0_hz, PART_S, note.rate_hz, attack)[: len(truth)]
                distance = first_distance_db(truth, found, note.rate_hz)
                values.setdefault(f"first 30 ms {name}, distance in dB", []).append(distance)
            _compare(values, "own key", each, each.learned)
    return values


def neighbours(recordings: Recordings, progress: Progress) -> dict[str, list[float]]:
    """Keys a whole tone to a major third away, against recordings of that pitch and the same dynamic.

    The pitch is given, as a key gives it. Predicted are the twelfth partial through B, the decay of octaves, and the
    sound, of which the log spectral distance is measured.
    """
    values: dict[str, list[float]] = {}
    with _instruments(recordings, progress) as instruments:
        for first, second in itertools.permutations(instruments, 2):
            played, other = instruments[first], instruments[second].learned
            ratio = other.physics.f0_hz / played.learned.physics.f0_hz
            low, high = SEMITONES
            near = low < abs(12 * math.log2(ratio)) < high
            if not near or first[-2] != second[-2] or other.note.rate_hz != played.learned.note.rate_hz:
                continue
            _compare_stiffness(values, played, other, ratio)
            _compare(values, "neighbour", played, other)
    return values


def synthetic_neighbours(seeds: Sequence[int], progress: Progress) -> dict[str, list[float]]:
    """The same of synthetic notes of one string, open and FRETTED semitones higher."""
    values: dict[str, list[float]] = {}
    for done, seed in enumerate(seeds):
        progress(done / len(seeds))
        both = {f"{name}_ma": synthetic_note(seed, fretted=at) for name, at in (("open", 0.0), ("fretted", FRETTED))}
        found = neighbours({name: (note.samples, note.rate_hz) for name, note in both.items()}, lambda share: None)
        for name, each in found.items():
            values.setdefault(name, []).extend(each)
    return values


def _compare_stiffness(values: dict[str, list[float]], played: Instrument, other: Learned, ratio: float) -> None:
    predicted = played.learned.physics.stiffness * ratio**2  # of a string that is shortened
    square = HIGHEST_PARTIAL**2
    cents = 600 * math.log2((1 + predicted * square) / (1 + other.physics.stiffness * square))
    values.setdefault("neighbour, 12th partial off by B, cents", []).append(abs(cents))
    values.setdefault("neighbour, at most 3 cents by B", []).append(float(abs(cents) <= MOST_CENTS))


def _compare(values: dict[str, list[float]], what: str, played: Instrument, other: Learned) -> None:
    """The key at a note's pitch beside its recording."""
    physics, note = other.physics, other.note
    truth = note.fitted()
    found = played.sound(physics.f0_hz, FIT_BEGINS_S + FIT_LASTS_S, note.rate_hz, attack=False)
    found = found[round(FIT_BEGINS_S * note.rate_hz) :][: len(truth)]
    distance = errors_of(truth, found, note.rate_hz, note.noise_power).distance_db
    bands = [each for each in bands_of(truth, found, note.rate_hz, note.noise_power) if math.isfinite(each.learned_s)]
    decays = [abs(each.learned_s / each.recorded_s - 1) for each in bands]
    values.setdefault(f"{what}, distance in dB", []).append(distance)
    values.setdefault(f"{what}, distance at most 8 dB", []).append(float(distance <= MOST_DISTANCE_DB))
    values.setdefault(f"{what}, decay of octaves off, share", []).extend(decays)
    values.setdefault(f"{what}, decay of octaves at most 30 % off", []).extend(
        float(each <= MOST_DECAY_OFF) for each in decays
    )


@contextmanager
def _instruments(recordings: Recordings, progress: Progress) -> Iterator[dict[str, Instrument]]:
    """All recordings that are strings, each learned and kept in a folder that is removed at the end."""
    found: dict[str, Instrument] = {}
    before = os.environ.get(FOLDER_VARIABLE)
    with tempfile.TemporaryDirectory() as folder:
        os.environ[FOLDER_VARIABLE] = str(Path(folder))
        try:
            for number, (name, (samples, rate_hz)) in enumerate(recordings.items()):
                progress(number / len(recordings))
                try:
                    examination = examined(samples, rate_hz)
                    (learned,) = learn([(examination, Source(name, "0" * 64, rate_hz, len(samples)))])
                except RecordingError:
                    continue
                kept = keep(name, [learned])
                found[name] = Instrument(learned, find_patch(name).patch, load_preset(kept.preset))
            yield found
        finally:
            if before is None:
                del os.environ[FOLDER_VARIABLE]
            else:
                os.environ[FOLDER_VARIABLE] = before
