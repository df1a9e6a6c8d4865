"""Reads an impulse response from a sound file, which may come from anywhere and is checked in every respect."""

from __future__ import annotations

from pathlib import Path

import soundfile

from engine import bounds
from engine.effects import Impulse
from engine.effects.impulse import faded
from engine.plain_text import one_line

FORMATS = ("WAV", "WAVEX", "RF64", "FLAC", "AIFF")
LONGEST_FILE_S = 30.0  # of a response, its noise included; a longer file is another sound


class ImpulseError(Exception):
    """A file cannot be used as an impulse response. The message, one line, names it, what is wrong and the remedy."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def read_impulse(path: Path) -> Impulse:
    """The impulse response in a WAV, FLAC or AIFF file, at its own rate; effects resample it to the mixer's.

    Of a file that is longer than LONGEST_IMPULSE_S it is that beginning, faded out: see `cut_words`.

    Raises:
        ImpulseError: it cannot be read, is of another format, lasts longer than LONGEST_FILE_S, or lies outside
            `engine.bounds` (size, rate, channels, values).
    """
    try:
        if not path.is_file():  # opening a pipe would block
            raise ImpulseError(f"{path}: no file; check the name")
        if path.stat().st_size > bounds.LARGEST_IMPULSE_BYTES:
            raise ImpulseError(
                f"{path}: larger than the {bounds.LARGEST_IMPULSE_BYTES // 2**20} MiB that it may have; cut it"
            )
        with soundfile.SoundFile(path) as file:
            if file.format not in FORMATS:
                raise ImpulseError(f"{path}: is {file.format}; save it as WAV or FLAC")
            bounds.check("its rate", file.samplerate, bounds.IMPULSE_RATE_HZ, "Hz")
            bounds.check("its channels", file.channels, (1, bounds.MOST_IMPULSE_CHANNELS))
            bounds.check("its length", round(file.frames / file.samplerate, 3), (0.0, LONGEST_FILE_S), "s")
            most = int(bounds.LONGEST_IMPULSE_S * file.samplerate)
            samples = file.read(most + 1, "float64", always_2d=True)
            return Impulse(faded(samples[:most]) if len(samples) > most else samples, file.samplerate)
    except (OSError, soundfile.SoundFileError) as error:
        words = error.strerror if isinstance(error, OSError) else str(error).rpartition(":")[2].strip(" .")
        raise ImpulseError(f"{path}: no sound file that can be read ({words}); give a WAV or FLAC") from error
    except ValueError as error:
        raise ImpulseError(
            f"{path}: no impulse response that can be used ({error}); give another, mono or stereo, of up to"
            f" {LONGEST_FILE_S:g} s"
        ) from error


def cut_words(path: Path) -> str:
    """That `read_impulse` takes only the beginning of this file, which it has read; "" where it takes all of it."""
    with soundfile.SoundFile(path) as file:
        frames, rate_hz = file.frames, file.samplerate
    longest_s = bounds.LONGEST_IMPULSE_S
    if frames <= int(longest_s * rate_hz):
        return ""
    return f"{path.name} lasts {frames / rate_hz:.2f} s: its first {longest_s:g} s, faded out, are the body."
