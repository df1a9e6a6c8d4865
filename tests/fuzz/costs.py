"""What reading a file costs: processor time, and memory beyond what the process held before."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

from app.shared.heap import return_free_pages

MOST_MB = 200  # for any file, refused or not
PEAK = Path("/proc/self/clear_refs")  # 5, written to it, forgets the largest size that the process ever had


@dataclass
class Costs:
    """The slowest and the largest reading so far; its size stays 0 where the system does not report it."""

    slowest_s: float = 0.0
    largest_mb: float = 0.0

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Around nothing but the reading. Processor seconds are of all threads, and load hardly moves them."""
        return_free_pages()
        if PEAK.exists():
            PEAK.write_text("5")
        before, begun_s = psutil.Process().memory_info().rss, time.process_time()
        try:
            yield
        finally:
            self.slowest_s = max(self.slowest_s, time.process_time() - begun_s)
            if PEAK.exists():
                lines = Path("/proc/self/status").read_text().splitlines()
                largest = 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
                self.largest_mb = max(self.largest_mb, (largest - before) / 1e6)

    def __str__(self) -> str:
        return f"the slowest reading {self.slowest_s:.2f} s of processor, the largest {self.largest_mb:.0f} MB"
