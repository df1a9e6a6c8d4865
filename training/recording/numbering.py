"""The numbering of a spectrum's peaks as partials of one stiff string: f_k = k f0 √(1 + B k²).

A global search over f0 and B, blind from 27 Hz to 4 kHz. Each candidate is scored by the peaks that it explains,
and pays for partials that it predicts and the spectrum lacks; so neither an octave above nor one below wins.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, signal

from engine.resonators.base import Array
from training.recording.note import Note

F0_RANGE_HZ = (26.0, 4_300.0)
STIFFNESSES = np.concatenate([[0.0], np.geomspace(5e-6, 2.5e-3, 22)])  # values of B that are tried
COARSE = (0.0, 4e-5, 3e-4)  # values of B for the first choice among all f0
MOST_TRIED = 40  # values of f0 that are tried with all STIFFNESSES
MOST_PARTIALS = 80
PRESENT_DB = 9.0  # above the local floor, for a peak that counts
FULL_DB = 40.0  # above it a peak counts no more than at it
HEARD_HZ = 1_500.0  # below it a pluck's first partials are heard
HEARD = 3  # so many of them
MISSING = 0.55  # what a predicted partial costs that is not there, of a strong one
SPECTRUM_S = 0.7  # length of a stretch whose spectrum is numbered
GLIDES_CENTS = np.arange(-60.0, 31.0, 5.0)  # down from a loud attack, or a little up


@dataclass(frozen=True)
class PartialSeries:
    """The partials of a string.

    Attributes:
        f0_hz: of the ideal string without stiffness.
        stiffness: B.
        present: numbers of partials that stand out of the floor, ascending.
        explained: share of the spectrum's peaks, weighted by their strength, that belong to it.
        missing: share of the partials up to the last present one that do not stand out.
        score: what the search maximised.
    """

    f0_hz: float
    stiffness: float
    present: tuple[int, ...]
    explained: float
    missing: float
    score: float

    def partials_hz(self, count: int) -> Array:
        """The first partials' frequencies, (count,)."""
        return partials_hz(self.f0_hz, self.stiffness, count)

    def numbers_of(self, hz: Array) -> NDArray[np.int_]:
        """The number of the partial that is nearest to each frequency."""
        return nearest(hz, self.f0_hz, self.stiffness).astype(int)


def apart_cents(first: PartialSeries, other: PartialSeries) -> float:
    """The interval between the f0 of two series in cents, 0 or more."""
    return abs(1200 * math.log2(other.f0_hz / first.f0_hz))


def partial_hz(k: Any, f0_hz: float | Array, stiffness: float | Array) -> Any:
    """The frequency of a stiff string's partial of number k, or of each of an array."""
    return k * f0_hz * np.sqrt(1 + stiffness * k**2)


def partials_hz(f0_hz: float, stiffness: float, count: int) -> Array:
    return partial_hz(np.arange(1.0, count + 1), f0_hz, stiffness)


@dataclass(frozen=True)
class Peaks:
    """Peaks of a spectrum, in order of frequency.

    Attributes:
        hz, above_db, level_db: frequency, and level above the local floor and by itself, (peaks,) each.
        width_hz: resolution of the spectrum.
        highest_hz: up to which it was searched.
    """

    hz: Array
    above_db: Array
    level_db: Array
    width_hz: float
    highest_hz: float
    hidden_hz: Array = field(default_factory=lambda: np.zeros(0))  # where a peak would not be seen

    @cached_property
    def strength(self) -> Array:
        """The strength of each peak, from 0 for one that barely stands out to 1."""
        return np.clip((self.above_db - PRESENT_DB / 2) / (FULL_DB - PRESENT_DB / 2), 0.0, 1.0)

    @cached_property
    def weight(self) -> Array:
        """The weight of each peak, (peaks,): its strength, less for a soft one."""
        loudness = np.clip((self.level_db - self.level_db.max() + 60) / 60, 0.0, 1.0)
        return np.asarray(self.strength * (0.3 + 0.7 * loudness), np.float64)

    @property
    def power(self) -> Array:
        """The power of each peak, (peaks,), in the spectrum's own unit."""
        return np.asarray(10 ** (self.level_db / 10), np.float64)

    def near(self, series: PartialSeries) -> NDArray[np.bool_]:
        """The peaks that a series explains, as a mask."""
        distance = distances(self.hz, series.f0_hz, series.stiffness)
        return np.abs(distance) <= tolerance(self.hz, series.f0_hz, self.width_hz)

    def without(self, series: PartialSeries, least_above_db: float = 0.0, least_level_db: float = -np.inf) -> Peaks:
        """The peaks that a series does not explain, of those so clear and so loud."""
        kept = ~self.near(series) & (self.above_db >= least_above_db) & (self.level_db >= least_level_db)
        return replace(self._of(kept), hidden_hz=series.partials_hz(MOST_PARTIALS))

    def loudest(self, least_db: float) -> Peaks:
        """The peaks that are louder than this below the loudest."""
        return self._of(self.level_db >= self.level_db.max(initial=-np.inf) + least_db)

    def _of(self, kept: NDArray[np.bool_]) -> Peaks:
        return replace(self, hz=self.hz[kept], above_db=self.above_db[kept], level_db=self.level_db[kept])


def distances(hz: Array, f0_hz: float, stiffness: float) -> Array:
    """The distances from each frequency to the nearest partial, in Hz."""
    return hz - partial_hz(nearest(hz, f0_hz, stiffness), f0_hz, stiffness)


def nearest(hz: Array, f0_hz: float | Array, stiffness: float | Array) -> Array:
    """The number, as a float, of the partial that is nearest to each frequency."""
    square, stiff = (hz / f0_hz) ** 2, np.maximum(stiffness, 1e-12)
    square = np.where(stiffness >= stiff, (np.sqrt(1 + 4 * stiff * square) - 1) / (2 * stiff), square)
    return np.maximum(1, np.round(np.sqrt(square)))


def tolerance(hz: Array, f0_hz: float | Array, width_hz: float) -> Array:
    """The farthest that a peak may lie from its partial: the resolution, and a share of the frequency.

    It stays below the spacing.
    """
    return np.minimum(np.maximum(1.2 * width_hz, 0.006 * hz), 0.2 * f0_hz)


def peaks_of(samples: Array, rate_hz: int, noise_power: float = 0.0) -> Peaks:
    """The peaks of a whole stretch of sound (frames,) through a Hann window; `noise_power`: of a sample."""
    window = np.hanning(len(samples) + 2)[1:-1]
    size = 1 << (2 * len(samples) - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(samples * window, size)) ** 2
    step = rate_hz / size
    floor_power = noise_power * float(np.sum(window**2)) + 1e-13 * spectrum.max()
    level = 10 * np.log10(spectrum + floor_power)
    width_hz = 2 * rate_hz / len(samples)
    highest_hz = min(0.45 * rate_hz, 10_000.0)
    level = level[: int(highest_hz / step)]
    # the floor: a low quantile over a stretch of at least 150 Hz, of a thinned spectrum
    thin = max(1, round(width_hz / 4 / step))
    thinned = level[: len(level) // thin * thin].reshape(-1, thin).max(1)
    span = max(9, round(160.0 / (thin * step)))
    floor = ndimage.percentile_filter(thinned, 35, size=span, mode="nearest")
    floor = np.interp(
        np.arange(len(level)), (np.arange(len(thinned)) + 0.5) * thin, ndimage.uniform_filter1d(floor, span)
    )
    bins, _ = signal.find_peaks(level, distance=max(1, round(width_hz / 2 / step)))
    bins = bins[(bins > 1) & (bins < len(level) - 2) & (bins * step > 20.0)]
    above = level[bins] - floor[bins]
    bins = bins[(above > PRESENT_DB) & (level[bins] > level.max() - 75)]
    before = level[bins - 1]
    at = level[bins]
    after = level[bins + 1]
    shift = 0.5 * (before - after) / np.minimum(before - 2 * at + after, -1e-9)
    return Peaks((bins + shift) * step, at - floor[bins], at, width_hz, highest_hz)


def number(peaks: Peaks, f0_range_hz: tuple[float, float] = F0_RANGE_HZ) -> PartialSeries | None:
    """The series that explains most; None where there are no peaks."""
    if len(peaks.hz) == 0:
        return None
    candidates = _candidates(peaks, f0_range_hz)
    if len(candidates) == 0:
        return None
    scores = scores_of(peaks, np.repeat(candidates, len(COARSE)), np.tile(COARSE, len(candidates))).score
    chosen = candidates[np.lexsort((candidates, scores.reshape(-1, len(COARSE)).max(1)))[::-1][:MOST_TRIED]]
    best = best_series(peaks, np.repeat(chosen, len(STIFFNESSES)), np.tile(STIFFNESSES, len(chosen)))
    return _best_refined(peaks, best)


def followed(peaks: Peaks, series: PartialSeries) -> PartialSeries:
    """The same string's series in other peaks of its note, where it may have glided."""
    tried_hz = series.f0_hz * 2 ** (GLIDES_CENTS / 1200)
    return _best_refined(peaks, best_series(peaks, tried_hz, np.full(len(tried_hz), series.stiffness)))


def _best_refined(peaks: Peaks, series: PartialSeries) -> PartialSeries:
    """The series after three refinements of f0 and B, each kept where it scores more."""
    for _ in range(3):
        series = max((_refined(peaks, series), series), key=lambda candidate: candidate.score)
    return series


def _candidates(peaks: Peaks, f0_range_hz: tuple[float, float]) -> Array:
    """Values of f0 that are worth a try, in Hz, ascending, (any,).

    They are whole fractions of strong or loud peaks, and distances between strong peaks.
    """
    order = np.argsort(-peaks.strength * (1 + 0.02 * peaks.level_db))[:12]
    loud = np.argsort(-peaks.level_db)[:12]
    chosen = np.unique(np.concatenate([order, loud]))
    by_peak = (peaks.hz[chosen][:, None] / np.arange(1, 25)).ravel()
    strong = np.sort(peaks.hz[np.argsort(-peaks.strength)[:25]])
    apart = (strong[:, None] - strong[None]).ravel()
    every = np.concatenate([by_peak, apart])
    low, high = f0_range_hz
    every = np.sort(every[(every >= low) & (every <= high)])
    kept: list[float] = []
    for candidate_hz in every:
        if not kept or candidate_hz > kept[-1] * 1.002:
            kept.append(candidate_hz)
    return np.array(kept)


class Scores(NamedTuple):
    """The scores of series that are tried, (series,) each; see `PartialSeries`.

    Attributes:
        present: (series, MOST_PARTIALS + 1) by number of partial.
    """

    present: NDArray[np.bool_]
    explained: Array
    missing: Array
    score: Array


def scores_of(peaks: Peaks, f0_hz: Array, stiffness: Array) -> Scores:
    """The scores of series of given f0 and B, (series,) each."""
    f0, b, hz = f0_hz[:, None], stiffness[:, None], peaks.hz[None]
    k_of = nearest(hz, f0, b).astype(int)
    off = np.abs(hz - partial_hz(k_of, f0, b)) / tolerance(hz, f0, peaks.width_hz)
    near = np.minimum(np.maximum(1.5 * (1 - off), 0.0), 1.0)
    which, peak = np.nonzero((near > 0) & (k_of <= MOST_PARTIALS))
    best = np.zeros((len(f0_hz), MOST_PARTIALS + 1))  # by number of partial: weight of the peak that is its
    np.maximum.at(best, (which, k_of[which, peak]), near[which, peak] * peaks.weight[peak])
    present, total = best > 0.02, best.sum(1)
    # predicted ones that are not there, up to where most of the series' strength lies: one peak is no series
    last = (np.cumsum(best, 1) < 0.93 * total[:, None]).sum(1)
    count = np.maximum(np.maximum(last, np.minimum(HEARD, HEARD_HZ // f0_hz)), 1)
    counted = np.arange(MOST_PARTIALS + 1) <= count[:, None]
    explained = np.where(counted, best, 0.0).sum(1) / max(peaks.weight.sum(), 1e-12)
    absent = counted[:, 1:] & ~present[:, 1:]
    if len(peaks.hidden_hz):
        # near a partial of the other series nothing would be seen
        expected = partial_hz(np.arange(1.0, MOST_PARTIALS + 1), f0, b)
        above = np.searchsorted(peaks.hidden_hz, expected).clip(1, len(peaks.hidden_hz) - 1)
        apart = np.minimum(*(np.abs(expected - peaks.hidden_hz[above - side]) for side in (0, 1)))
        absent &= apart > 1.5 * tolerance(expected, f0, peaks.width_hz)
    missing = absent.sum(1) / count
    first = 0.12 * absent[:, 0]  # what a missing first partial costs
    score = explained - MISSING * missing - first - 0.04 * (present.sum(1) < 3)
    return Scores(present, explained, missing, np.where(present.any(1), score, -1.0))


def best_series(peaks: Peaks, f0_hz: Array, stiffness: Array) -> PartialSeries:
    """The series that scores most, of given f0 and B, (series,) each; the first of equal ones."""
    scores = scores_of(peaks, f0_hz, stiffness)
    best = int(scores.score.argmax())
    present = tuple(np.flatnonzero(scores.present[best]).tolist())
    explained, missing, score = (float(of_series[best]) for of_series in scores[1:])
    return PartialSeries(float(f0_hz[best]), float(stiffness[best]), present, explained, missing, score)


def _refined(peaks: Peaks, series: PartialSeries) -> PartialSeries:
    """f0 and B by least squares on the peaks that it has, weighted by strength, outliers left out."""
    k = nearest(peaks.hz, series.f0_hz, series.stiffness)
    off = np.abs(distances(peaks.hz, series.f0_hz, series.stiffness))
    used = (off < tolerance(peaks.hz, series.f0_hz, peaks.width_hz)) & (k <= MOST_PARTIALS)
    if len(np.unique(k[used])) < 3:
        return series
    (square, slope), *_ = fit_law(k[used], peaks.hz[used], peaks.strength[used] + 0.05, 3)
    if square <= 0:
        return series
    return best_series(peaks, np.sqrt([square]), np.maximum([slope / square], 0.0))


def fit_law(k: Array, hz: Array, weight: Array, rounds: int) -> tuple[Array, Array, Array]:
    """Fit (f/k)² = f0² + f0² B k² by least squares; outliers lose weight from round to round.

    Args:
        k, hz, weight: number, frequency and weight of each peak, (peaks,).

    Returns:
        f0² and f0² B, (2,); the rows of the equations, (peaks, 2); and their weights after the last round.
    """
    rows = np.stack([np.ones_like(k), k**2], 1)
    scale = weight * k / hz  # errors in Hz are alike
    for _ in range(rounds):
        law, *_ = np.linalg.lstsq(rows * scale[:, None], (hz / k) ** 2 * scale, rcond=None)
        if law[0] <= 0:
            break
        off = np.abs((hz / k) ** 2 - rows @ law) * k / hz
        scale = weight * k / hz / np.maximum(1.0, off / (2 * np.median(off) + 1e-9))
    return np.asarray(law, np.float64), rows, scale


def number_note(note: Note, f0_range_hz: tuple[float, float] = F0_RANGE_HZ) -> PartialSeries | None:
    """The series of a note, from spectra of two lengths; the shorter serves notes that end soon or glide."""
    best: PartialSeries | None = None
    for begin, length in ((0.06, SPECTRUM_S), (0.03, 0.25)):  # s after the onset
        length = min(length, 0.9 * (note.seconds - begin))
        if length < 0.05:
            continue
        part = note.part(begin, begin + length)
        series = number(peaks_of(part, note.rate_hz, note.noise_power), f0_range_hz)
        if series is not None and (best is None or series.score > best.score + 0.1):
            best = series
    return best
