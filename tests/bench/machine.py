"""The machine that a benchmark runs on, and timing."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch

from training.provenance import processor


@dataclass(frozen=True)
class Machine:
    """What timings depend on, beside the code. `threads`: those that torch uses."""

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


def times_s(work: Callable[[], object], repeats: int, *, warm_up: bool = True) -> list[float]:
    """Wall-clock times of `work` in s; `warm_up`: after one call that does not count (compilation, caches)."""
    if warm_up:
        work()
    found = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        found.append(time.perf_counter() - started)
    return found


def median_s(work: Callable[[], object], repeats: int, *, warm_up: bool = True) -> float:
    return statistics.median(times_s(work, repeats, warm_up=warm_up))


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit torch to one thread, as in the app, where the window and the sound need the other cores."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
