"""The errors of a learned note against its recording, in numbers that anybody can compute again.

All are of the note as `render NAME out.wav --as-recorded` gives it, without any remainder of the attack.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from scipy import fft, signal

from engine.compare.relative import error_to_signal
from engine.compare.spectra import log_spectral_distance, spectral_distances
from engine.resonators.base import Array
from training.recording.fit import LearnedNote
from training.recording.note import FIT_BEGINS_S, FIT_LASTS_S, Note
from training.recording.numbering import partial_hz
from training.recording.physics import LearnedPhysics

LATE_S = 0.05  # after the onset: the second ESR begins here
MOST_DELAY_S = 0.002
STFT_SIZES = (512, 1024, 2048, 4096)
BANDS_HZ = (31.5, 63.0, 125.0, 250.0, 500.0, 1_000.0, 2_000.0, 4_000.0, 8_000.0)


@dataclass(frozen=True)
class FitErrors:
    """The errors of one sound against another.

    Attributes:
        esr: error-to-signal ratio from 8 ms after the onset, after one gain and one delay.
        esr_from_50_ms: the same from 50 ms after the onset.
        stft: multi-resolution STFT: spectral convergence plus mean absolute log magnitude.
        noise_esr: energy of the recording's noise over that of the recording.
        gain_db, delay_s: that were applied to the second sound.
    """

    esr: float
    esr_from_50_ms: float
    log_spectral_distance_db: float
    stft: float
    noise_esr: float
    gain_db: float
    delay_s: float


@dataclass(frozen=True)
class Band:
    """The decay of an octave: T60 of the recording and of the learned note; nan where it does not decay."""

    hz: float
    recorded_t60_s: float
    learned_t60_s: float


@dataclass(frozen=True)
class PartialReport:
    """A partial at rest, with 95 % intervals.

    Attributes:
        cents_from_law: of f0 and B.
        level_db: of its energy, below the loudest partial's.
        t60_s: of the one exponential with the same centre of energy.
        poles: that it is made of.
    """

    number: int
    hz: float
    cents_from_law: float
    hz_interval: tuple[float, float]
    level_db: float
    level_interval_db: tuple[float, float]
    t60_s: float
    t60_interval_s: tuple[float, float]
    poles: int


@dataclass(frozen=True)
class FitReport:
    """The report on one learned note."""

    errors: FitErrors
    bands: tuple[Band, ...]
    partials: tuple[PartialReport, ...]


def report_of(note: Note, learned: LearnedNote, physics: LearnedPhysics) -> FitReport:
    """Compare a note with its recording."""
    truth = note.fitted()
    model = learned.render(np.arange(len(truth)) / note.rate_hz)
    sounds = truth, model, note.rate_hz, note.noise_power
    return FitReport(errors_of(*sounds), bands_of(*sounds), partials_in(learned, physics))


def partials_in(learned: LearnedNote, physics: LearnedPhysics) -> tuple[PartialReport, ...]:
    """The partials of a note that have an interval."""
    spreads = learned.spreads
    levels = {number: sum(spread.level_db) / 2 for number, spread in spreads.items()}
    loudest = max(levels.values(), default=0.0)
    rows = []
    for number in sorted(spreads):
        spread = spreads[number]
        law = partial_hz(number, physics.f0_hz, physics.stiffness)
        hz = sum(spread.hz) / 2
        low, high = spread.level_db
        slow, fast = spread.decay
        rows.append(
            PartialReport(
                number,
                hz,
                cents_from_law=1200 * math.log2(hz / law),
                hz_interval=spread.hz,
                level_db=levels[number] - loudest,
                level_interval_db=(low - loudest, high - loudest),
                t60_s=math.log(1000) / math.sqrt(slow * fast),
                t60_interval_s=(math.log(1000) / fast, math.log(1000) / slow),
                poles=sum(pole.partial == number for pole in learned.poles),
            )
        )
    return tuple(rows)


def errors_of(truth: Array, model: Array, rate_hz: int, noise_power: float = 0.0) -> FitErrors:
    """The errors between sounds of one length that begin 8 ms after the onset."""
    moved, gain, delay = aligned(truth, model, rate_hz)
    late = round((LATE_S - FIT_BEGINS_S) * rate_hz)
    convergence, log_db = spectral_distances(moved[None], truth[None], STFT_SIZES)
    return FitErrors(
        error_to_signal(moved, truth),
        error_to_signal(moved[late:], truth[late:]),
        log_spectral_distance(truth, moved, noise_power),
        float(convergence[0] + math.log(10) / 20 * log_db[0]),
        noise_power * len(truth) / max(float(truth @ truth), 1e-30),
        20 * math.log10(max(abs(gain), 1e-9)),
        delay,
    )


def aligned(truth: Array, model: Array, rate_hz: float) -> tuple[Array, float, float]:
    """The sound `model` with the gain and the delay, up to 2 ms either way, that bring it nearest to `truth`.

    Returns:
        that sound (frames,), the gain as a factor, and the delay in s.
    """
    size = fft.next_fast_len(2 * len(truth), real=True)
    theirs, ours = fft.rfft(truth, size), fft.rfft(model, size)
    cross = fft.irfft(theirs * ours.conj(), size)
    most = round(MOST_DELAY_S * rate_hz)
    lags = np.arange(-most, most + 1)
    place = int(np.argmax(cross[lags]))
    shift = 0.0
    if 0 < place < len(lags) - 1:
        before, at, after = cross[lags[place - 1 : place + 2]]
        shift = 0.5 * (before - after) / min(before - 2 * at + after, -1e-30)
    delay = float(lags[place] + shift)
    turn = np.exp(-2j * math.pi * np.arange(len(ours)) * delay / size)
    moved = fft.irfft(ours * turn, size)[: len(truth)] if abs(delay) > 1e-3 else model
    gain = float(truth @ moved / max(float(moved @ moved), 1e-30))
    return gain * moved, gain, delay / rate_hz


def bands_of(truth: Array, model: Array, rate_hz: int, noise_power: float) -> tuple[Band, ...]:
    """T60 of each octave that the recording decays in by 10 dB or more."""
    bands = []
    for hz in BANDS_HZ:
        if hz * math.sqrt(2) > 0.45 * rate_hz:
            continue
        sections = signal.butter(3, (hz / math.sqrt(2), hz * math.sqrt(2)), "bandpass", fs=rate_hz, output="sos")
        share = 2 * hz / math.sqrt(2) / rate_hz
        theirs = _t60(signal.sosfilt(sections, truth), rate_hz, noise_power * share)
        if math.isfinite(theirs):
            bands.append(Band(hz, theirs, _t60(signal.sosfilt(sections, model), rate_hz, noise_power * share)))
    return tuple(bands)


def _t60(sound: Array, rate_hz: int, noise_power: float) -> float:
    """The T60 in s by the slope of the backward integral (Schroeder 1965) from -2 to -22 dB, or to -12 dB.

    It is nan where noise covers that, or the sound does not decay.

    Args:
        sound: of one octave, (frames,); `noise_power`: of a sample of it.
    """
    power = np.maximum(sound**2 - noise_power, -noise_power)
    left = np.cumsum(power[::-1])[::-1]
    if left[0] <= 0 or left[0] < 30 * noise_power * rate_hz * 0.05:
        return math.nan
    db = 10 * np.log10(np.maximum(left, 1e-30) / left[0])
    first = int(np.argmax(db < -2.0))
    for depth in (22.0, 12.0):
        last = int(np.argmax(db < -depth))
        if last > first + rate_hz // 50 and last < 0.95 * len(db):
            t = np.arange(first, last) / rate_hz
            slope = float(np.polyfit(t, db[first:last], 1)[0])
            return -60 / slope if slope < 0 else math.nan
    return math.nan


def figures(report: FitReport) -> dict[str, float]:
    """The report's main numbers, by name."""
    return {**asdict(report.errors), "fit_s": FIT_LASTS_S}
