"""The fit of poles, amplitudes and glide to a note and its series."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy import fft

from engine.resonators.base import Array
from training.recording.checkpoint import restore, save
from training.recording.glide import Glide, glide_of_phases
from training.recording.intervals import Spread, spreads
from training.recording.note import FIT_LASTS_S, Note
from training.recording.numbering import PartialSeries
from training.recording.refine import FREE, Complex, Fit, Pole
from training.recording.slow import settle_slow
from training.recording.sweeps import FIRST_DAMPING, Takes

MOST_PARTIALS = 80
HIGHEST_HZ = 10_000.0  # of a partial
FREE_POLES = 10  # that do not glide
FREE_RANGE_HZ = (25.0, 1_500.0)
FIRST_SWEEPS = 4  # with one pole a partial
SWEEPS = 6  # with the second poles
LAST_SWEEPS = 6  # with the free poles
WORTH = 3.0  # times the gain that BIC (Bayesian information criterion) asks of a second pole
Progress = Callable[[float], None]  # receives the share that is done, 0 … 1


@dataclass(frozen=True)
class LearnedNote:
    """Poles with amplitudes at the beginning of the fit, 8 ms after the onset, and the glide.

    Attributes:
        f0_hz, stiffness: of the series before the fit; stiffness is B.
        spreads: intervals by number of partial.
    """

    rate_hz: int
    f0_hz: float
    stiffness: float
    glide: Glide
    poles: tuple[Pole, ...]
    spreads: dict[int, Spread] = field(default_factory=dict)

    def render(self, t: Array) -> Array:
        """The sound (times,) at times in s after the beginning of the fit."""
        tau = self.glide.tau(t)
        total = np.zeros(len(t))
        for pole in self.poles:
            total += (pole.a * np.exp(pole.s * (tau if pole.partial else t))).real
        return total


def fit_note(note: Note, series: PartialSeries, **options: Any) -> LearnedNote:
    """The poles of one note; see `fit_takes`, also for the options."""
    return fit_takes([(note, series)], **options)[0]


def fit_takes(
    notes: Sequence[tuple[Note, PartialSeries]],
    *,
    seconds: float = FIT_LASTS_S,
    poles_a_partial: int = 2,
    free: int = FREE_POLES,
    glides: bool = True,
    progress: Progress = lambda share: None,
    checkpoint: Path | None = None,
) -> list[LearnedNote]:
    """The poles of several takes of one pitch, soft and loud ones: they share frequencies at rest and decays.

    Amplitudes and glide are each take's own, and a pitch within some cents of the first.

    Args:
        seconds: that are fitted, from 8 ms after the onset.
        poles_a_partial: at most.
        free: how many poles do not glide.
        glides: False: a linear string, as a baseline.
        progress: is called with the share that is done; may raise, to cancel.
        checkpoint: the file that the fit writes after each step and continues from; None: there is none.

    Raises:
        SchemaError, OSError: the checkpoint cannot be read.
        WriteError: it cannot be written.
    """
    count = max(_partials(note, series) for note, series in notes)
    hz = notes[0][1].partials_hz(count)
    edges = _edges(hz)
    takes = Takes([_fit_of(note, series, notes[0][1], hz, edges, seconds, glides) for note, series in notes])
    steps = _steps(takes, hz, poles_a_partial, free, glides)
    done = 0 if checkpoint is None else restore(checkpoint, takes, len(steps))
    for number, (share, step) in enumerate(steps[done:], done + 1):
        step()
        if checkpoint is not None:
            save(checkpoint, takes, number)
        progress(share)
    intervals = [spreads(fit) for fit in takes.fits]
    if glides:
        settle_slow(takes)
    return [
        _learned(note, series, fit, of_take)
        for (note, series), fit, of_take in zip(notes, takes.fits, intervals, strict=True)
    ]


def _steps(
    takes: Takes, hz: Array, poles_a_partial: int, free: int, glides: bool
) -> list[tuple[float, Callable[[], None]]]:
    """The steps of a fit in order, each with the share that is done after it."""

    def start() -> None:
        """Begin each band with one pole: that of the loudest take there, else a plain one at its frequency."""
        for number in range(len(hz)):
            plain = Pole(complex(-3.0, 2 * math.pi * hz[number]), partial=number + 1)
            first = _loudest(takes, number).start(number, 1) or [plain]
            takes.set_poles(number, [first for _ in takes.fits])

    def second_poles() -> None:
        residuals = takes.residuals()
        for number in range(len(hz)):
            _add_pole(takes, number, residuals)

    def sweep(with_glide: bool = glides) -> None:
        takes.sweep(2)
        takes.sweep_free(2)
        if with_glide:
            takes.step_glides()

    def add_free(with_glide: bool) -> None:
        _add_free(takes)
        takes.sweep_free(3)
        takes.sweep(1)
        if with_glide:
            takes.step_glides()

    steps: list[tuple[float, Callable[[], None]]] = [(0.1, start)]
    steps += [(0.1 + 0.2 * (turn + 1) / FIRST_SWEEPS, sweep) for turn in range(FIRST_SWEEPS)]
    if poles_a_partial > 1:
        steps.append((0.3, second_poles))
    steps += [(0.3 + 0.3 * (turn + 1) / SWEEPS, sweep) for turn in range(SWEEPS)]
    steps += [(0.6 + 0.3 * (turn + 1) / free, partial(add_free, glides and turn % 2 == 1)) for turn in range(free)]
    steps += [(0.9 + 0.1 * (turn + 1) / LAST_SWEEPS, sweep) for turn in range(LAST_SWEEPS - 1)]
    return [*steps, (1.0, partial(sweep, False)), (1.0, takes.sweep)]


def _fit_of(
    note: Note, series: PartialSeries, first: PartialSeries, hz: Array, edges: Array, seconds: float, glides: bool
) -> Fit:
    """The fit of one take before its first step, without poles.

    Args:
        series: of the take; `first`: of the first take, whose pitch the poles have.
        hz, edges: of the partials (partials,) and of their bands (partials + 1,).
    """
    samples, rate = note.fitted(seconds), note.rate_hz
    tuned = series is not first
    pitch = series.f0_hz / first.f0_hz - 1 if tuned else 0.0
    glide = Glide.none()
    if glides:
        glide = replace(_first_glide(samples, rate, hz * (1 + pitch), edges * (1 + pitch)), pitch=pitch)
    return Fit(samples, rate, edges, hz, glide, tuned=tuned)


def _learned(note: Note, series: PartialSeries, fit: Fit, intervals: dict[int, Spread]) -> LearnedNote:
    """The learned note, with its own pitch in its poles."""
    higher = 1 + fit.glide.pitch
    poles = (replace(pole, s=pole.s * higher) if pole.partial else pole for pole in fit.every())
    glide = Glide(fit.glide.shares / higher)
    return LearnedNote(note.rate_hz, series.f0_hz, series.stiffness, glide, tuple(poles), intervals)


def _loudest(takes: Takes, number: int) -> Fit:
    """The take with most of its energy in a band."""
    return max(
        takes.fits,
        key=lambda fit: float(np.vdot(fit.data[fit.bands[number]], fit.data[fit.bands[number]]).real) / fit.energy,
    )


def _partials(note: Note, series: PartialSeries) -> int:
    """The number of partials that are fitted: two more than were seen, as far as the rate has room for them."""
    last = max(series.present, default=1) + 2
    hz = series.partials_hz(MOST_PARTIALS)
    inside = int((hz < min(HIGHEST_HZ, 0.42 * note.rate_hz)).sum())
    return max(1, min(last, inside, MOST_PARTIALS))


def _edges(hz: Array) -> Array:
    """The edges in Hz (partials + 1,) of bands around partials (partials,): halfway between neighbours."""
    middle = 0.5 * (hz[1:] + hz[:-1])
    top = hz[-1] + 0.5 * (hz[-1] - hz[-2] if len(hz) > 1 else hz[0])
    return np.concatenate([[0.5 * hz[0]], middle, [top]])


def _first_glide(samples: Array, rate: int, hz: Array, edges: Array) -> Glide:
    """The glide to start from, by the phases of the twelve partials that show it best; bands as in `_fit_of`."""
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


def _add_pole(takes: Takes, number: int, residuals: Sequence[Complex]) -> None:
    """A second pole of a band, from the subspace or else close to the first, where it leaves much less."""
    before, wheres = takes.poles(number), takes.bins(number)
    targets = takes.targets(before, residuals, wheres)
    one, left, _ = takes.improved(before, targets, wheres, FIRST_DAMPING)
    first = one[0][0]
    beside = Pole(complex(2.5 * first.s.real, first.s.imag + 2.0), partial=first.partial)
    tried = [[first, beside]]
    start_poles = _loudest(takes, number).start(number, 2)
    if len(start_poles) == 2:
        tried.append(start_poles)
    best, chosen = math.inf, before
    for poles in tried:
        two = [list(poles) for _ in takes.fits]
        after = left
        damping = FIRST_DAMPING
        for _ in range(5):
            two, after, damping = takes.improved(two, targets, wheres, damping)
        if after < best:
            best, chosen = after, two
    bins = sum(2 * (where.stop - where.start) for where in wheres)  # real numbers that are fitted
    more = 2 + 2 * len(takes.fits)  # unknowns of a second pole
    if bins * math.log(left / max(best, 1e-300)) > WORTH * more * math.log(bins):
        takes.set_poles(number, chosen)
        takes.damping[number] = FIRST_DAMPING


def _add_free(takes: Takes) -> None:
    """Add a pole that does not glide, where it takes most from one take's residual."""
    tried = []
    for fit, weight in zip(takes.fits, takes.weights, strict=True):
        residual = fit.data - fit.model()
        alone = Takes([fit])
        lowest, highest = (min(len(residual), round(hz / fit.step_hz)) for hz in FREE_RANGE_HZ)
        for width_hz in (2.0, 10.0, 40.0):
            width = max(3, round(width_hz / fit.step_hz))
            power = np.convolve(np.abs(residual) ** 2, np.ones(width), "same")
            place = lowest + int(np.argmax(power[lowest:highest]))
            where = slice(max(1, place - 12 * width), min(len(residual), place + 12 * width))
            whole = float(np.vdot(residual[where], residual[where]).real)
            for decay in (0.5 * width_hz, 1.5 * width_hz, 4 * width_hz):
                start = [Pole(complex(-decay, fit.omega[place]))]
                left, start, _ = fit.solve(start, residual[where], where)
                moved, left, _ = alone.improved([start], [residual[where]], [where], FIRST_DAMPING)
                tried.append((weight * (left - whole), moved[0][0]))
    pole = min(tried, key=lambda trial: trial[0])[1]
    takes.set_poles(FREE, [[*free, pole] for free in takes.poles(FREE)])
    takes.free_damping = FIRST_DAMPING
