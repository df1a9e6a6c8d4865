"""Patches: pitch and loudness of keys, level of a chord, and the model's error while a key is bent and plucked again.

All is measured on rendered sound. Pitch is that of the first partial of a quiet pluck, without body and room.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.instrument.events import Bend, Event, NoteOff, NoteOn, TimedEvent
from app.instrument.offline import render_events, render_note
from app.instrument.strings import Strings
from app.patches.patch import Body, Patch
from engine.kernels.constants import PART_S, REFERENCE_VELOCITY
from engine.kernels.loudness import k_weight
from engine.presets import Preset
from engine.values.effects import Room
from tests.bench.machine import Machine

RATE_HZ = 48_000
QUIET_MM = 0.03  # amplitude at which the pitch is measured, above the level at which a voice ends
PITCH_S = 1.2  # of sound in which the pitch is measured, of which the first 0.1 s is left out
PADDED = 2**21  # samples of the transform
CHORD = (0, 7, 12, 16, 19, 24)  # semitones above the chord's root
HARD = 120  # velocity of the chord
HANDS_S = 1.5  # of sound in which the model is compared with the truth


@dataclass(frozen=True)
class TunedPatch:
    """What was measured of one patch.

    Attributes:
        keys: those measured.
        cents: the largest deviation from the pitch of the patch's tuning.
        spread_db: from the softest to the loudest key, K-weighted over the first 0.4 s, with body and room.
        level_db: the mean of these levels, relative to full scale.
        chord_peak_db: the peak of six hard keys at once, relative to full scale, before the limiter.
        shortest_s: the shortest time in which a key falls by 30 dB.
        hands_rel_mse: the model's error against the truth while a key is bent, plucked again and released.
    """

    patch: str
    keys: tuple[int, ...]
    cents: float
    spread_db: float
    level_db: float
    chord_peak_db: float
    shortest_s: float
    hands_rel_mse: float


@dataclass(frozen=True)
class TuneBenchmark:
    machine: Machine
    rate_hz: int
    patches: tuple[TunedPatch, ...]


def pitch_hz(sound: NDArray[np.floating], near_hz: float, rate_hz: int = RATE_HZ) -> float:
    """The frequency of the strongest partial within 3 % of `near_hz` in a sound (frames,); NaN for silence."""
    part = np.asarray(sound, np.float64)
    spectrum = np.abs(np.fft.rfft(part * np.hanning(len(part)), PADDED))
    low, high = (int(near_hz * factor * PADDED / rate_hz) for factor in (0.97, 1.03))
    peak = low + int(spectrum[low : max(high, low + 3)].argmax())
    if not spectrum[peak] > 0:
        return float("nan")
    left, middle, right = np.log(np.maximum(spectrum[peak - 1 : peak + 2], 1e-300))
    return float((peak + 0.5 * (left - right) / (left - 2 * middle + right)) * rate_hz / PADDED)


def loudness_db(sound: NDArray[np.floating], rate_hz: int = RATE_HZ) -> float:
    """K-weighted mean square (ITU-R BS.1770) of a sound (frames, channels), in dB relative to full scale."""
    part = np.asarray(sound, np.float64)
    power = (np.abs(np.fft.rfft(part, axis=0)) ** 2).mean(1)
    total = (
        2 * (power * k_weight(np.asarray(np.fft.rfftfreq(len(part), 1 / rate_hz), np.float64))).sum() / len(part) ** 2
    )
    return float(10 * np.log10(max(total, 1e-30)))


def measure(
    patches: Sequence[tuple[Patch, Preset]], every: int, report: Callable[[float, str], None]
) -> TuneBenchmark:
    """Measure one of every so many keys of each patch."""
    found = []
    for number, (patch, preset) in enumerate(patches):
        report(number / len(patches), patch.name)
        found.append(_measure(patch, preset, every))
    return TuneBenchmark(Machine.here(), RATE_HZ, tuple(found))


def chord_of(patch: Patch) -> list[int]:
    """The keys of a chord of six in the middle of a patch's range; fewer where it is narrower."""
    low, high = patch.range
    root = min((low + high) // 2 - 12, high - CHORD[-1]) if high - low > CHORD[-1] else low
    return [root + step for step in CHORD if root + step <= high]


def _measure(patch: Patch, preset: Preset, every: int) -> TunedPatch:
    strings = Strings(patch)
    low, high = patch.range
    keys = [key for key in sorted({*range(low, high + 1, every), high}) if strings.of_key(key) is not None]
    pluck = {**dict(patch.pluck), "softest_mm": QUIET_MM}
    dry = Patch.model_validate({**dict(patch), "pluck": pluck, "body": Body(), "room": Room()})
    cents, levels, lengths = [], [], []
    for key in keys:
        string = strings.of_key(key)
        assert string is not None
        quiet = render_note(dry, preset, key, 1, PITCH_S + 1, PITCH_S, RATE_HZ)[RATE_HZ // 10 :, 0]
        cents.append(abs(1200 * np.log2(pitch_hz(quiet, string.pitch_hz) / string.pitch_hz)))
        heard = render_note(patch, preset, key, REFERENCE_VELOCITY, 2.0, 2.0, RATE_HZ)
        levels.append(loudness_db(heard[: round(PART_S * RATE_HZ)]))
        lengths.append(_falls_s(heard))
    chord = [TimedEvent(0.0, NoteOn(key, HARD, number)) for number, key in enumerate(chord_of(patch))]
    peak = max(
        float(np.abs(block).max()) for block in render_events(patch, preset, chord, RATE_HZ, "model", 1.0, False)
    )
    return TunedPatch(
        patch.name,
        tuple(keys),
        max(cents),
        max(levels) - min(levels),
        float(np.mean(levels)),
        float(20 * np.log10(peak)),
        min(lengths),
        max(_under_hands(patch, preset, key) for key in {keys[0], keys[len(keys) // 2], keys[-1]}),
    )


def _falls_s(sound: NDArray[np.float32]) -> float:
    """The time until its level has fallen 30 dB below its loudest 20 ms; its whole duration where it has not."""
    block = RATE_HZ // 50
    power = (np.asarray(sound[: len(sound) // block * block], np.float64) ** 2).mean(1).reshape(-1, block).mean(1)
    below = np.flatnonzero(power[power.argmax() :] < power.max() / 1000)
    return (int(power.argmax()) + int(below[0])) * block / RATE_HZ if len(below) else len(sound) / RATE_HZ


def _under_hands(patch: Patch, preset: Preset, key: int) -> float:
    events: list[tuple[float, Event]] = [(0.0, NoteOn(key, 100))]
    events += [(0.2 + 0.01 * step, Bend(step / 20)) for step in range(21)]
    events += [(0.6, NoteOn(key, 80)), (0.8, Bend(0.0)), (1.0, NoteOff(key))]
    timed = [TimedEvent(time_s, event) for time_s, event in events]
    model, truth = (
        np.concatenate(list(render_events(patch, preset, timed, RATE_HZ, source, HANDS_S, False))).astype(np.float64)
        for source in ("model", "truth")
    )
    return float(((model - truth) ** 2).sum() / (truth**2).sum())
