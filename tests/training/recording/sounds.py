"""Sounds for the gate of recordings: notes as users record them, chords, drums and noise, all drawn by a seed."""

import io
import math
from collections.abc import Callable
from functools import partial

import numpy as np
import soundfile
from numpy.typing import NDArray
from scipy import signal

from tests.training.recording.synthetic import synthetic_note
from training.recording.note import note_of, onset_of
from training.recording.numbering import number_note

Array = NDArray[np.float64]
Sound = tuple[Array, int]  # samples (frames,) or (frames, channels), and their rate
Random = np.random.Generator

RATES_HZ = (22_050, 44_100, 48_000, 88_200, 96_000)
NOISE_DB = (-60.0, -50.0, -40.0)
CHORD_DB = (0.0, -5.0, -10.0)
OCTAVE_CENTS = 60.0  # two notes so near to octaves are one series of partials


def random_pluck(seed: int) -> Sound:
    """A string of any pitch from 30 Hz to 1 kHz with a body, as the project's solver plays it."""
    random = np.random.default_rng([seed, 1])
    made = synthetic_note(
        20_000 + seed,
        seconds=float(random.uniform(1.0, 4.0)),
        snr_db=float(random.uniform(35, 65)),
        rise_cents=float(random.choice([0.5, 5.0, 20.0, 40.0])),
        f0_range_hz=(30.0, 1_000.0),
        highest_hz=9_000.0,
        damping=(0.4, 6.0),
        body_db=(-40.0, -12.0),
    )
    return made.samples, made.rate_hz


# One note of a string: changes of samples and their rate


def quieter(random: Random, samples: Array, rate_hz: int) -> Sound:
    """At -40 to 0 dBFS, in 16 bits."""
    peak = 10 ** (random.uniform(-40, 0) / 20)
    return np.round(samples / np.abs(samples).max() * peak * 32767) / 32768, rate_hz


def slightly_clipped(random: Random, samples: Array, rate_hz: int) -> Sound:
    """At most twelve samples at the limit, some of them in a row."""
    limit = np.sort(np.abs(samples))[-int(random.integers(4, 13))]
    return np.clip(samples, -limit, limit) / limit, rate_hz


def resampled(random: Random, samples: Array, rate_hz: int) -> Sound:
    target = int(random.choice([rate for rate in RATES_HZ if rate != rate_hz]))
    return at_rate(samples, rate_hz, target), target


def noisier(random: Random, samples: Array, rate_hz: int) -> Sound:
    """White or brown noise, below the peak."""
    level = 10 ** (float(random.choice(NOISE_DB)) / 20) * float(np.abs(samples).max())
    return samples + level * _noise(random, len(samples), float(random.choice([0.0, 1.0]))), rate_hz


def cut_before(random: Random, samples: Array, rate_hz: int) -> Sound:
    """0 to 20 ms are left of the lead."""
    left = round(random.uniform(0, 0.02) * rate_hz)
    return samples[max(0, onset_of(samples, rate_hz) - left) :], rate_hz


def cut_after(random: Random, samples: Array, rate_hz: int) -> Sound:
    """0.5 to 3 s after its beginning, with a fade of 10 ms or without."""
    part = samples[: onset_of(samples, rate_hz) + round(random.uniform(0.5, 3) * rate_hz)].copy()
    if random.random() < 0.5:
        fade = min(len(part), rate_hz // 100)
        part[-fade:] *= np.linspace(1, 0, fade)
    return part, rate_hz


def silent(place: str, random: Random, samples: Array, rate_hz: int) -> Sound:
    """Digital silence, one constant, or faint noise, for 0.2 to 3 s; with an offset over all where it is around."""
    if place == "around":
        quiet = np.zeros(round(random.uniform(0.2, 3) * rate_hz))
        return np.concatenate([quiet, samples, quiet]) + random.uniform(-0.05, 0.05), rate_hz
    if place == "after" and random.random() < 0.5:
        samples, _ = cut_after(random, samples, rate_hz)
    frames, made = round(random.uniform(0.2, 3) * rate_hz), int(random.integers(3))
    quiet = np.full(frames, float(random.uniform(-1e-3, 1e-3)) if made == 1 else 0.0)
    if made == 2:
        quiet = 1e-4 * random.standard_normal(frames)
    return np.concatenate([samples, quiet] if place == "after" else [quiet, samples]), rate_hz


def in_a_room(random: Random, samples: Array, rate_hz: int) -> Sound:
    """A small room, T60 of 0.15 to 0.5 s, 12 to 24 dB below the direct sound's energy."""
    t = np.arange(round(0.6 * rate_hz)) / rate_hz
    tail = random.standard_normal(len(t)) * 10 ** (-3 * t / random.uniform(0.15, 0.5))
    tail[: round(random.uniform(0.002, 0.01) * rate_hz)] = 0
    tail *= 10 ** (random.uniform(-24, -12) / 20) / math.sqrt(float(tail @ tail))
    return samples + signal.fftconvolve(samples, tail)[: len(samples)], rate_hz


def coded(container: str, subtype: str, random: Random, samples: Array, rate_hz: int) -> Sound:
    """Through a lossy coder and back."""
    if (subtype == "OPUS" and rate_hz != 48_000) or (container == "MP3" and rate_hz > 48_000):
        samples, rate_hz = at_rate(samples, rate_hz, 48_000), 48_000
    file = io.BytesIO()
    level = float(random.uniform(0.2, 0.9))
    samples = level * samples / np.abs(samples).max()
    quality = float(random.uniform(0.2, 0.8))
    soundfile.write(file, samples, rate_hz, format=container, subtype=subtype, compression_level=quality)
    file.seek(0)
    return soundfile.read(file)


def on_two_channels(random: Random, samples: Array, rate_hz: int) -> Sound:
    """The same on both, one louder or later by less than a millisecond, or one of them silent."""
    other = samples * random.uniform(0.2, 1)
    if random.random() < 0.3:
        other = np.zeros(len(samples))
    elif random.random() < 0.5:
        other = np.roll(other, round(random.uniform(0, 1e-3) * rate_hz))
    return np.stack([samples, other], 1), rate_hz


CHANGES: dict[str, Callable[[Random, Array, int], Sound]] = {
    "gain": quieter,
    "few samples clipped": slightly_clipped,
    "sample rate": resampled,
    "noise": noisier,
    "cut before": cut_before,
    "cut after": cut_after,
    "silence after": partial(silent, "after"),
    "silence before": partial(silent, "before"),
    "silence around, offset": partial(silent, "around"),
    "room": in_a_room,
    "MP3": partial(coded, "MP3", "MPEG_LAYER_III"),
    "Vorbis": partial(coded, "OGG", "VORBIS"),
    "Opus": partial(coded, "OGG", "OPUS"),
    "two channels": on_two_channels,
}


# No single note of a string


def chord(first: Sound, second: Sound, level_db: float) -> Sound | None:
    """Two notes at once, the second at a level of the first; None where they are octaves, or one pitch."""
    one, other = (number_note(note_of(*each)) for each in (first, second))
    if one is None or other is None:
        return None
    cents = 1200 * math.log2(one.f0_hz / other.f0_hz)
    if abs((cents + 600) % 1200 - 600) < OCTAVE_CENTS:
        return None
    (a, rate_hz), (b, other_hz) = first, second
    b = at_rate(b, other_hz, rate_hz)
    a, b = (each[onset_of(each, rate_hz) :] for each in (a, b))
    frames = min(len(a), len(b))
    a, b = a[:frames], b[:frames]
    b = b * 10 ** (level_db / 20) * math.sqrt(float(a @ a) / float(b @ b))
    return np.concatenate([np.zeros(rate_hz // 10), a + b]), rate_hz


def noise(random: Random, number: int) -> Sound:
    """Of any colour, that decays or stays."""
    rate_hz = 44_100
    t = np.arange(round(random.uniform(0.6, 3) * rate_hz)) / rate_hz
    sound = _noise(random, len(t), float(random.uniform(0, 2)))
    if number % 3:
        sound = sound * np.exp(-random.uniform(1, 12) * t)
    return np.concatenate([np.zeros(2_000), 0.1 * sound]), rate_hz


def membrane(random: Random, number: int = 0) -> Sound:
    """A drum's head: ratios of Bessel zeros, moved by some percent."""
    rate_hz = 44_100
    t = np.arange(round(1.5 * rate_hz)) / rate_hz
    ratios = np.array([1, 1.593, 2.136, 2.296, 2.653, 2.918, 3.156, 3.501, 3.6, 4.06, 4.15, 4.6])
    lowest = random.uniform(60, 300)
    sound = np.zeros(len(t))
    for ratio in ratios * (1 + 0.02 * random.standard_normal(len(ratios))):
        decay = random.uniform(4, 12) * ratio**0.5
        sound += random.uniform(0.2, 1) / ratio * np.sin(2 * np.pi * lowest * ratio * t) * np.exp(-decay * t)
    sound += 0.2 * random.standard_normal(len(t)) * np.exp(-60 * t)
    return np.concatenate([np.zeros(2_000), 0.2 * sound]) + 1e-5 * random.standard_normal(len(t) + 2_000), rate_hz


def at_rate(samples: Array, rate_hz: int, target_hz: int) -> Array:
    shared = math.gcd(rate_hz, target_hz)
    return samples if rate_hz == target_hz else signal.resample_poly(samples, target_hz // shared, rate_hz // shared)


def _noise(random: Random, frames: int, exponent: float) -> Array:
    """Of unit power, falling with frequency to an exponent of its amplitude."""
    spectrum = np.fft.rfft(random.standard_normal(frames))
    spectrum[1:] *= np.maximum(np.arange(1, len(spectrum)) / frames, 5e-4) ** -exponent
    spectrum[0] = 0
    sound = np.fft.irfft(spectrum, frames)
    return sound / math.sqrt(float(np.mean(sound**2)))
