"""A reader of impulse responses: sound files, which may come from anywhere and are checked in every respect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.audio.sound_file import UnreadableSound, open_sound
from engine import bounds
from engine.effects import Impulse
from engine.plain_text import LineError

FORMATS = ("WAV", "FLAC", "AIFF")
SILENT_SHARE = 0.01  # of the peak: below it a response has not begun
LEAD_S = 0.001  # kept before its onset
LONGEST_FILE_S = 30.0  # of a response, its noise included; a longer file is another sound


class ImpulseError(LineError):
    """A file cannot be used as an impulse response. The message, one line, names it, what is wrong and the remedy."""


def read_impulse(path: Path) -> Impulse:
    """The impulse response in a WAV, FLAC or AIFF file, at its own rate; effects resample it to the mixer's.

    It begins at its onset: a body is no room, so that silence before it would only delay the strings. Of a response
    that is longer than LONGEST_IMPULSE_S it is that beginning, faded out. `cut_words` has both in words.

    Raises:
        ImpulseError: it cannot be read, is of another format, lasts longer than LONGEST_FILE_S, or lies outside
            `engine.bounds` (size, rate, channels, values).
    """
    samples, rate_hz = _read(path)
    samples = samples[_onset(samples, rate_hz) :]
    most = int(bounds.LONGEST_IMPULSE_S * rate_hz)  # frames
    try:
        from engine.effects.responses import faded  # brings the compiler

        return Impulse(faded(samples[:most]) if len(samples) > most else samples, rate_hz)
    except ValueError as error:
        raise _unusable_error(path, error) from error


def cut_words(path: Path) -> str:
    """The parts of this file that `read_impulse` leaves out, in a sentence; "" where it takes all of it."""
    samples, rate_hz = _read(path)
    silent, longest_s = _onset(samples, rate_hz), bounds.LONGEST_IMPULSE_S
    begins = f"without {1000 * silent / rate_hz:.0f} ms of silence before it" if silent else ""
    if len(samples) - silent <= int(longest_s * rate_hz):
        return (silent and f"{path.name} is the body {begins}.") or ""
    lasts = f"{path.name} lasts {len(samples) / rate_hz:.2f} s: its first {longest_s:g} s, faded out, are the body"
    return f"{lasts}, {begins}." if silent else f"{lasts}."


def _read(path: Path) -> tuple[NDArray[np.float64], int]:
    """All samples of a file, (frames, channels), and its rate in Hz. Raises ImpulseError, as `read_impulse`."""
    try:
        with open_sound(path, bounds.LARGEST_IMPULSE_BYTES) as file:
            if file.format not in FORMATS:
                raise ImpulseError(f"{path}: is {file.format}; save it as WAV or FLAC")
            bounds.check("its rate", file.samplerate, bounds.IMPULSE_RATE_HZ, "Hz")
            bounds.check("its channels", file.channels, (1, bounds.MOST_IMPULSE_CHANNELS))
            bounds.check("its length", round(file.frames / file.samplerate, 3), (0.0, LONGEST_FILE_S), "s")
            return file.read(file.frames, "float64", always_2d=True), file.samplerate
    except UnreadableSound as error:
        raise ImpulseError(f"{path}: no sound file that can be read ({error}); give a WAV or FLAC") from error
    except ValueError as error:
        raise _unusable_error(path, error) from error


def _onset(samples: NDArray[np.float64], rate_hz: int) -> int:
    """The frame at which a response begins, shortly before it rises; 0 where it begins at once."""
    levels = np.abs(samples).max(axis=1)
    peak = levels.max(initial=0.0)
    if not 0 < peak < np.inf:  # refused later; not a number is neither
        return 0
    return max(0, int(np.argmax(levels >= SILENT_SHARE * peak)) - round(LEAD_S * rate_hz))


def _unusable_error(path: Path, error: ValueError) -> ImpulseError:
    return ImpulseError(
        f"{path}: no impulse response that can be used ({error}); give another, mono or stereo, of up to"
        f" {LONGEST_FILE_S:g} s"
    )
