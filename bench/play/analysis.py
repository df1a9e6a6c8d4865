"""Holes, clicks and the beginnings of plucks in a recording of plucked strings.

Ringing strings are predictable: a linear prediction fitted to a few hundredths of a second leaves almost no residual.
What is not predictable stands out of the residual, however loud the strings ring: a new pluck, after which the
residual stays larger for long, or a click, after which it is as before.

Sounds are float arrays at `rate_hz`; places are frames from their beginning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

ZERO = 1e-7  # samples below it are silence
SHORTEST_HOLE_S = 0.001
SOUNDS_S = 0.5  # for how long a pluck is heard at least
NEARBY_S = 0.025
ORDER = 32  # of the prediction
FIT_S = 0.01
FITTED_STEPS = 4
STEP_S = 0.00025  # places of events are searched in such steps
STANDS_OUT = 6.0  # an event's residual is so many times the residual nearby
MOSTLY = 0.9  # quantile of the residual nearby
FAINTEST_CLICK = 1e-4
FAINTEST_PLUCK = 1e-6
ATTACK_S = 0.006  # of a pluck
LATEST_S = 0.5  # from a key to the beginning of its pluck, at most
EARLY_OR_LATE_S = 0.04  # deviation of a pluck's latency from the usual one, at most


@dataclass(frozen=True)
class Span:
    """Frames start ≤ n < end."""

    start: int
    end: int

    @property
    def frames(self) -> int:
        return self.end - self.start

    def meets(self, other: Span) -> bool:
        return self.start < other.end and other.start < self.end


def holes(sound: NDArray[np.float32], expected: Sequence[Span], rate_hz: int) -> list[Span]:
    """Silences of all channels of a millisecond or more where sound is expected. `sound`: (frames, channels)."""
    silent = np.all(np.abs(sound) < ZERO, axis=1)
    shortest = round(SHORTEST_HOLE_S * rate_hz)
    found = [_moved(run, span.start) for span in expected for run in _runs(silent[span.start : span.end])]
    return [run for run in found if run.frames >= shortest]


def tone_holes(sound: NDArray[np.float32], rate_hz: int) -> list[Span]:
    """Silences of a millisecond or more in a steady tone (frames, channels)."""
    return holes(sound, [Span(0, len(sound))], rate_hz)


def expected_sound(sound: NDArray[np.float32], keys: Sequence[int], rate_hz: int) -> list[Span]:
    """The spans that must sound: from the first sound after a key on, until half a second after the last key."""
    sounds = np.flatnonzero(np.any(np.abs(sound) >= ZERO, axis=1))
    spans: list[Span] = []
    for key in sorted(keys):
        end = min(key + round(SOUNDS_S * rate_hz), len(sound))
        if spans and key <= spans[-1].end:
            spans[-1] = Span(spans[-1].start, end)
            continue
        place = np.searchsorted(sounds, key)
        if place < sounds.size and sounds[place] < end:
            spans.append(Span(int(sounds[place]), end))
    return spans


@dataclass(frozen=True)
class Unpredicted:
    """Magnitudes of the residuals of linear predictions of one channel, (frames,).

    Attributes:
        by_past: of a prediction fitted to the sound just before: little before a pluck, much after it.
        by_both: the smaller of that one and of a prediction fitted to the sound just after: little after a pluck too,
            so that what stands out of it is no ringing string.
    """

    by_past: NDArray[np.float64]
    by_both: NDArray[np.float64]


def unpredicted(sound: NDArray[np.floating], rate_hz: int) -> Unpredicted:
    """Residuals of predictions fitted to `FITTED_STEPS` steps of `FIT_S` and used in the step after, or before."""
    size = round(FIT_S * rate_hz)
    steps = -(-len(sound) // size)
    signal = np.concatenate([np.zeros(ORDER), np.asarray(sound, float), np.zeros(steps * size - len(sound))])
    rows = sliding_window_view(signal, ORDER + 1)  # the last entry of row n is frame n, the others what came before
    products = np.zeros((steps + 2 * FITTED_STEPS, ORDER + 1, ORDER + 1))  # of each step, with silence at both ends
    with threadpool_limits(limits=1, user_api="blas"):  # products as small as these are slower with more threads
        for step in range(steps):
            here = np.ascontiguousarray(rows[step * size : (step + 1) * size])
            products[FITTED_STEPS + step] = here.T @ here
    sums = np.concatenate([np.zeros((1, ORDER + 1, ORDER + 1)), np.cumsum(products, axis=0)])
    del products
    around = (
        sums[FITTED_STEPS:] - sums[:-FITTED_STEPS]
    )  # of the steps i … i + FITTED_STEPS - 1, counted with the ends
    ridge = 1e-10 * np.trace(around[:, :-1, :-1], axis1=1, axis2=2) / ORDER + 1e-20
    past_products = around[:, :-1, :-1] + ridge[:, np.newaxis, np.newaxis] * np.eye(ORDER)
    with threadpool_limits(limits=1, user_api="blas"):
        weights = np.linalg.solve(past_products, around[:, :-1, -1:])[..., 0]
    by_past, by_both = np.zeros(steps * size), np.zeros(steps * size)
    for step in range(steps):
        frames = slice(step * size, (step + 1) * size)
        here, past, future = rows[frames], weights[step], weights[step + FITTED_STEPS + 1]
        by_past[frames] = np.abs(here[:, -1] - here[:, :-1] @ past)
        by_both[frames] = np.minimum(by_past[frames], np.abs(here[:, -1] - here[:, :-1] @ future))
    return Unpredicted(by_past[: len(sound)], by_both[: len(sound)])


@dataclass(frozen=True)
class Events:
    """Places where a residual stands out: from the residual before (`plucks`), or on both sides (`spikes`)."""

    plucks: tuple[int, ...]
    spikes: tuple[int, ...]


def events(rest: Unpredicted, rate_hz: int) -> Events:
    """The events of residuals. Several within `ATTACK_S` count as one."""
    step = round(STEP_S * rate_hz)
    near = round(NEARBY_S / STEP_S)
    gap = 2 + -(-ORDER // step)  # a click disturbs all predictions that it is part of

    def highest_of_steps(left: NDArray[np.float64]) -> NDArray[np.float64]:
        return left[: len(left) // step * step].reshape(-1, step).max(axis=1)

    def places(found: NDArray[np.bool_], left: NDArray[np.float64]) -> tuple[int, ...]:
        kept: list[int] = []
        for index in np.flatnonzero(found):
            if not kept or index - kept[-1] > ATTACK_S / STEP_S:
                kept.append(int(index))
        ranges = [left[index * step : (index + 1) * step] for index in kept]
        return tuple(i * step + int(np.argmax(part > 0.5 * part.max())) for i, part in zip(kept, ranges, strict=True))

    size = highest_of_steps(rest.by_both)
    spikes = (size > FAINTEST_CLICK) & (size >= _highest(size, -1, 1))
    spikes &= size > STANDS_OUT * _quantile(size, -near, -2, MOSTLY)  # a quantile, to ignore other clicks nearby
    spikes &= size > STANDS_OUT * _quantile(size, gap, near, MOSTLY)
    size = highest_of_steps(rest.by_past)
    before = np.maximum(_highest(size, -near, -2), FAINTEST_PLUCK / STANDS_OUT)
    rings = _quantile(size, gap, round(0.01 / STEP_S), 0.5)
    plucks = (size > STANDS_OUT * before) & (rings > before)
    sharp = tuple(place for place in places(spikes, rest.by_both) if _begins_at_once(rest.by_both, place))
    return Events(places(plucks, rest.by_past), sharp)


def matched(
    keys: Sequence[int], found: Events, strength: NDArray[np.float64], usual: int, rate_hz: int
) -> list[int | None]:
    """The beginning of each key's pluck: the strongest event about `usual` frames after it; None without one.

    An event that is much earlier or later is not matched; `untimely` finds it.
    """
    farthest = round(EARLY_OR_LATE_S * rate_hz)
    places = np.array(sorted({*found.plucks, *found.spikes}), int)

    def strongest(start: int, end: int) -> int | None:
        first, last = np.searchsorted(places, (start, end))
        reach = round(0.001 * rate_hz)
        return max((int(p) for p in places[first:last]), key=lambda p: strength[p : p + reach].max(), default=None)

    return [strongest(key + usual - farthest, key + usual + farthest) for key in keys]


def untimely(found: Events, plucked: Sequence[int | None], rate_hz: int) -> list[int]:
    """Beginnings of plucks that are no key's: of a window that was kept from its core, as a rule, which plucks late.

    They are no clicks, after which a residual is as small as before.
    """
    apart = round(ATTACK_S * rate_hz)
    taken = [place for place in plucked if place is not None]
    return [place for place in found.plucks if all(abs(place - other) > apart for other in taken)]


def clicks(
    found: Events, plucked: Sequence[int | None], gaps: Sequence[Span], expected: Sequence[Span], rate_hz: int
) -> list[int]:
    """Spikes while sound is expected that are no attack of a pluck and no edge of a hole."""
    apart = round(ATTACK_S * rate_hz)
    known = [Span(place - apart, place + apart) for place in plucked if place is not None]
    known += [Span(gap.start - apart, gap.end + apart) for gap in gaps]
    return [
        place
        for place in found.spikes
        if any(span.start <= place < span.end for span in expected)
        and not any(span.start <= place < span.end for span in known)
    ]


@dataclass(frozen=True)
class Faults:
    """Faults of the sound of some keys, as places in it.

    Attributes:
        untimely: beginnings of plucks that are no key's.
    """

    holes: tuple[Span, ...]
    untimely: tuple[int, ...]
    clicks: tuple[int, ...]


def faults(sound: NDArray[np.float32], keys: Sequence[int], usual: int, rate_hz: int) -> Faults:
    """Find those of the sound (frames, channels) of keys that were pressed at these frames.

    Args:
        usual: frames from a key to its pluck.
    """
    expected = expected_sound(sound, keys, rate_hz)
    silent = holes(sound, expected, rate_hz)
    rest = unpredicted(sound[:, 0], rate_hz)
    found = events(rest, rate_hz)
    plucked = matched(keys, found, rest.by_past, usual, rate_hz)
    late = untimely(found, plucked, rate_hz)
    clicked = clicks(found, [*plucked, *late], silent, expected, rate_hz)
    return Faults(tuple(silent), tuple(late), tuple(clicked))


def onset(sound: NDArray[np.floating], key: int, rate_hz: int) -> int | None:
    """The first frame, of one channel, of the pluck that a key began, or None where none began within half a second.

    Out of silence it is the first frame that sounds. Where something rings it is the first that cannot be predicted
    from what sounded before, which is some frames late where a pluck begins softly.
    """
    end = min(key + round(LATEST_S * rate_hz), len(sound))
    quiet = key - round(0.005 * rate_hz)
    after = np.abs(sound[key:end])
    if np.abs(sound[max(quiet, 0) : key]).max(initial=0) < FAINTEST_PLUCK:
        over = after > FAINTEST_PLUCK
        return key + int(np.argmax(over)) if over.any() else None
    start = max(key - round(0.1 * rate_hz), 0)
    found = events(unpredicted(sound[start:end], rate_hz), rate_hz)
    return next((start + place for place in found.plucks if start + place > key), None)


def _begins_at_once(rest: NDArray[np.float64], place: int) -> bool:
    """Return True if the residual is small right before this place: a step, and not a short tone of high partials."""
    part = rest[max(place - ORDER, 0) : place + ORDER]
    start = int(np.argmax(part > 0.2 * part.max()))
    return start > 2 and bool(STANDS_OUT * part[: start - 1].max() < part.max())


def _runs(where: NDArray[np.bool_]) -> list[Span]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], where.astype(np.int8), [0]])))
    return [Span(int(start), int(end)) for start, end in zip(edges[::2], edges[1::2], strict=True)]


def _moved(span: Span, frames: int) -> Span:
    return Span(span.start + frames, span.end + frames)


def _highest(values: NDArray[np.float64], first: int, last: int) -> NDArray[np.float64]:
    """The maximum at each place over the places from `first` to `last` further on."""
    padded = np.pad(values, (max(-first, 0), max(last, 0)))
    start = max(first, 0)
    return sliding_window_view(padded, last - first + 1)[start : start + values.size].max(axis=1)


def _quantile(values: NDArray[np.float64], first: int, last: int, share: float) -> NDArray[np.float64]:
    """The quantile `share` at each place over the places from `first` to `last` further on."""
    padded = np.pad(values, (max(-first, 0), max(last, 0)))
    start = max(first, 0)
    windows = sliding_window_view(padded, last - first + 1)[start : start + values.size]
    return np.partition(windows, place := int(share * (last - first)), axis=1)[:, place]
