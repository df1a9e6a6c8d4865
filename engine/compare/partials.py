"""The partials of a predicted motion against the true ones: level, phase, frequency and decay of each mode.

The truth can be sampled as densely as one likes: each of its modes is known at every frame as a phasor z, whose real
part is the displacement (`phasors`). The prediction is displacement at its own frames alone. In each short segment of
them it is fitted, in least squares, by Re(c z): the complex gain c is the prediction's level and phase relative to
the truth. A fit sees its segment alone, so no window of analysis has edges; how the truth changes within it, and its
side bands, are in z.

This holds above half the sample rate too: the frames show an alias, but c belongs to the true phasor. Only so near
half the rate that a segment does not show both quadratures of a mode is it not resolved, and counts as absent: within
60 Hz or so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.resonators.base import Resonator
from engine.truth import ModalState, SplittingSolver

OVERSAMPLING = 4  # of the truth whose phasors are wanted
SEGMENT_S = 0.005  # or a period of the lowest mode, if that is longer
FLOOR_DB = -60.0  # a mode so far below the loudest one of the segment is absent
WEAK_DB = -30.0  # a prediction so far below the truth has a level, but no phase that means anything
LEAST_SEGMENTS = 4  # of a window, for figures of it
LEAST_DECAY_DB = 2.0  # of the truth over the segments of a window, for a T60
MOST_SIMILAR = 0.5  # |Σz²|/Σ|z|²: 0 where both quadratures are seen alike, 1 where only one is

Array = NDArray[np.float64]
Phasors = NDArray[np.complex128]


def phasors(before: Array, now: Array, after: Array, spacing_s: float, resonator: Resonator) -> Phasors:
    """z with Re z = q(t), complex128 (..., modes), for modal amplitudes q at t - d, t and t + d, d = `spacing_s`.

    z = q + i(exp(-σd) q(t - d) - exp(σd) q(t + d)) / 2 sin ωd, which without coupling is A exp(-σt + iωt + iφ).
    With tension modulation ω is that of the present energies, to first order: ω² + k_μ Σ_m ½η_m²|z_m|² (1 + ½δ_μm)
    (Eq. 3-5, averaged over a period). ωd must stay below π: sample the truth more often than the prediction.
    """
    eigenvalues = resonator.eigenvalues()
    fading, omega = np.exp(eigenvalues.real * spacing_s), eigenvalues.imag
    difference = (before * fading - after / fading) / 2
    quadrature = difference / np.sin(omega * spacing_s)
    if resonator.tension_modulated:
        stretch = resonator.stretch * (now**2 + quadrature**2) / 2
        rise = resonator.coupling * (stretch.sum(-1, keepdims=True) + stretch / 2)
        quadrature = difference / np.sin(np.sqrt(omega**2 + rise) * spacing_s)
    return now + 1j * quadrature


def true_phasors(
    resonator: Resonator,
    initial: Array,
    rate_hz: float,
    steps: int,
    block: int,
    *,
    substeps: int | None = None,
) -> Iterator[Phasors]:
    """Phasors of frames 1 … steps in m, complex128 (batch, up to `block`, modes).

    Args:
        initial: modal amplitudes at rest in m, (batch, modes).
        substeps: of the solver in a frame; None is its default.
    """
    sample_hz = OVERSAMPLING * rate_hz
    fewer = None if substeps is None else -(-substeps // OVERSAMPLING)
    solver = SplittingSolver(resonator, sample_hz, substeps=fewer)
    state = ModalState.at_rest(initial)
    for first in range(0, steps, block):
        samples, state = solver.advance(state, OVERSAMPLING * min(block, steps - first))
        beyond, _ = solver.advance(state, 1)
        every = np.concatenate([samples, beyond], axis=1)
        before, now, after = (every[:, OVERSAMPLING - 1 + offset :: OVERSAMPLING] for offset in (-1, 0, 1))
        count = now.shape[1]
        yield phasors(before[:, :count], now, after, 1 / sample_hz, resonator)


def segment_frames(rate_hz: float, lowest_hz: float) -> int:
    """Frames of a segment, for a string whose lowest mode is known."""
    return max(8, round(max(SEGMENT_S, 1 / lowest_hz) * rate_hz))


@dataclass(frozen=True)
class PartialTrack:
    """Sums over the frames of each segment, (batch, segments, modes): all that the errors follow from.

    Attributes:
        power: Σ|z|² of the truth, float64.
        square: Σz², complex128; smaller than the power by how alike both quadratures are seen.
        match: Σz̄q̂ with the prediction q̂, complex128.
        turn: Σ z̄_k z_{k+1}, complex128; its angle is the truth's advance in a frame.
    """

    power: Array
    square: Phasors
    match: Phasors
    turn: Phasors

    @classmethod
    def join(cls, tracks: Sequence[PartialTrack]) -> PartialTrack:
        """Join the tracks of successive blocks."""
        return cls(*(np.concatenate([getattr(track, field.name) for track in tracks], 1) for field in fields(cls)))

    def gain(self) -> Phasors:
        """c, prediction over truth: NaN where the mode is not resolved, infinite where the prediction is not finite.

        It solves the normal equations Σz̄q̂ = ½(c Σ|z|² + c̄ Σz̄²).
        """
        determinant = self.power**2 - self.square.real**2 - self.square.imag**2
        with np.errstate(all="ignore"):
            gain = 2 * (self.power * self.match - self.square.conj() * self.match.conj()) / determinant
        gain = np.where(np.isfinite(self.match), gain, math.inf)
        return np.where(np.abs(self.square) < MOST_SIMILAR * self.power, gain, math.nan)

    def turns(self) -> Array:
        """Cycles of the truth in a frame, in -½ … ½: an alias, where the mode lies above half the rate."""
        return np.angle(self.turn) / (2 * math.pi)


def track_partials(predicted: NDArray[np.floating[Any]], truth: Phasors, length: int) -> PartialTrack:
    """The track of a block.

    Args:
        predicted: modal amplitudes (batch, frames, modes), in the unit of the truth.
        truth: `phasors`, complex of the same shape.
        length: frames of a segment; frames after the last whole one are left out.
    """
    if predicted.shape != truth.shape:
        raise ValueError(f"prediction {tuple(predicted.shape)} and truth {tuple(truth.shape)} differ in shape")
    shape = (len(truth), truth.shape[1] // length, length, truth.shape[2])
    frames = shape[1] * length
    z, q = truth[:, :frames].reshape(shape), predicted[:, :frames].reshape(shape).astype(np.float64)
    with np.errstate(invalid="ignore"):  # of a prediction that is not finite: a product with i would make others
        match = (z.real * q).sum(2).astype(np.complex128)
        match.imag = -(z.imag * q).sum(2)
    return PartialTrack(
        (z.real**2 + z.imag**2).sum(2), (z**2).sum(2), match, (z[:, :, :-1].conj() * z[:, :, 1:]).sum(2)
    )


@dataclass(frozen=True)
class PartialErrors:
    """The partials of trajectories in windows of time: float64 (trajectories, windows, modes), NaN where absent.

    A window reports those of its segments where the truth lies at most 60 dB below its loudest mode, and is
    resolved; with less than four of them the mode is absent. Level is of every prediction; phase and frequency
    only of segments where it lies at most 30 dB below the truth.

    Attributes:
        energy: of the truth, to compare modes by: Σ (ωA)² over the segments.
        frequency_hz: of the truth, the mean over the segments.
        level_db: of the root mean square of the prediction's envelope over that of the truth's.
        phase_cycles: prediction ahead of the truth, continued without jumps from frame 1; mean over the segments.
        cents: of the prediction's frequency over the truth's, by a straight line through the phases.
        t60_s: of the truth, by a straight line through the envelope in dB; NaN where it falls by less than 2 dB.
        t60_error_percent: of the prediction's T60; infinite where that does not decay.
        glide_cents: of the truth: its frequency in the first third of its segments over that in the last third.
        glide_error_cents: of the prediction's glide.
    """

    energy: Array
    frequency_hz: Array
    level_db: Array
    phase_cycles: Array
    cents: Array
    t60_s: Array
    t60_error_percent: Array
    glide_cents: Array
    glide_error_cents: Array

    @classmethod
    def join(cls, errors: Sequence[PartialErrors]) -> PartialErrors:
        """Join the errors of further trajectories."""
        return cls(*(np.concatenate([getattr(e, field.name) for e in errors]) for field in fields(cls)))

    def by_mode(self, window: int) -> list[PartialSummary]:
        """The medians over the trajectories, mode by mode."""
        summaries = []
        for mode in range(self.energy.shape[2]):
            values = {field.name: getattr(self, field.name)[:, window, mode] for field in fields(self)[1:]}
            there = int(np.isfinite(values["frequency_hz"]).sum())
            medians = {
                name: _median(each if name == "glide_cents" else np.abs(each)) for name, each in values.items()
            }
            summaries.append(PartialSummary(mode + 1, there, **medians))
        return summaries

    def weighted(self, window: int) -> WeightedPartials:
        """The means of the magnitudes over all modes and trajectories, by the truth's energy."""
        weights = self.energy[:, window]
        means = []
        for errors in (self.level_db, self.phase_cycles, self.cents, self.glide_error_cents):
            magnitudes = np.abs(errors[:, window])
            there = ~np.isnan(magnitudes)
            total = float(weights[there].sum())
            means.append(float((weights[there] * magnitudes[there]).sum()) / total if total > 0 else None)
        return WeightedPartials(*means)


@dataclass(frozen=True)
class PartialSummary:
    """A mode over the trajectories in which it is there: medians, of the errors' magnitudes. None: in none."""

    mode: int
    trajectories: int
    frequency_hz: float | None
    level_db: float | None
    phase_cycles: float | None
    cents: float | None
    t60_s: float | None
    t60_error_percent: float | None
    glide_cents: float | None
    glide_error_cents: float | None


@dataclass(frozen=True)
class WeightedPartials:
    """Mean magnitudes over modes and trajectories, weighted by the truth's energy. None: nothing was there.

    T60 is not among them: a single partial that does not decay would make its mean infinite.
    """

    level_db: float | None
    phase_cycles: float | None
    cents: float | None
    glide_error_cents: float | None


def partial_errors(
    track: PartialTrack,
    rate_hz: float,
    frequencies_hz: Sequence[float],
    windows_s: Sequence[tuple[float, float]],
) -> PartialErrors:
    """The errors in windows of time.

    Args:
        track: of segments of `segment_frames(rate_hz, frequencies_hz[0])` frames from frame 1 on.
        frequencies_hz: (modes,) of the linear string: which of its aliases a mode is. The true frequency must be
            nearer to it than half the rate.
        windows_s: (start, stop) of each window; a segment belongs where its middle lies.
    """
    length = segment_frames(rate_hz, frequencies_hz[0])
    power, gain = track.power, track.gain()
    level = np.abs(gain)
    floor = 10 ** (FLOOR_DB / 10) * power.max(axis=2, keepdims=True)
    there = (power > 0) & (power >= floor) & ~np.isnan(level)
    level = np.where(there, level, 1.0)
    phased = there & np.isfinite(level) & (level >= 10 ** (WEAK_DB / 20))
    alias_hz = track.turns() * rate_hz
    motion = _Motion(
        time_s=(np.arange(power.shape[1]) * length + (length + 1) / 2) / rate_hz,
        segment_s=length / rate_hz,
        there=there,
        phased=phased,
        power=power,
        level=level,
        phase=_continued_cycles(gain, phased),
        frequency_hz=alias_hz + rate_hz * np.round((np.asarray(frequencies_hz) - alias_hz) / rate_hz),
    )
    windows = [motion.window(start_s, stop_s) for start_s, stop_s in windows_s]
    if not windows:
        empty = np.empty((len(power), 0, power.shape[2]))
        return PartialErrors(*(empty for _ in fields(PartialErrors)))
    return PartialErrors(*(np.stack(values, axis=1) for values in zip(*windows, strict=True)))


@dataclass(frozen=True)
class _Motion:
    """The segments of trajectories; arrays (batch, segments, modes)."""

    time_s: NDArray[np.floating[Any]]  # (segments,), of the middles
    segment_s: float  # length of one
    there: NDArray[np.bool_]  # whether the truth is loud enough, and resolved
    phased: NDArray[np.bool_]  # whether the prediction is loud enough for a phase, too
    power: Array  # Σ|z|² of the truth
    level: Array  # |c|, prediction over truth; 1 where not there
    phase: Array  # cycles of c, without jumps
    frequency_hz: Array  # of the truth

    def window(self, start_s: float, stop_s: float) -> list[Array]:
        """The fields of `PartialErrors` for one window, (batch, modes) each."""
        inside = slice(*np.searchsorted(self.time_s, (start_s, stop_s)))
        time_s = self.time_s[inside]
        power = self.power[:, inside]
        level = self.level[:, inside]
        there, phased = self.there[:, inside], self.phased[:, inside]
        enough = there.sum(1) >= LEAST_SEGMENTS
        true_power = np.where(there, power, 0.0).sum(1)
        with np.errstate(all="ignore"):
            frequency_hz = _mean(self.frequency_hz[:, inside], there)
            found_power = np.where(there, power * level**2, 0.0).sum(1)
            level_db = 10 * np.log10(found_power / true_power)
            phase = np.where(phased.sum(1) >= LEAST_SEGMENTS, _mean(self.phase[:, inside], phased), math.nan)
            cents = self._cents(inside, phased, frequency_hz)
            true_db = 10 * np.log10(power)
            found_db = true_db + 20 * np.log10(level)
            true_slope, found_slope = (
                _slope(time_s, decibels, there & np.isfinite(decibels)) for decibels in (true_db, found_db)
            )
            span_s = there.sum(1) * self.segment_s
            t60_s = np.where(-true_slope * span_s >= LEAST_DECAY_DB, -60 / true_slope, math.nan)
            found_s = np.where(found_slope >= 0, math.inf, -60 / found_slope)
            t60_error = 100 * (found_s / t60_s - 1)
            first_hz, last_hz = (_mean(self.frequency_hz[:, inside], third) for third in _outer_thirds(there))
            glide = np.where(there.sum(1) >= 3 * LEAST_SEGMENTS, _in_cents(first_hz / last_hz), math.nan)
            first, last = _outer_thirds(phased)
            glide_error = self._cents(inside, first, first_hz) - self._cents(inside, last, last_hz)
        energy = np.where(enough, true_power * (2 * math.pi * frequency_hz) ** 2, 0.0)
        rest = (frequency_hz, level_db, phase, cents, t60_s, t60_error, glide, glide_error)
        return [energy, *(np.where(enough, values, math.nan) for values in rest)]

    def _cents(self, inside: slice, there: NDArray[np.bool_], true_hz: Array) -> Array:
        """The prediction's frequency over the truth's in cents, in the segments that are there, (batch, modes)."""
        return _in_cents(1 + _slope(self.time_s[inside], self.phase[:, inside], there) / true_hz)


def _continued_cycles(gain: NDArray[np.complex128], phased: NDArray[np.bool_]) -> Array:
    """The phases in cycles without jumps along axis 1.

    They follow from one segment that has a phase to the next that has one.
    """
    place = np.where(phased, np.arange(gain.shape[1])[None, :, None], 0)
    last = np.maximum.accumulate(place, axis=1)
    angle = np.where(phased, np.angle(np.where(phased, gain, 1.0)), 0.0)
    return np.unwrap(np.take_along_axis(angle, last, axis=1), axis=1) / (2 * math.pi)


def _in_cents(ratio: Array) -> Array:
    return 1200 * np.log2(np.where(ratio > 0, ratio, math.nan))


def _outer_thirds(there: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The first and the last third of the segments that are there, along axis 1."""
    place, count = there.cumsum(1), there.sum(1, keepdims=True)
    return there & (3 * place <= count), there & (3 * place > 2 * count)


def _mean(values: Array, there: NDArray[np.bool_]) -> Array:
    """The means (batch, modes) over the segments that are there, NaN for none."""
    return np.where(there, values, 0.0).sum(1) / there.sum(1)


def _slope(time_s: NDArray[np.floating[Any]], values: Array, there: NDArray[np.bool_]) -> Array:
    """The slope of the line through `values` (batch, segments, modes), NaN for less than LEAST_SEGMENTS of them."""
    times = np.broadcast_to(time_s[None, :, None], values.shape)
    time_off = np.where(there, times - _mean(times, there)[:, None], 0.0)
    value_off = np.where(there, values - _mean(values, there)[:, None], 0.0)
    slope = (time_off * value_off).sum(1) / (time_off**2).sum(1)
    return np.where(there.sum(1) >= LEAST_SEGMENTS, slope, math.nan)


def _median(values: Array) -> float | None:
    """The median of the values that are there."""
    there = values[~np.isnan(values)]
    return float(np.median(there)) if len(there) else None
