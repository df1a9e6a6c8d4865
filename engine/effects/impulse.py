"""An impulse response as a value: checked, at another rate, as loud as what it is given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from engine import bounds

LOUDNESS_HZ = (80.0, 3_000.0)  # of the noise that shall keep its level: most of what a plucked string has
PEAK = (1e-6, 1e6)
LARGEST_GAIN = 1e3  # at any frequency, of a response that is as loud as what it is given
FADE_SHARE = 0.1  # of a response that is cut: its end


@dataclass(frozen=True, eq=False)
class Impulse:
    """An impulse response from anywhere, (frames, 1 or 2).

    Raises:
        ValueError: it is too long, has too many channels, is silent or inaudible, or has samples that are no numbers.
    """

    samples: NDArray[np.float64]
    rate_hz: int

    def __post_init__(self) -> None:
        bounds.check("its rate", self.rate_hz, bounds.IMPULSE_RATE_HZ, "Hz")
        if self.samples.ndim != 2:
            raise ValueError(f"an impulse response is (frames, channels), not of {self.samples.ndim} dimensions")
        bounds.check("its channels", self.samples.shape[1], (1, bounds.MOST_IMPULSE_CHANNELS))
        bounds.check("its length", len(self.samples) / self.rate_hz, (0.0, bounds.LONGEST_IMPULSE_S), "s")
        if not np.isfinite(self.samples).all():
            raise ValueError("it has samples that are no numbers")
        peak = float(np.abs(self.samples).max(initial=0.0))
        if peak < PEAK[0]:
            raise ValueError("it is silent")
        bounds.check("its largest sample", peak, PEAK)
        spectrum = np.abs(np.fft.rfft(as_loud(self.samples, self.rate_hz), room_for(2 * len(self.samples)), axis=0))
        if not spectrum.max() <= LARGEST_GAIN:
            raise ValueError(f"it has next to nothing between {LOUDNESS_HZ[0]:g} and {LOUDNESS_HZ[1]:g} Hz")


def room_for(frames: int) -> int:
    """A length that is fast to transform, at least so many frames."""
    return 1 << (frames - 1).bit_length()


def resampled(samples: NDArray[np.float64], from_hz: float, to_hz: float) -> NDArray[np.float64]:
    """(frames, channels) at another rate, by its Fourier series with as much silence: any ratio, in bounded time."""
    if from_hz == to_hz:
        return samples
    ratio = Fraction(to_hz / from_hz).limit_denominator(1000)  # to thousandths of a cent
    units = math.ceil(len(samples) / ratio.denominator)
    padded, made = 2 * units * ratio.denominator, 2 * units * ratio.numerator
    frames = max(1, round(len(samples) * to_hz / from_hz))
    spectrum = np.zeros((made // 2 + 1, samples.shape[1]), complex)
    kept = min(made, padded) // 2  # and not the last, whose phase is lost
    spectrum[:kept] = np.fft.rfft(samples, padded, axis=0)[:kept]
    return np.fft.irfft(spectrum, made, axis=0)[:frames] * (made / padded)


def convolved(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """The convolution of two sounds (frames, channels) each; one channel goes with any number."""
    frames = len(one) + len(other) - 1
    size = room_for(frames)
    return np.fft.irfft(np.fft.rfft(one, size, axis=0) * np.fft.rfft(other, size, axis=0), size, axis=0)[:frames]


def without_subsonic(samples: NDArray[np.float64], edge_hz: float, rate_hz: int) -> NDArray[np.float64]:
    """Filter samples through Butterworth's high-pass of second order."""
    size = room_for(2 * len(samples))
    s = 1j * np.fft.rfftfreq(size, 1 / rate_hz)[:, None] / edge_hz
    response = s**2 / (s**2 + np.sqrt(2) * s + 1)
    return np.fft.irfft(np.fft.rfft(samples, size, axis=0) * response, size, axis=0)[: len(samples)]


def faded(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """The samples with their end faded to nothing."""
    frames = max(1, round(FADE_SHARE * len(samples)))
    end = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, frames + 1) / frames)
    return np.concatenate([samples[:-frames], samples[-frames:] * end[:, None]])


def as_loud(samples: NDArray[np.float64], rate_hz: int) -> NDArray[np.float64]:
    """The response times a factor: noise of equal power in each octave keeps it, in the mean of both channels."""
    return samples / max(np.sqrt(noise_powers((samples,), rate_hz)[0, 0]), 1e-30)


def noise_powers(responses: Sequence[NDArray[np.float64]], rate_hz: int) -> NDArray[np.float64]:
    """The power of noise through each response, and what each two have in common: (responses, responses).

    Of equal power in each octave; the mean of both channels. A sum of responses has the sum of all.
    """
    size = room_for(max(*(len(each) for each in responses), rate_hz // 4))
    frequency_hz = np.linspace(0.0, rate_hz / 2, size // 2 + 1)
    heard = (frequency_hz >= LOUDNESS_HZ[0]) & (frequency_hz <= LOUDNESS_HZ[1])
    weights = 1 / frequency_hz[heard]
    spectra = np.zeros((len(responses), len(weights), 2), complex)
    for place, each in enumerate(responses):
        if len(each):
            spectra[place] = np.fft.rfft(each, size, axis=0)[heard]
    total: NDArray[np.float64] = np.einsum("ifc,jfc,f->ij", spectra.conj(), spectra, weights, optimize=True).real
    return total / (2 * weights.sum())
