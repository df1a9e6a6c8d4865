"""Instruments: pitch and loudness of keys, and the level of a chord.

All is measured on rendered sound. Pitch is that of the first partial of a quiet pluck, without body and room.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.instruments.instrument import BodyChoice, Instrument
from app.player.events import NoteOn, TimedEvent
from app.player.offline import render_events, render_note
from app.player.strings import Strings
from bench.machine import RATE_HZ
from engine.kernels.constants import PART_S, REFERENCE_VELOCITY
from engine.kernels.loudness import k_weight
from engine.presets import Preset
from engine.values.effects import Room
from training.cli.console import ProgressReport

QUIET_MM = 0.03  # amplitude at which the pitch is measured, above the level at which a voice ends
PITCH_S = 1.2  # of sound in which the pitch is measured, of which the first 0.1 s is left out
PADDED = 2**21  # samples of the transform
CHORD = (0, 7, 12, 16, 19, 24)  # semitones above the chord's root
HARD = 120  # velocity of the chord


@dataclass(frozen=True)
class TunedInstrument:
    """The figures of one instrument.

    Attributes:
        keys: those measured.
        cents: the largest deviation from the pitch of the instrument's tuning.
        spread_db: from the softest to the loudest key, K-weighted over the first 0.4 s, with body and room.
        level_db: the mean of these levels, relative to full scale.
        chord_peak_db: the peak of six hard keys at once, relative to full scale, before the limiter.
    """

    instrument: str
    keys: tuple[int, ...]
    cents: float
    spread_db: float
    level_db: float
    chord_peak_db: float


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


def measure(instruments: Sequence[tuple[Instrument, Preset]], every: int, report: ProgressReport) -> dict[str, Any]:
    """Measure one of every so many keys of each instrument."""
    found = []
    for number, (instrument, preset) in enumerate(instruments):
        report(number / len(instruments), instrument.name)
        found.append(_measure(instrument, preset, every))
    return {"instruments": tuple(found)}


def chord_of(instrument: Instrument) -> list[int]:
    """The keys of a chord of six in the middle of an instrument's range; fewer where it is narrower."""
    low, high = instrument.range
    root = min((low + high) // 2 - 12, high - CHORD[-1]) if high - low > CHORD[-1] else low
    return [root + step for step in CHORD if root + step <= high]


def _measure(instrument: Instrument, preset: Preset, every: int) -> TunedInstrument:
    strings = Strings(instrument)
    low, high = instrument.range
    keys = [key for key in sorted({*range(low, high + 1, every), high}) if strings.of_key(key) is not None]
    pluck = {**dict(instrument.pluck), "softest_mm": QUIET_MM}
    dry = Instrument.model_validate({**dict(instrument), "pluck": pluck, "body": BodyChoice(), "room": Room()})
    cents, levels = [], []
    for key in keys:
        string = strings.of_key(key)
        assert string is not None
        quiet = render_note(dry, preset, key, 1, PITCH_S + 1, PITCH_S, RATE_HZ)[RATE_HZ // 10 :, 0]
        cents.append(abs(1200 * np.log2(pitch_hz(quiet, string.pitch_hz) / string.pitch_hz)))
        heard = render_note(instrument, preset, key, REFERENCE_VELOCITY, 2.0, 2.0, RATE_HZ)
        levels.append(loudness_db(heard[: round(PART_S * RATE_HZ)]))
    chord = [TimedEvent(0.0, NoteOn(key, HARD, number)) for number, key in enumerate(chord_of(instrument))]
    peak = max(
        float(np.abs(block).max()) for block in render_events(instrument, preset, chord, RATE_HZ, "model", 1.0, False)
    )
    return TunedInstrument(
        instrument.name,
        tuple(keys),
        max(cents),
        max(levels) - min(levels),
        float(np.mean(levels)),
        float(20 * np.log10(peak)),
    )
