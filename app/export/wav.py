"""WAV bytes from samples: rate, level, fade, dither, rounding, tags. Nothing here touches a file.

libsndfile stores what it is given; whatever changes a number is done here, in NumPy, where it can be tested.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import soundfile
import soxr
from numpy.typing import NDArray

from app.export.wav_chunks import Marker, with_markers, without_time_stamp
from app.shared.vocabulary import BITS, Bits

RATE_RANGE_HZ = (1_000, 384_000)
LONGEST_TAG_BYTES = 2_000  # libsndfile reads back no INFO text of 2048 bytes or more
NORMALISED_PEAK = 10 ** (-1 / 20)  # -1 dBFS: leaves room for the peaks between samples

_SUBTYPES: dict[Bits, str] = {"16": "PCM_16", "24": "PCM_24", "32f": "FLOAT"}
_DITHER_SEED = 0  # the same sound makes the same file


@dataclass(frozen=True)
class WavSettings:
    """How samples become a file.

    Attributes:
        bits: integers of 16 (with TPDF dither) or 24 bits, or 32-bit floating point, which never clips.
        rate_hz: None keeps the samples' own rate. A higher one adds no bandwidth.
        normalise: to -1 dBFS, by one gain for all channels and for the sounds that belong together.
        fade_out_s: at the end, so that a decay that is cut does not click.
    """

    bits: Bits = "24"
    rate_hz: int | None = None
    normalise: bool = False
    fade_out_s: float = 0.010

    def __post_init__(self) -> None:
        if self.bits not in BITS:
            raise ValueError(f"bits {self.bits!r} is not one of {', '.join(BITS)}")
        low, high = RATE_RANGE_HZ
        if self.rate_hz is not None and not low <= self.rate_hz <= high:
            raise ValueError(f"rate must lie in {low} … {high} Hz, not {self.rate_hz}")
        if not self.fade_out_s >= 0:
            raise ValueError(f"fade_out_s must not be negative, not {self.fade_out_s}")


@dataclass(frozen=True)
class Level:
    """Peak in dBFS before clipping (-inf: silence), number of samples clipped, and the gain applied."""

    peak_db: float
    clipped: int
    gain_db: float


@dataclass(frozen=True)
class EncodedWav:
    """A whole WAV file in memory."""

    data: bytes
    level: Level
    frames: int
    rate_hz: int


def encode_wav(
    samples: NDArray[np.floating],
    rate_hz: int,
    settings: WavSettings,
    tags: dict[str, str],
    beside: Sequence[NDArray[np.float64]] = (),
    labels: Mapping[str, float] | None = None,
) -> EncodedWav:
    """A WAV file of samples (frames,) or (frames, channels) where ±1 is full scale.

    Args:
        tags: INFO texts by soundfile's names (title, software, comment), each of at most 2000 bytes.
        beside: other sounds of the same rate that share the gain when normalising.
        labels: names of markers and their times in s; those past the end are left out.

    Raises:
        ValueError: a sample is not finite, there are none, or a tag is too long.
    """
    _check(samples, tags)
    new_rate_hz = settings.rate_hz or rate_hz
    sound = resampled(samples.astype(np.float64), rate_hz, new_rate_hz)
    sound = faded_out(sound, round(settings.fade_out_s * new_rate_hz))
    peak = float(np.abs(sound).max())
    loudest = max([peak, *(float(np.abs(resampled(other, rate_hz, new_rate_hz)).max()) for other in beside)])
    gain = NORMALISED_PEAK / loudest if settings.normalise and loudest > 0 else 1.0
    stored, clipped = quantised(sound * gain, settings.bits)
    level = Level(_decibel(peak * gain), clipped, _decibel(gain))
    places = {label: round(time_s * new_rate_hz) for label, time_s in (labels or {}).items()}
    markers = [Marker(frame, label) for label, frame in places.items() if frame < len(sound)]
    data = with_markers(_file(stored, new_rate_hz, settings.bits, tags), markers)
    return EncodedWav(data, level, len(sound), new_rate_hz)


def resampled(samples: NDArray[np.float64], rate_hz: int, new_rate_hz: int) -> NDArray[np.float64]:
    """The same duration at another rate, band-limited; untouched where the rates are equal."""
    if rate_hz == new_rate_hz:
        return samples
    frames = round(len(samples) * new_rate_hz / rate_hz)
    sound = soxr.resample(samples, rate_hz, new_rate_hz, quality="VHQ")[:frames]
    return np.concatenate([sound, np.zeros((frames - len(sound), *sound.shape[1:]))])


def faded_out(samples: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """The last `frames` brought to zero along half a cosine."""
    frames = min(frames, len(samples))
    if frames == 0:
        return samples
    fade = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, frames + 1) / frames)
    faded = samples.copy()
    faded[-frames:] *= fade.reshape(-1, *[1] * (samples.ndim - 1))
    return faded


def quantised(samples: NDArray[np.float64], bits: Bits) -> tuple[NDArray[np.generic], int]:
    """The numbers that the file stores, as soundfile takes them, and how many were clipped.

    Triangular dither of ±1 step at 16 bits makes the rounding error a noise that does not follow the sound;
    at 24 bits the step lies 144 dB down, below any converter's own noise.
    """
    if bits == "32f":
        return samples.astype(np.float32), 0
    depth = int(bits)
    steps = samples * 2.0 ** (depth - 1)
    if depth == 16:
        draw = np.random.default_rng(_DITHER_SEED).random((2, *samples.shape))
        steps += draw[0] - draw[1]
    steps = np.rint(steps)
    largest = 2 ** (depth - 1) - 1
    clipped = int(((steps > largest) | (steps < -largest - 1)).sum())
    whole = np.clip(steps, -largest - 1, largest).astype(np.int32)
    return whole << (32 - depth), clipped  # soundfile takes the upper bits of an int32


def _check(samples: NDArray[np.floating], tags: dict[str, str]) -> None:
    if len(samples) == 0:
        raise ValueError("there are no samples to write; choose a longer duration")
    if not bool(np.isfinite(samples).all()):
        raise ValueError("the sound holds values that are not finite; choose another source or a shorter duration")
    for name, text in tags.items():
        if len(text.encode()) > LONGEST_TAG_BYTES:
            raise ValueError(f"the tag {name} is longer than {LONGEST_TAG_BYTES} bytes; shorten it")


def _file(stored: NDArray[np.generic], rate_hz: int, bits: Bits, tags: dict[str, str]) -> bytes:
    channels = 1 if stored.ndim == 1 else stored.shape[1]
    buffer = io.BytesIO()
    with soundfile.SoundFile(buffer, "w", rate_hz, channels, _SUBTYPES[bits], format="WAV") as file:
        for name, text in tags.items():
            setattr(file, name, text)
        file.write(stored)
    return without_time_stamp(buffer.getvalue())


def _decibel(ratio: float) -> float:
    return 20 * float(np.log10(ratio)) if ratio > 0 else float("-inf")
