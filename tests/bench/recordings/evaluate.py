"""The errors of many recordings in one table, with baselines; what is printed says how many recordings it is of.

Each recording is learned alone. The baselines are linear: one and two poles a partial, of the same series, without
glide and without free poles. The unseen half is the part from 1.25 s to the end of the fit, after a fit of the first
1.25 s. A held-out take is played by another take's poles and glide, at one gain, one delay, one pitch and one level,
with the square of which the glide goes. A held-out dynamic is played by poles that takes of other dynamics share; its
amplitudes, pitch and glide are fitted.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, optimize, signal

from engine.compare.relative import error_to_signal
from training.recording.fit import LearnedNote, fit_note, fit_takes
from training.recording.gate import examine
from training.recording.glide import Glide
from training.recording.note import FIT_BEGINS_S, FIT_LASTS_S, Note, RecordingError, note_of
from training.recording.numbering import Series, number_note
from training.recording.physics import physics_of
from training.recording.report import aligned, errors_of

Array = NDArray[np.float64]
Recordings = Mapping[str, tuple[Array, int]]

DYNAMIC = re.compile(r"_[pmf][a-z]$")  # of a name: piano, mezzo or forte, and a letter for the take
HALF_S = 1.25
COARSE_HZ = 8_000  # takes are compared below 4 kHz
MOST_PITCH = 0.006  # that another take may be higher or lower, as a share
MOST_DELAY_S = 0.012
MOST_OF_TAKES = 0.10  # the aim of a held-out take's ESR
LEVEL_STEPS = (3e-4, 0.15)  # of pitch and level, at first
LEAST_RISE = 6e-4  # of the frequencies, one cent: a smaller glide cannot be separated from none
GLIDE_STEPS = (3e-4, 4e-3, 4e-3, 3e-3)  # of pitch and shares, at first


def evaluate(
    recordings: Recordings, *, quick: bool = False, progress: Callable[[float], None] = lambda share: None
) -> dict[str, Any]:
    """Rows per recording and the figures' values, as plain data.

    Args:
        recordings: samples and rate by name.
        quick: leaves out baselines, halves and takes.
    """
    rows: list[list[Any]] = []
    values: dict[str, list[float]] = {}
    notes: dict[str, tuple[Note, Series, LearnedNote]] = {}
    for number, (name, (samples, rate)) in enumerate(recordings.items()):
        progress(number / len(recordings))
        try:
            row, note, series, learned = _row(name, samples, rate, values, quick)
            notes[name] = note, series, learned
        except RecordingError as error:
            row = [name, str(error), *[None] * 7]
        rows.append(row)
    _glides({name: learned for name, (_, _, learned) in notes.items()}, values)
    if not quick:
        for first, second in itertools.permutations(notes, 2):
            if first[:-1] == second[:-1] and DYNAMIC.search(first) and DYNAMIC.search(second):
                _takes(notes[first], notes[second], values)
        _dynamics({name: (note, series) for name, (note, series, _) in notes.items()}, values)
    progress(1.0)
    return {"rows": rows, "values": values, "recordings": len(recordings)}


def dynamics(
    recordings: Recordings, *, progress: Callable[[float], None] = lambda share: None
) -> dict[str, list[float]]:
    """The figures of held-out dynamics alone; recordings that are refused are left out."""
    notes: dict[str, tuple[Note, Series]] = {}
    values: dict[str, list[float]] = {}
    for name, (samples, rate) in recordings.items():
        note = note_of(samples, rate)
        series = number_note(note)
        if series is not None and series.present:
            notes[name] = note, series
    stems = sorted({name[:-2] for name in notes if DYNAMIC.search(name)})
    for number, stem in enumerate(stems):
        progress(number / len(stems))
        _dynamics({name: each for name, each in notes.items() if name[:-2] == stem}, values)
    progress(1.0)
    return values


def _row(
    name: str, samples: Array, rate: int, values: dict[str, list[float]], quick: bool
) -> tuple[list[Any], Note, Series, LearnedNote]:
    note = note_of(samples, rate)
    series = number_note(note)
    findings = examine(samples, note, series)
    kinds = ", ".join(each.kind for each in findings) or "one note"
    if series is None or not series.present or any(each.refused for each in findings):
        raise RecordingError(f"refused: {kinds}")
    truth = note.fitted()
    t = np.arange(len(truth)) / note.rate_hz

    def error(learned: LearnedNote, begin_s: float = 0.0) -> float:
        first = round(begin_s * note.rate_hz)
        return error_to_signal(learned.render(t[first:]), truth[first:])

    learned = fit_note(note, series)
    errors = errors_of(truth, learned.render(t), note.rate_hz, note.noise_power)
    found: dict[str, float | None] = {
        "own note, ESR": errors.esr,
        "own note from 50 ms, ESR": errors.late_esr,
        "own note, log spectral distance in dB": errors.distance_db,
        "linear, 1 pole a partial, ESR": None,
        "linear, 2 poles a partial, ESR": None,
        "unseen half, ESR": None,
        "unseen half, linear, 2 poles, ESR": None,
    }
    if not quick:
        linear = [fit_note(note, series, poles_a_partial=count, free=0, glides=False) for count in (1, 2)]
        found["linear, 1 pole a partial, ESR"], found["linear, 2 poles a partial, ESR"] = map(error, linear)
        if len(truth) > 1.3 * HALF_S * note.rate_hz:
            half = fit_note(note, series, seconds=HALF_S)
            linear_half = fit_note(note, series, seconds=HALF_S, poles_a_partial=2, free=0, glides=False)
            found["unseen half, ESR"] = error(half, HALF_S)
            found["unseen half, linear, 2 poles, ESR"] = error(linear_half, HALF_S)
            _append(
                values, "unseen half below linear, 2 poles", float(error(half, HALF_S) < error(linear_half, HALF_S))
            )
    for figure, value in found.items():
        if value is not None:
            _append(values, figure, value)
    return [name, kinds, *found.values()], note, series, learned


def _glides(notes: Mapping[str, LearnedNote], values: dict[str, list[float]]) -> None:
    """How the glides of two dynamics compare: the string's law is that they go with its energy.

    Where both glide, the power of the energy is measured. Where one does not, it is what the law leaves it in cents.
    """
    found = {name: physics_of(learned) for name, learned in notes.items() if DYNAMIC.search(name)}
    for pair in itertools.combinations(found, 2):
        if pair[0][:-2] != pair[1][:-2] or pair[0][-2] == pair[1][-2]:
            continue
        less, more = sorted((found[name] for name in pair), key=lambda each: each.rise)
        share = sum(each.energy for each in less.partials) / sum(each.energy for each in more.partials)
        if less.rise > LEAST_RISE:
            power = np.log(less.rise / more.rise) / np.log(share)
            _append(values, "glide of two dynamics, power of the energy", float(power))
        elif more.rise > LEAST_RISE:
            left_cents = 1200 * np.log2(1 + more.rise * share)
            _append(values, "no glide in one, what the law leaves it in cents", float(left_cents))


def _dynamics(notes: Mapping[str, tuple[Note, Series]], values: dict[str, list[float]]) -> None:
    """Each dynamic of a note against a joint fit of the others; see DYNAMIC."""
    for stem in sorted({name[:-2] for name in notes if DYNAMIC.search(name)}):
        names = [name for name in notes if name[:-2] == stem]
        for held in sorted({name[-2] for name in names}):
            others = [name for name in names if name[-2] != held]
            if not others:
                continue
            richest_first = sorted((notes[name] for name in others), key=lambda each: -max(each[1].present))
            learned = fit_takes(richest_first)[0]
            linear = fit_takes(richest_first, free=0, glides=False)[0]
            for name in names:
                if name[-2] == held:
                    truth, t = _coarse(notes[name][0])
                    error, by_linear = _refitted(truth, learned, t, True), _refitted(truth, linear, t, False)
                    _append(values, "held-out dynamic, ESR", error)
                    _append(values, "held-out dynamic, linear, 2 poles, ESR", by_linear)
                    _append(values, "held-out dynamic, at most 0.20", float(error <= 0.2))
                    _append(values, "held-out dynamic, below linear, 2 poles", float(error < by_linear))


def _coarse(note: Note) -> tuple[Array, Array]:
    """The fitted part below 4 kHz, and its times."""
    step = max(1, note.rate_hz // COARSE_HZ)
    own = note.fitted()
    truth = signal.decimate(own, step, ftype="fir") if step > 1 else own
    return truth, np.arange(len(truth)) * step / note.rate_hz


def _takes(
    first: tuple[Note, Series, LearnedNote], second: tuple[Note, Series, LearnedNote], values: dict[str, list[float]]
) -> None:
    """One take against another: the recordings, the poles with their amplitudes, and with amplitudes fitted again.

    The level bends the recording as well, by the learned glide, so that both have as many numbers.
    """
    (note, _, learned), (other, _, _) = first, second
    if note.rate_hz != other.rate_hz:
        return
    truth, own = other.fitted(), note.fitted()
    truth = truth[: len(own)]
    step = max(1, note.rate_hz // COARSE_HZ)
    rate = note.rate_hz / step
    begins = note.onset / note.rate_hz + FIT_BEGINS_S
    truth, samples = (
        signal.decimate(each, step, ftype="fir") if step > 1 else each for each in (truth, note.samples)
    )
    t, whole = np.arange(len(truth)) / rate, np.arange(len(samples)) / rate - begins
    take = interpolate.CubicSpline(whole, samples)
    learned = below(learned, rate)

    def bent(level: float) -> Callable[[Array], Array]:
        return lambda t: take(learned.glide.times(at_level(learned, level).glide.tau(t)))

    def played(level: float) -> Callable[[Array], Array]:
        return at_level(learned, level).render

    for name, sound, at in (("take against take", take, bent), ("held-out take", learned.render, played)):
        error, pitch = held_out(truth, sound, t, rate)
        _append(values, f"{name}, ESR", error)
        error = with_level(truth, at, t, rate, pitch)
        _append(values, f"{name}, level too, ESR", error)
        _append(values, f"{name}, level too, at most 0.10", float(error <= MOST_OF_TAKES))
    _append(values, "held-out take, amplitudes refitted, ESR", _refitted(truth, learned, t, False))


def held_out(truth: Array, sound: Callable[[Array], Array], t: Array, rate_hz: float) -> tuple[float, float]:
    """The least ESR over one pitch, one gain and one delay; the pitch."""

    def left(pitch: float) -> float:
        return _misses(truth, sound, t, rate_hz, pitch)

    grid = np.linspace(-MOST_PITCH, MOST_PITCH, 21)
    place = float(min(grid, key=left))
    step = float(grid[1] - grid[0])
    found = optimize.minimize_scalar(
        left, bounds=(place - step, place + step), method="bounded", options={"xatol": 2e-6}
    )
    return min((float(found.fun), float(found.x)), (left(place), place))


def at_level(learned: LearnedNote, level: float) -> LearnedNote:
    """Struck at a level, 1 being its own: tension and glide go with its square, as the string's law demands."""
    return replace(learned, glide=Glide(learned.glide.shares * level**2))


def with_level(
    truth: Array, at: Callable[[float], Callable[[Array], Array]], t: Array, rate_hz: float, pitch: float
) -> float:
    """The least ESR over one level besides, of the sound at each level; 1 is its own."""

    def left(x: Array) -> float:
        return _misses(truth, at(x[1]), t, rate_hz, x[0])

    start = np.array([pitch, 1.0])
    corners = np.stack([start, *(start + step for step in np.diag(LEVEL_STEPS))])
    options = {"maxfev": 60, "initial_simplex": corners, "xatol": 2e-6, "fatol": 1e-5}
    return float(optimize.minimize(left, start, method="Nelder-Mead", options=options).fun)


def _misses(truth: Array, sound: Callable[[Array], Array], t: Array, rate_hz: float, pitch: float) -> float:
    """The ESR at a pitch, with the best gain and delay."""
    best, delay = np.inf, 0.0
    for _ in range(3):
        moved, _, more = aligned(truth, sound(np.maximum(t - delay, -FIT_BEGINS_S) * (1 + pitch)), rate_hz)
        best = min(best, error_to_signal(moved, truth))
        if abs(more) < 1e-5 or abs(delay + more) > MOST_DELAY_S:
            break
        delay += more
    return best


def below(learned: LearnedNote, rate_hz: float) -> LearnedNote:
    """Without the poles that a rate cannot hold."""
    return replace(learned, poles=tuple(pole for pole in learned.poles if pole.hz < 0.4 * rate_hz))


def _refitted(truth: Array, learned: LearnedNote, t: Array, glides: bool) -> float:
    """The least ESR over one pitch, all amplitudes, and the glide where it `glides`: poles alone carry over."""
    poles = below(learned, 1 / (t[1] - t[0])).poles
    s = np.array([pole.s for pole in poles])[:, None]
    of_string = np.array([pole.partial > 0 for pole in poles])[:, None]
    whole = float(truth @ truth)

    def left(pitch: float, *shares: float) -> float:
        glide = Glide(np.array(shares), pitch) if shares else replace(learned.glide, pitch=pitch)
        shape = np.exp(s * np.where(of_string, glide.tau(t), t))
        rows = np.concatenate([shape.real, -shape.imag])
        square = rows @ rows.T
        square[np.diag_indices_from(square)] *= 1 + 1e-6
        right = rows @ truth
        return max(0.0, whole - float(right @ np.linalg.solve(square, right))) / max(whole, 1e-30)

    grid = np.linspace(-MOST_PITCH, MOST_PITCH, 13)
    place = float(min(grid, key=left))
    if not glides:
        step = float(grid[1] - grid[0])
        bounds = place - step, place + step
        found = optimize.minimize_scalar(
            left, bounds=bounds, method="bounded", options={"xatol": 1e-5, "maxiter": 12}
        )
        return float(min(found.fun, left(place)))
    start = np.array([place, *learned.glide.shares])
    corners = np.stack([start, *(start + step for step in np.diag(GLIDE_STEPS))])
    options = {"maxfev": 220, "initial_simplex": corners}
    return float(optimize.minimize(lambda x: left(*x), start, method="Nelder-Mead", options=options).fun)


def _append(values: dict[str, list[float]], name: str, value: float) -> None:
    values.setdefault(name, []).append(value)


def table(values: Mapping[str, Sequence[float]]) -> list[Sequence[Any]]:
    """Figure, median, 90th percentile, N."""
    rows: list[Sequence[Any]] = []
    for name, found in values.items():
        if set(found) <= {0.0, 1.0}:
            rows.append((f"{name}, share", float(np.mean(found)), None, len(found)))
        else:
            rows.append((name, float(np.median(found)), float(np.percentile(found, 90)), len(found)))
    return rows


__all__ = ["FIT_LASTS_S", "at_level", "below", "evaluate", "held_out", "table", "with_level"]
