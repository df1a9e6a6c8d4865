"""The machine, and how its time is taken."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch


@dataclass(frozen=True)
class Machine:
    """What a timing depends on."""

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
            _processor(),
            torch.get_num_threads(),
            torch.__version__,
            platform.python_version(),
            platform.system(),
        )


def _processor() -> str:
    """The processor's name; Linux tells it in a file alone."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def times_s(work: Callable[[], object], repeats: int, *, warm_up: bool = True) -> list[float]:
    """Wall-clock times of `work` in s, after one call that does not count (compilation, caches)."""
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
    """As in the app, where the window and the sound need the other cores."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
