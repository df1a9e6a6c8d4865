"""From a note and its series to poles, amplitudes and glide."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from training.recording.glide import Glide, glide_of_phases
from training.recording.intervals import Spread, spreads
from training.recording.note import FIT_LASTS_S, Note
from training.recording.numbering import Series
from training.recording.refine import Fit, Pole

Array = NDArray[np.float64]

MOST_PARTIALS = 80
HIGHEST_HZ = 10_000.0
FREE_POLES = 10
FREE_RANGE_HZ = (25.0, 1_500.0)
SWEEPS = 6
LAST_SWEEPS = 6
WORTH = 3.0  # times the bits that BIC asks of a second pole
Progress = Callable[[float], None]


@dataclass(frozen=True)
class LearnedNote:
    """Poles with amplitudes at the beginning of the fit, and the glide."""

    rate_hz: int
    f0_hz: float
    stiffness: float
    glide: Glide
    poles: tuple[Pole, ...]
    spreads: dict[int, Spread] = field(default_factory=dict)

    def render(self, t: Array) -> Array:
        """The sound at times in s after the beginning of the fit."""
        tau = self.glide.tau(t)
        total = np.zeros(len(t))
        for pole in self.poles:
            total += (pole.a * np.exp(pole.s * (tau if pole.partial else t))).real
        return total


def fit_note(
    note: Note,
    series: Series,
    *,
    seconds: float = FIT_LASTS_S,
    poles_a_partial: int = 2,
    free: int = FREE_POLES,
    glides: bool = True,
    progress: Progress = lambda share: None,
) -> LearnedNote:
    """The note's poles.

    Args:
        poles_a_partial: at most.
        free: how many poles do not glide.
        glides: False: a linear string, as a baseline.
        progress: is called with the share that is done; may raise, to cancel.
    """
    samples, rate = note.fitted(seconds), note.rate_hz
    count = _partials(note, series)
    hz = series.partials_hz(count)
    edges = _edges(hz)
    fit = Fit(samples, rate, edges, hz, _first_glide(samples, rate, hz, edges) if glides else Glide.none())
    fit.poles = [fit.start(number, 1) or [_plain(hz[number], number + 1)] for number in range(count)]
    progress(0.1)
    for round_ in range(4):
        fit.sweep(2)
        if glides:
            fit.set_glide(fit.step_glide())
        progress(0.1 + 0.05 * (round_ + 1))
    if poles_a_partial > 1:
        residual = fit.data - fit.model()
        for number in range(count):
            _add_pole(fit, number, residual)
    for round_ in range(SWEEPS):
        fit.sweep(2)
        fit.sweep_free(2)
        if glides:
            fit.set_glide(fit.step_glide())
        progress(0.3 + 0.3 * (round_ + 1) / SWEEPS)
    for number in range(free):
        _add_free(fit)
        fit.sweep_free(3)
        fit.sweep(1)
        if glides and number % 2:
            fit.set_glide(fit.step_glide())
        progress(0.6 + 0.3 * (number + 1) / free)
    for round_ in range(LAST_SWEEPS):
        fit.sweep(2)
        fit.sweep_free(2)
        if glides and round_ < LAST_SWEEPS - 1:
            fit.set_glide(fit.step_glide())
        progress(0.9 + 0.1 * (round_ + 1) / LAST_SWEEPS)
    fit.sweep(1)
    return LearnedNote(rate, series.f0_hz, series.stiffness, fit.glide, tuple(fit.every()), spreads(fit))


def _plain(hz: float, number: int) -> Pole:
    return Pole(complex(-3.0, 2 * math.pi * hz), partial=number)


def _partials(note: Note, series: Series) -> int:
    last = max(series.present, default=1) + 2
    hz = series.partials_hz(MOST_PARTIALS)
    inside = int((hz < min(HIGHEST_HZ, 0.42 * note.rate_hz)).sum())
    return max(1, min(last, inside, MOST_PARTIALS))


def _edges(hz: Array) -> Array:
    middle = 0.5 * (hz[1:] + hz[:-1])
    top = hz[-1] + 0.5 * (hz[-1] - hz[-2] if len(hz) > 1 else hz[0])
    return np.concatenate([[0.5 * hz[0]], middle, [top]])


def _first_glide(samples: Array, rate: int, hz: Array, edges: Array) -> Glide:
    size = fft.next_fast_len(len(samples), real=True)
    spectrum, step = fft.rfft(samples, size), rate / size
    bands = []
    for number in range(len(hz)):
        first, last = round(edges[number] / step), round(edges[number + 1] / step)
        z = fft.ifft(spectrum[first:last])
        spacing = size / ((last - first) * rate)
        middle = np.exp(-2j * math.pi * (hz[number] - first * step) * spacing * np.arange(len(z)))
        usable = int(len(z) * len(samples) / size) - 2
        bands.append((float(hz[number]), spacing, (z * middle)[2:usable]))
    loud = sorted(bands, key=lambda band: -float(np.sum(np.abs(band[2]) ** 2)) * band[0])[:12]
    return glide_of_phases(loud)


def _add_pole(fit: Fit, number: int, residual: NDArray[np.complex128]) -> None:
    """A second pole of a band, from the subspace or else close to the first, where it leaves much less."""
    where = fit.bands[number]
    target = residual[where] + fit.part(fit.poles[number], where)
    one, left, _ = fit.improved(fit.poles[number], target, where, 1e-2, number)
    first = one[0]
    beside = Pole(complex(2.5 * first.s.real, first.s.imag + 2.0), partial=first.partial)
    tried = [[first, beside]]
    found = fit.start(number, 2)
    if len(found) == 2:
        tried.append(found)
    best = None
    for two in tried:
        damping = 1e-2
        for _ in range(5):
            two, after, damping = fit.improved(two, target, where, damping, number)
        if best is None or after < best[0]:
            best = after, two
    assert best is not None
    bins = 2 * (where.stop - where.start)
    if bins * math.log(left / max(best[0], 1e-300)) > WORTH * 4 * math.log(bins):
        fit.poles[number] = best[1]
        fit.damping[number] = 1e-2


def _add_free(fit: Fit) -> None:
    """One more pole that does not glide, where it takes most from what is left."""
    residual = fit.data - fit.model()
    lowest, highest = (min(len(residual), round(hz / fit.step_hz)) for hz in FREE_RANGE_HZ)
    tried = []
    for width_hz in (2.0, 10.0, 40.0):
        width = max(3, round(width_hz / fit.step_hz))
        power = np.convolve(np.abs(residual) ** 2, np.ones(width), "same")
        place = lowest + int(np.argmax(power[lowest:highest]))
        where = slice(max(1, place - 12 * width), min(len(residual), place + 12 * width))
        whole = float(np.vdot(residual[where], residual[where]).real)
        for decay in (0.5 * width_hz, 1.5 * width_hz, 4 * width_hz):
            start = [Pole(complex(-decay, fit.omega[place]))]
            left, start, _ = fit.solve(start, residual[where], where)
            start, left, _ = fit.improved(start, residual[where], where, 1e-2, None)
            tried.append((left - whole, start[0]))
    fit.free.append(min(tried, key=lambda each: each[0])[1])
    fit.free_damping = 1e-2
