"""Sounds that judge the gate of recordings: notes as users record them, and sounds that are no note of a string.

All are drawn by a seed. Thresholds are set on half of the recordings and on other seeds than judge them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import signal

from tests.training.recording.sounds import (
    CHANGES,
    CHORD_DB,
    Array,
    Random,
    Sound,
    at_rate,
    chord,
    membrane,
    noise,
    random_pluck,
)
from training.recording.note import onset_of

Recordings = Mapping[str, Sound]
NO_STRING = "not_a_string"  # of a file's name: a slap, a thump, a strum
DRUMS = (("concert_toms", 41), ("concert_toms", 47), ("conga", 55), ("frame_drum", 55), ("tuned_toms", 50))


@dataclass(frozen=True)
class Case:
    """A sound to be judged; `is_note`: it is one note of a string, and to be kept."""

    base: str  # a recording's name, or a number
    kind: str
    is_note: bool
    sound: Sound


def is_judged(name: str) -> bool:
    """The half of a recording: thresholds are set on the other."""
    return sum(name.encode()) % 2 == 1


def cases(recordings: Recordings, count: int, seed: int) -> Iterator[Case]:
    """The cases of recordings, each in each change, and of so many synthetic notes; and as many that are no notes."""
    recordings = {
        name: (samples if samples.ndim == 1 else samples.mean(1), rate_hz)
        for name, (samples, rate_hz) in recordings.items()
    }
    for name, sound in recordings.items():
        if is_note := NO_STRING not in name:
            yield Case(name, "as recorded", True, sound)
        for number, (kind, change) in enumerate(CHANGES.items()):
            random = np.random.default_rng([seed, number, sum(name.encode())])
            yield Case(name, kind if is_note else f"no string, {kind}", is_note, change(random, *sound))
    for number in range(count):
        base = f"synthetic {number}"
        sound = random_pluck(seed + number)
        yield Case(base, "synthetic", True, sound)
        random = np.random.default_rng([seed, number])
        kind = list(CHANGES)[number % len(CHANGES)]
        yield Case(base, f"synthetic, {kind}", True, CHANGES[kind](random, *sound))
    yield from _no_notes(recordings, count, seed)


def _no_notes(recordings: Recordings, count: int, seed: int) -> Iterator[Case]:
    notes = [(name, sound) for name, sound in recordings.items() if NO_STRING not in name]
    random = np.random.default_rng([seed, 2])
    for number in range(count):
        base = f"none {number}"
        real = number % 2 == 0 and len(notes) > 3
        name, first = notes[int(random.integers(len(notes)))] if real else (base, random_pluck(seed + 5_000 + number))
        second = notes[int(random.integers(len(notes)))][1] if real else random_pluck(seed + 7_000 + number)
        made = number // 2 % 8
        if made < 3:
            for level_db in CHORD_DB if made == 0 else (float(random.choice(CHORD_DB)),):
                if (sound := chord(first, second, level_db)) is not None:
                    yield Case(name, f"chord, {level_db:.0f} dB", False, sound)
        elif made == 3:
            yield Case(name, "two onsets", False, two_onsets(random, first, second))
        elif made == 4:
            yield Case(name, "reversed", False, (first[0][::-1].copy(), first[1]))
        elif made == 5:
            yield Case(name, "loop", False, loop(random, *first))
        elif made == 6:
            gain = 10 ** (random.uniform(8, 20) / 20) / float(np.abs(first[0]).max())
            yield Case(name, "clipped", False, (np.clip(gain * first[0], -1, 1), first[1]))
        else:
            yield Case(base, "noise", False, noise(random, number))
        kind, others = list(OTHERS.items())[number % len(OTHERS)]
        yield Case(base, kind, False, others(random, number))


def two_onsets(random: Random, first: Sound, second: Sound) -> Sound:
    """A second note, or the same again, 0.15 to 0.8 s after the first."""
    samples, rate_hz = first
    other = at_rate(*second, rate_hz) if random.random() < 0.6 else samples
    other = other[onset_of(other, rate_hz) :]
    peak = float(np.abs(samples).max())
    begin = onset_of(samples, rate_hz) + round(random.uniform(0.15, 0.8) * rate_hz)
    both = np.zeros(max(len(samples), begin + len(other)))
    both[: len(samples)] = samples
    both[begin : begin + len(other)] += other / np.abs(other).max() * peak
    return both, rate_hz


def loop(random: Random, samples: Array, rate_hz: int) -> Sound:
    """A sampler's: a stretch of 0.1 to 0.8 s again and again, with silence behind it or not."""
    begin = onset_of(samples, rate_hz) + round(random.uniform(0.1, 0.3) * rate_hz)
    part = samples[begin : begin + round(random.uniform(0.1, 0.6) * rate_hz)]
    times = math.ceil(2 * rate_hz / len(part)) + 1
    behind = np.zeros(rate_hz // 2 if random.random() < 0.3 else 0)
    return np.concatenate([samples[:begin], *[part] * times, behind]), rate_hz


def sweep(random: Random, number: int = 0) -> Sound:
    rate_hz = 44_100
    t = np.arange(2 * rate_hz) / rate_hz
    low, high = np.exp(random.uniform(math.log(50), math.log(8_000), 2))
    tone = signal.chirp(t, low, t[-1], high * 1.5, "logarithmic") * np.exp(-random.uniform(0, 2) * t)
    return np.concatenate([np.zeros(2_000), 0.3 * tone]), rate_hz


def speech(random: Random, number: int = 0) -> Sound:
    """Syllables: pulses of a gliding pitch, or breath, through formants."""
    rate_hz = 22_050
    frames = round(random.uniform(1.2, 2.5) * rate_hz)
    t = np.arange(frames) / rate_hz
    pitch = random.uniform(90, 220) * 2 ** (0.3 * np.sin(2 * np.pi * random.uniform(0.4, 1.5) * t))
    pulses = np.diff(np.floor(np.cumsum(pitch) / rate_hz), prepend=0.0) + 0.05 * random.standard_normal(frames)
    edges = np.linspace(0, frames, int(random.integers(3, 8)), dtype=int)
    sound = np.zeros(frames)
    for first, last in pairwise(edges):
        part = pulses[first:last] * np.hanning(last - first)
        for hz in (random.uniform(300, 800), random.uniform(900, 2_200), random.uniform(2_300, 3_200)):
            b, a = signal.iirpeak(hz, hz / 90, fs=rate_hz)
            sound[first:last] += signal.lfilter(b, a, part)
    return 0.3 * sound / np.abs(sound).max() + 1e-4 * random.standard_normal(frames), rate_hz


def drum(random: Random, number: int) -> Sound:
    """A blow on one of the project's drums."""
    from app.instruments.library import SHIPPED, read_instrument
    from app.player.offline import render_note
    from engine.presets import SHIPPED as PRESETS
    from engine.presets import load_preset

    name, key = DRUMS[number // 5 % len(DRUMS)]
    instrument = read_instrument(Path(SHIPPED) / f"{name}.json")
    preset = load_preset(PRESETS / "studio_any_string.safetensors")
    low, high = instrument.range
    key = min(max(key + int(random.integers(-3, 4)), low), high)
    sound = render_note(instrument, preset, key, int(random.integers(60, 127)), 1.5, 1.5, 44_100)[:, 0]
    sound = np.concatenate([np.zeros(2_000), sound.astype(float)])
    return sound + 1e-6 * random.standard_normal(len(sound)), 44_100


OTHERS: dict[str, Callable[[Random, int], Sound]] = {
    "noise": noise,
    "sweep": sweep,
    "speech": speech,
    "membrane": membrane,
    "drum": drum,
}
