"""A recorded note: mono samples, where they begin, and their noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from engine.effects.responses import resampled
from engine.resonators.base import Array

HIGHEST_RATE_HZ = 48_000  # recordings of higher rates are converted: nothing above 24 kHz is fitted
LOWEST_RATE_HZ = 8_000
LONGEST_S = 60.0
SHORTEST_S = 0.15
SILENT = 1e-5  # of full scale: a peak below it is no recording
ALIKE = 0.9  # correlation of two channels that are averaged; otherwise the louder one is taken
FIT_BEGINS_S = 0.008  # after the onset: the attack itself is no free vibration
FIT_LASTS_S = 2.492  # until 2.5 s after the onset


class RecordingError(ValueError):
    """A recording from which nothing can be learned; the message gives the reason and the remedy."""


@dataclass(frozen=True)
class Note:
    """A recording, mono.

    Attributes:
        samples: float64 (frames,), without the digital silence behind the note.
        onset: the frame in which the note begins.
        noise_power: mean square of what the recording holds before the note or at its end, whichever is lower.
    """

    samples: Array
    rate_hz: int
    onset: int
    noise_power: float

    @property
    def seconds(self) -> float:
        """The time from the onset to the end."""
        return (len(self.samples) - self.onset) / self.rate_hz

    def part(self, begin_s: float, end_s: float) -> Array:
        """The samples from one time after the onset to another."""
        first = self.onset + round(begin_s * self.rate_hz)
        return self.samples[first : self.onset + round(end_s * self.rate_hz)]

    def fitted(self, seconds: float = FIT_LASTS_S) -> Array:
        """The part that is fitted and judged: from 8 ms after the onset, at most so long."""
        return self.part(FIT_BEGINS_S, FIT_BEGINS_S + seconds)


def note_of(samples: Array, rate_hz: int) -> Note:
    """The note of samples (frames,) or (frames, channels).

    Raises:
        RecordingError: nothing can be heard in it, or it is no sound of one note.
    """
    mono = _mono(samples)
    if not np.isfinite(mono).all():
        raise RecordingError("it holds samples that are not numbers (NaN or infinite); export it again")
    if rate_hz < LOWEST_RATE_HZ:
        raise RecordingError(f"its rate is {rate_hz} Hz; record at 44100 Hz or more")
    seconds = len(mono) / rate_hz
    if seconds > LONGEST_S:
        raise RecordingError(f"it lasts {seconds:.0f} s; cut out one note, at most {LONGEST_S:.0f} s")
    if seconds < SHORTEST_S:
        raise RecordingError(f"it lasts {seconds:.2f} s; let the note ring for two seconds or more")
    mono = _without_silence(mono)
    if float(np.abs(mono).max()) < SILENT:
        raise RecordingError("it is silent; check the cable and the level, and record it again")
    if rate_hz > HIGHEST_RATE_HZ:
        target = HIGHEST_RATE_HZ if rate_hz % HIGHEST_RATE_HZ == 0 else 44_100
        mono, rate_hz = resampled(mono[:, None], rate_hz, target)[:, 0], target
    onset = onset_of(mono, rate_hz)
    return Note(mono, rate_hz, onset, _noise_power(mono, rate_hz, onset))


def envelope(samples: Array, rate_hz: int, window_s: float = 0.004) -> Array:
    """The root mean square in a window centred on each sample, (frames,)."""
    width = max(1, round(window_s * rate_hz))
    power = signal.fftconvolve(samples**2, np.full(width, 1 / width), mode="same")
    return np.sqrt(np.maximum(power, 0.0))


def onset_of(samples: Array, rate_hz: int, share: float = 0.1) -> int:
    """The frame before the peak of the envelope at which it last lay below a share of that peak."""
    level = envelope(samples, rate_hz)
    loud = np.flatnonzero(level > 0.5 * level.max())
    first = int(loud[0])
    quiet = np.flatnonzero(level[:first] < share * level.max())
    return int(quiet[-1]) + 1 if len(quiet) else 0


def _mono(samples: Array) -> Array:
    """A single channel (frames,), float64: the mean of two that are alike, else the one with most energy."""
    sound = np.asarray(samples, np.float64)
    if sound.ndim == 1:
        return sound
    stereo = sound.shape[1] == 2 and bool(np.isfinite(sound).all() and (sound.std(0) > 0).all())
    if stereo and float(np.ravel(np.corrcoef(sound.T))[1]) > ALIKE:
        return sound.mean(1)
    loudest = int(np.argmax(np.nansum(np.where(np.isfinite(sound), sound, 0.0) ** 2, axis=0)))
    return sound[:, loudest]


def _without_silence(sound: Array) -> Array:
    """The sound around zero, up to where it stops: one value, again and again, is silence. Times stay as they are."""
    moves = np.flatnonzero(np.diff(sound))
    if len(moves) == 0:
        return np.zeros(len(sound))
    # of two equal samples or more, none belongs to the note
    first = int(moves[0]) + 1 if moves[0] > 0 else 0
    end = int(moves[-1]) + 1 if moves[-1] < len(sound) - 2 else len(sound)
    sounding = sound[first:end]
    return np.concatenate([np.zeros(first), sounding - sounding.mean()])


def _noise_power(samples: Array, rate_hz: int, onset: int) -> float:
    """The least mean square of blocks of 0.05 s before the onset and at the end; 1e-14 where all of them are 0."""
    block = max(1, round(0.05 * rate_hz))
    blocks = [samples[first : first + block] for first in range(0, max(0, onset - block // 2 - block), block)]
    count = min(6, (len(samples) - onset) // (2 * block))
    blocks += [samples[end - block : end] for end in range(len(samples), len(samples) - count * block, -block)]
    powers = [float(np.mean(of_block**2)) for of_block in blocks if len(of_block)]
    return min((power for power in powers if power > 0), default=1e-14)
