"""Plays clicks through PortAudio, as a process of its own, and prints when each was handed to the device."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import sounddevice

BLOCK_FRAMES = 256
FIRST_S = 0.5
EVERY_S = 0.107  # no multiple of a block


def main(rate_hz: int, latency_s: float, count: int) -> None:
    """`latency_s`: requested of the device. Times are those of the callback, by `time.monotonic`."""
    times_s: list[float] = []
    started_s = time.monotonic()

    def callback(out: Any, frames: int, _times: Any, _status: Any) -> None:
        now_s = time.monotonic()
        out[:] = bytes(len(out))
        if len(times_s) < count and now_s > started_s + FIRST_S + EVERY_S * len(times_s):
            memoryview(out).cast("B").cast("f")[0] = 0.5  # the first frame's left sample
            times_s.append(now_s)

    with sounddevice.RawOutputStream(
        rate_hz, BLOCK_FRAMES, channels=2, dtype="float32", latency=latency_s, callback=callback
    ):
        time.sleep(FIRST_S + EVERY_S * (count + 2))
    print(json.dumps(times_s))


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]))
