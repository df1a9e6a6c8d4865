"""A recording of all that the sound card was given, and the time of each of its frames.

The recorder's pipe brings blocks, some of them late. A frame's time is read from the straight line that lies below
all arrivals and as close to them as possible: the sound card's clock as it would arrive if no block were late. What
remains is a constant, the way from the card to this process. It is found by clicks of known times (`calibration.py`),
and drops out of the difference of two times.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from bench.play.children import child
from bench.play.sound_server import CHANNELS, FORMAT, RATE_HZ, SINK, SoundServer

LATENCY_MS = 5  # of the recorder, and through it of the sink: how much the card takes at a time
FRAME_BYTES = 4 * CHANNELS
READ_BYTES = 1 << 16
AUDIBLE = 1e-6
WINDOW_S = 1.0  # within which at least one arrival should lie close to the line


@dataclass(frozen=True)
class CardClock:
    """time_s = start_s + frame · frame_s, on `time.monotonic`.

    `spread_s`: the largest distance from the line to the earliest arrival of a second, an estimate of its error.
    """

    start_s: float
    frame_s: float
    spread_s: float

    @classmethod
    def through(cls, frames: NDArray[np.float64], times_s: NDArray[np.float64]) -> CardClock:
        """The line below all arrivals: at `times_s` (n,) so many `frames` (n,) had arrived."""
        hull: list[int] = []
        for index in range(len(frames)):
            while len(hull) > 1 and _left_of(frames, times_s, hull[-2], hull[-1], index):
                hull.pop()
            hull.append(index)
        middle = float(np.mean(frames))  # of all lines below, the hull's edge there has the least sum of distances
        right = next((i for i in range(1, len(hull)) if frames[hull[i]] >= middle), len(hull) - 1)
        first, second = hull[right - 1], hull[right]
        frame_s = float((times_s[second] - times_s[first]) / (frames[second] - frames[first]))
        start_s = float(times_s[first] - frame_s * frames[first])
        late_s = times_s - start_s - frame_s * frames
        window = ((times_s - times_s[0]) / WINDOW_S).astype(int)
        return cls(start_s, frame_s, max(float(late_s[window == number].min()) for number in np.unique(window)))

    def time_s(self, frame: float) -> float:
        return self.start_s + frame * self.frame_s

    def frame(self, time_s: float) -> int:
        return round((time_s - self.start_s) / self.frame_s)


def _left_of(x: NDArray[np.float64], y: NDArray[np.float64], a: int, b: int, c: int) -> bool:
    """Return True if b is not below the line from a to c."""
    return bool((y[b] - y[a]) * (x[c] - x[a]) >= (y[c] - y[a]) * (x[b] - x[a]))


class Recording:
    """A file of the recorder's samples, written by a thread until the recorder ends."""

    def __init__(self, pipe: IO[bytes], path: Path) -> None:
        self._pipe, self._path = pipe, path
        self._arrivals: list[tuple[int, float]] = []
        self.sounded_s = -np.inf  # when the last audible frame arrived
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        size = 0
        with self._path.open("wb") as file:
            while data := self._pipe.read(READ_BYTES):
                now_s = time.monotonic()
                size += len(data)
                file.write(data)
                file.flush()
                self._arrivals.append((size // FRAME_BYTES, now_s))
                if np.abs(np.frombuffer(data[: len(data) // 4 * 4], np.float32)).max(initial=0) > AUDIBLE:
                    self.sounded_s = now_s

    def wait_for_sound(self, since_s: float, seconds: float) -> bool:
        """Wait until something audible came after `since_s`; False where nothing did within `seconds`."""
        return self._wait(lambda: self.sounded_s > since_s, seconds)

    def wait_for_silence(self, silence_s: float, seconds: float) -> bool:
        """Wait until nothing audible came for `silence_s`; False where it did not end within `seconds`."""
        return self._wait(lambda: time.monotonic() - self.sounded_s > silence_s, seconds)

    def wait_for_end(self) -> None:
        """Wait for the recorder's end, and all that it still brought."""
        self._thread.join()

    def _wait(self, holds: Callable[[], bool], seconds: float) -> bool:
        deadline_s = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > deadline_s or not self._thread.is_alive():
                return False
            time.sleep(0.01)
        return True

    def sound(self) -> NDArray[np.float32]:
        """The sound recorded so far, mapped from the file, shape (frames, channels)."""
        frames = self._path.stat().st_size // FRAME_BYTES
        return np.memmap(self._path, np.float32, "r", shape=(frames, CHANNELS))

    def clock(self) -> CardClock:
        frames, times_s = np.array(self._arrivals[1:], float).T
        return CardClock.through(frames, times_s)


@contextlib.contextmanager
def recording(server: SoundServer, path: Path, sink: str = SINK) -> Iterator[Recording]:
    """Record what a sink is given into `path` until the block ends."""
    command = ["parec", "--raw", "-d", f"{sink}.monitor", f"--format={FORMAT}", f"--rate={RATE_HZ}"]
    command += [f"--channels={CHANNELS}", f"--latency-msec={LATENCY_MS}"]
    read_end, write_end = os.pipe()
    with os.fdopen(read_end, "rb", buffering=0) as reading:
        with contextlib.ExitStack() as stack:
            with os.fdopen(write_end, "wb", buffering=0) as writing:
                stack.enter_context(child(command, server.environment, stdout=writing))
            recorded = Recording(reading, path)
            yield recorded
        recorded.wait_for_end()
