"""Recordings of notes, read from sound files of any kind, with all that can be wrong with them in words."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.audio.sound_file import UnreadableSound, open_sound
from engine.plain_text import LineError

RATES_HZ = (8_000, 384_000)
NOTE_LENGTHS_S = SHORTEST_S, LONGEST_S = 0.15, 60.0
MOST_CHANNELS = 8
MOST_NUMBERS = 50_000_000  # of all channels: 400 MB; a minute of two channels at 384 kHz
LARGEST_BYTES = 512 * 2**20  # of a file
LARGEST_SAMPLE = 2.0**15  # in full scales: of whole numbers of 16 bits in a file of floating point


class NoteFileError(LineError):
    """A file cannot be read as a recording. The message, one line, names it, what is wrong and the remedy."""


@dataclass(frozen=True)
class NoteFile:
    """A recording: samples (frames, channels) with ±1 as full scale, and the SHA-256 of its file."""

    path: Path
    samples: NDArray[np.float64]
    rate_hz: int
    digest: str


def read_note(path: Path) -> NoteFile:
    """The sound of a WAV, FLAC, AIFF or Ogg file.

    Samples have 8 bits to floating point, in any number of channels up to 8.

    Raises:
        NoteFileError: it cannot be read, or is too long, too large or empty.
    """
    try:
        with open_sound(path, LARGEST_BYTES) as file:
            low, high = RATES_HZ
            if not low <= file.samplerate <= high:
                raise NoteFileError(
                    f"{path}: its rate, {file.samplerate} Hz, is not in {low} … {high}; export it again"
                )
            if file.channels > MOST_CHANNELS:
                raise NoteFileError(f"{path}: has {file.channels} channels; export one or two")
            seconds = file.frames / file.samplerate
            if seconds > LONGEST_S:
                raise NoteFileError(f"{path}: lasts {seconds:.0f} s; cut out one note, at most {LONGEST_S:.0f} s")
            if file.frames * file.channels > MOST_NUMBERS:
                size_words = f"{file.channels} channels of {file.samplerate} Hz for {seconds:.0f} s"
                raise NoteFileError(f"{path}: has {size_words}, which is too much; export one or two")
            samples = file.read(file.frames, "float64", always_2d=True)
            rate_hz = file.samplerate
        if len(samples) == 0:
            raise NoteFileError(f"{path}: holds no samples; export it again")
        peak = float(max(samples.max(), -samples.min()))
        if LARGEST_SAMPLE < peak < np.inf:  # what is no number is refused with the sound
            raise NoteFileError(f"{path}: its largest sample is {peak:.3g} times full scale; normalise it")
        with path.open("rb") as data:
            digest = hashlib.file_digest(data, "sha256").hexdigest()
    except UnreadableSound as error:
        raise NoteFileError(f"{path}: no sound file that can be read ({error}); give a WAV or FLAC") from error
    except OSError as error:
        raise NoteFileError(f"{path}: cannot be read ({error.strerror}); check the name") from error
    return NoteFile(path, samples, rate_hz, digest)
