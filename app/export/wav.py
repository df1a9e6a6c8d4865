"""WAV and FLAC from samples: level, fade, dither, rounding, tags, written to an open file.

libsndfile only stores: all that changes a number is done here, in NumPy, where it can be tested.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np
import soundfile
from numpy.typing import NDArray

from app.export.recording import SoundSamples, blocks
from app.shared.vocabulary import BITS, DIFFERENCE_GAIN_RANGE_DB, FORMATS, WRITTEN_ENDINGS, Bits
from engine import bounds

T = TypeVar("T")
RATE_RANGE_HZ = (1_000, 384_000)
LONGEST_S = 600.0  # of a note, and of its fade-out
DECAY_RANGE_DB = (10.0, 120.0)
RANGES = {
    "rate_hz": RATE_RANGE_HZ,
    "decay_db": DECAY_RANGE_DB,
    "difference_gain_db": DIFFERENCE_GAIN_RANGE_DB,
    "fade_out_s": (0.0, LONGEST_S),
}
LONGEST_TAG_BYTES = 2_000  # libsndfile does not read back INFO texts of 2048 bytes or more
HIGHEST_ODD_RATE_HZ = 65_535  # FLAC states higher ones in tens of Hz
NORMALISED_PEAK = 10 ** (-1 / 20)  # -1 dBFS: leaves headroom for peaks between samples

_SUBTYPES: dict[Bits, str] = {"16": "PCM_16", "24": "PCM_24", "32f": "FLOAT"}
HEAD_BYTES = 2**16  # of the file, in which all chunks before the samples lie
_DITHER_SEED = 0  # the same sound makes the same file


@dataclass(frozen=True)
class WavSettings:
    """The settings of a sound file.

    Attributes:
        bits: integers of 16 (with TPDF dither) or 24 bits, or in WAV 32-bit floating point, which never clips.
        rate_hz: at which the sound is rendered; None: the preset's own rate.
        normalise: to -1 dBFS, by one gain for all channels and for the sounds that belong together.
        fade_out_s: the length of the fade at the end, so that a decay that is cut off does not click.
        decay_db: a note ends where both model and truth have fallen this far below their maximum. So all files of a
            note have the same length. None: it lasts as long as its sound says.
        difference_gain_db: gain of a note's difference.
        level_match: whether a note's model is brought to the level of its truth, in its difference too.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """

    bits: Bits = "24"
    rate_hz: int | None = None
    normalise: bool = False
    fade_out_s: float = 0.010
    decay_db: float | None = None
    difference_gain_db: float = 0.0
    level_match: bool = False

    def __post_init__(self) -> None:
        bounds.check_choice("bits", self.bits, BITS)
        bounds.check_all(self, RANGES)


@dataclass(frozen=True)
class WrittenSound:
    """The sound of a file that was written.

    Attributes:
        peak_db: the largest sample in dBFS before any clipping; -inf for silence.
        clipped: samples beyond full scale that were clipped; always 0 in floating point.
        gain_db: the gain of normalising; 0 without.
    """

    frames: int
    rate_hz: int
    peak_db: float
    clipped: int
    gain_db: float

    @property
    def seconds(self) -> float:
        return self.frames / self.rate_hz


def form_of(path: Path, bits: Bits, rate_hz: int) -> str:
    """The form of a file by the ending of its name, "WAV" or "FLAC".

    Raises:
        ValueError: it has no such ending, or its form neither these bits nor this rate.
    """
    ending = path.suffix.lower()
    if ending not in WRITTEN_ENDINGS:
        raise ValueError(f"{path}: must end with {' or '.join(WRITTEN_ENDINGS)}")
    if f"{ending[1:]} {bits}" not in FORMATS:
        raise ValueError(f"{path}: FLAC has no floating point; choose 24 bits, or WAV")
    if ending == ".flac" and rate_hz > HIGHEST_ODD_RATE_HZ and rate_hz % 10:
        raise ValueError(f"{path}: FLAC has no sample rate of {rate_hz} Hz; choose a multiple of 10 Hz, or WAV")
    return ending[1:].upper()


def write_wav(
    file: BinaryIO,
    sound: SoundSamples,
    rate_hz: int,
    settings: WavSettings,
    tags: Mapping[str, str],
    beside: Sequence[SoundSamples] = (),
    form: str = "WAV",
) -> WrittenSound:
    """Write a WAV or FLAC file of a sound, (frames,) or (frames, channels), where ±1 is full scale.

    It is written block by block, so that memory does not grow with its length.

    Args:
        file: open for reading and writing, empty.
        rate_hz: of the sound; `settings.rate_hz` is ignored.
        tags: INFO texts or Vorbis comments by soundfile's names (title, comment …), of at most 2000 bytes each.
        beside: other sounds that share the gain when normalising.
        form: see `form_of`.

    Raises:
        ValueError: a sample is not finite, there are none, or a tag is too long.
        OSError: the file cannot be written.
    """
    for name, text in tags.items():
        if len(text.encode()) > LONGEST_TAG_BYTES:
            raise ValueError(f"the tag {name} is longer than {LONGEST_TAG_BYTES} bytes; shorten it")
    if len(sound) == 0:
        raise ValueError("there are no samples to write; choose a longer duration")
    fade_frames = round(settings.fade_out_s * rate_hz)
    peak = max(
        _peak(_fade_block(_check_finite(block), first, len(sound), fade_frames)) for first, block in blocks(sound)
    )
    gain, clipped = 1.0, 0
    if settings.normalise:
        loudest = max([peak, *(_peak(block) for other in beside for _, block in blocks(other))])
        gain = NORMALISED_PEAK / loudest if loudest > 0 else 1.0
    channels = 1 if sound[:1].ndim == 1 else sound[:1].shape[1]
    noting = _Noting(file)
    with soundfile.SoundFile(noting, "w", rate_hz, channels, _SUBTYPES[settings.bits], format=form) as out:
        for name, text in tags.items():
            setattr(out, name, text)
        for first, block in blocks(sound):
            faded = _fade_block(block, first, len(sound), fade_frames)
            numbers, cut = quantised(faded * gain, settings.bits, first, len(sound))
            with suppress(soundfile.SoundFileError, AssertionError):  # of a full disk, whose OSError `check` raises
                out.write(numbers)
            noting.check()
            clipped += cut
    noting.check()
    _zero_time(file, channels)
    return WrittenSound(len(sound), rate_hz, _decibel(peak * gain), clipped, _decibel(gain))


def is_within_full_scale(sound: SoundSamples) -> bool:
    """Return True if no sample of a sound exceeds full scale."""
    return all(_peak(block) <= 1 for _, block in blocks(sound))


class _Noting:
    """A file for libsndfile, which cannot pass on an OSError: the first one is kept and raised by `check`.

    A full disk fails any of the calls, as a seek writes what is buffered. After the first failure nothing more is
    written, and the calls return what satisfies libsndfile.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._error: OSError | None = None

    def write(self, data: bytes) -> int:
        return self._call_file(self._file.write, data, failed=len(data))

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._call_file(self._file.seek, offset, whence, failed=0)

    def tell(self) -> int:
        return self._call_file(self._file.tell, failed=0)

    def read(self, size: int = -1) -> bytes:
        return self._call_file(self._file.read, size, failed=b"")

    def _call_file(self, call: Callable[..., T], *arguments: object, failed: T) -> T:
        """Call a method of the file; from its first OSError on, which is kept, return `failed`."""
        if self._error is None:
            try:
                return call(*arguments)
            except OSError as error:
                self._error = error
        return failed

    def check(self) -> None:
        """Raise the OSError of the first call that failed, if one did."""
        if self._error is not None:
            raise self._error


def _zero_time(file: BinaryIO, channels: int) -> None:
    """Zero the time of writing in the chunk PEAK, so that the same sound makes the same bytes."""
    file.seek(0)
    place = file.read(HEAD_BYTES).find(b"PEAK" + struct.pack("<II", 8 * (1 + channels), 1))
    if place >= 0:
        file.seek(place + 12)  # behind name, size and version
        file.write(bytes(4))


def _fade_block(block: NDArray[np.floating], first: int, total: int, frames: int) -> NDArray[np.float64]:
    """A block that begins at frame `first` of `total`, with its part of the fade-out over the last `frames`."""
    frames = min(frames, total)
    begin = max(0, total - frames - first)  # in the block
    faded: NDArray[np.float64] = block.astype(np.float64)
    if begin < len(faded):
        place = np.arange(first + begin, first + len(faded)) - (total - frames) + 1
        fade = 0.5 + 0.5 * np.cos(np.pi * place / frames)
        faded[begin:] *= fade.reshape(-1, *[1] * (faded.ndim - 1))
    return faded


def _peak(block: NDArray[np.floating]) -> float:
    return float(np.abs(block).max(initial=0.0))


def _check_finite(block: NDArray[np.floating]) -> NDArray[np.floating]:
    if not bool(np.isfinite(block).all()):
        raise ValueError("the sound holds values that are not finite; choose another source or a shorter duration")
    return block


def faded_out(samples: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """The sound with its last `frames` faded to zero along half a cosine."""
    return _fade_block(samples, 0, len(samples), frames)


def quantised(
    samples: NDArray[np.float64], bits: Bits, first: int = 0, total: int | None = None
) -> tuple[NDArray[np.generic], int]:
    """The numbers that the file stores, as soundfile takes them, and how many were clipped.

    At 16 bits triangular dither of ±1 step makes the rounding error a noise independent of the sound. At 24 bits
    there is none: the step is 144 dB below full scale, below any converter's own noise.

    Args:
        first, total: the samples are a block that begins at frame `first` of `total`, and get its part of the dither.
    """
    if bits == "32f":
        return samples.astype(np.float32), 0
    depth = int(bits)
    steps = samples * 2.0 ** (depth - 1)
    if depth == 16:
        channels = math.prod(samples.shape[1:])
        whole = len(samples) if total is None else total
        generators = (np.random.PCG64(_DITHER_SEED).advance((start + first) * channels) for start in (0, whole))
        one, other = (np.random.Generator(generator).random(samples.shape) for generator in generators)
        steps += one - other
    steps = np.rint(steps)
    largest = 2 ** (depth - 1) - 1
    clipped = int(((steps > largest) | (steps < -largest - 1)).sum())
    rounded = np.clip(steps, -largest - 1, largest).astype(np.int32)
    return rounded << (32 - depth), clipped  # soundfile takes the upper bits of an int32


def _decibel(ratio: float) -> float:
    return 20 * float(np.log10(ratio)) if ratio > 0 else float("-inf")
