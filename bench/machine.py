"""The machine that a benchmark runs on, and how work and sound are timed."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

import torch

from engine.voices import Mixer
from training.provenance import processor

RATE_HZ = 48_000
EDGES_S = (0.0, 0.05, 1.0, 4.0)  # of the ages of sound that are timed apart
REPEATS = 5
STEP_FRAMES = 480


@dataclass(frozen=True)
class Machine:
    """The facts on which timings depend, beside the code. `threads`: those that torch uses."""

    cpu_count: int
    processor: str
    threads: int
    torch: str
    python: str
    system: str

    @classmethod
    def here(cls) -> Machine:
        return cls(
            os.cpu_count() or 1,
            processor(),
            torch.get_num_threads(),
            torch.__version__,
            platform.python_version(),
            platform.system(),
        )


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Limit torch to so many threads; None leaves it as it is."""
    before = torch.get_num_threads()
    torch.set_num_threads(count or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def times_s(
    work: Callable[[], object], repeats: int = REPEATS, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Times of `work` in s by a clock, after one call that does not count (compilation, caches)."""
    work()
    found = []
    for _ in range(repeats):
        started = clock()
        work()
        found.append(clock() - started)
    return found


def median_s(work: Callable[[], object], repeats: int = REPEATS) -> float:
    return statistics.median(times_s(work, repeats))


@dataclass(frozen=True)
class Shares:
    """Shares of a core by the age of the sound, at 48 kHz: processor time of one thread, less an empty mixer's.

    Attributes:
        onset, first_second, later: over the first 50 ms, the first second, and seconds 1 to 4.
        mean: over the first four seconds.
    """

    onset: float
    first_second: float
    later: float
    mean: float

    def times(self, factor: float) -> Shares:
        return Shares(factor * self.onset, factor * self.first_second, factor * self.later, factor * self.mean)


def shares(make: Callable[[], Sequence[Mixer]]) -> Shares:
    """Measure mixers that are rendered together. `make`: prepares those of one repeat."""
    empty_s = statistics.median(sum(_ages_s([Mixer(RATE_HZ)])) for _ in range(REPEATS)) / EDGES_S[-1]
    repeats = [_ages_s(make()) for _ in range(REPEATS + 1)][1:]  # the first loads what is compiled
    onset_s, rest_s, later_s = (statistics.median(ages) for ages in zip(*repeats, strict=True))
    _, onset_end_s, second_end_s, end_s = EDGES_S
    return Shares(
        onset_s / onset_end_s - empty_s,
        (onset_s + rest_s) / second_end_s - empty_s,
        later_s / (end_s - second_end_s) - empty_s,
        (onset_s + rest_s + later_s) / end_s - empty_s,
    )


def _ages_s(mixers: Sequence[Mixer]) -> list[float]:
    found = []
    for begin_s, end_s in pairwise(EDGES_S):
        began_s = time.thread_time()
        for _ in range(round((end_s - begin_s) * RATE_HZ) // STEP_FRAMES):
            for mixer in mixers:
                mixer.render(STEP_FRAMES)
        found.append(time.thread_time() - began_s)
    return found
