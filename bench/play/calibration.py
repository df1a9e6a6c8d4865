"""The share of the latency that is the sound server's and the recorder's, measured with clicks of known times.

A program's latency is given twice: until its sound is in the recording, and less the time that the device's buffer
and the way to the recorder take. That time is found from outside the program: the server reports how much sound it
has buffered, and clicks at several buffer lengths tell how long a sound then takes into the recording.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.play.analysis import FAINTEST_PLUCK
from bench.play.children import child
from bench.play.recording import Recording
from bench.play.sound_server import RATE_HZ, SoundServer

LATENCIES_S = (0.01, 0.02, 0.05, 0.1, 0.2)  # requested of the device
CLICKS = 8
LOOK_S = 0.03
LEAST = 0.1  # quantile of what the server has buffered: programs hand over sound when that is least
PATIENCE_S = 20.0
BLOCK_FRAMES = 256
FIRST_S = 0.5
EVERY_S = 0.107  # no multiple of a block


@dataclass(frozen=True)
class Handed:
    """Clicks at one buffer length: when they were handed over, and how much the server had buffered, in s."""

    times_s: tuple[float, ...]
    held_s: float


@dataclass
class Holding:
    """The sound of a client that the server has buffered, in s, sampled repeatedly."""

    looks_s: list[float] = field(default_factory=list)

    def look(self, server: SoundServer) -> None:
        held_s = server.buffered_s()
        if held_s is not None:
            self.looks_s.append(held_s)

    @property
    def held_s(self) -> float | None:
        return float(np.quantile(self.looks_s, LEAST)) if self.looks_s else None


@dataclass(frozen=True)
class Transit:
    """The time from a program's handing over of sound until it is in the recording, by what the server has buffered.

    `spread_s`: nine of ten clicks deviate by no more from the median of their buffer length.
    """

    held_s: tuple[float, ...]
    transit_s: tuple[float, ...]
    spread_s: float

    def at(self, held_s: float) -> float:
        return float(np.interp(held_s, self.held_s, self.transit_s))


def click_through(server: SoundServer) -> list[Handed]:
    """Play clicks at several buffers, one after the other, while nothing else plays.

    Raises:
        RuntimeError: PortAudio does not play into the server.
    """
    found = []
    for latency_s in LATENCIES_S:
        command = [sys.executable, "-m", "bench.play.calibration", str(latency_s)]
        holding = Holding()
        with child(command, server.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            deadline_s = time.monotonic() + PATIENCE_S
            while process.poll() is None and time.monotonic() < deadline_s:
                holding.look(server)
                time.sleep(LOOK_S)
            assert process.stdout is not None and process.stderr is not None
            if process.poll() != 0 or holding.held_s is None:
                said = process.stderr.read().decode(errors="replace").strip().splitlines()[-1:]
                raise RuntimeError(f"PortAudio does not play into PulseAudio ({said}); install libasound2-plugins")
            found.append(Handed(tuple(json.loads(process.stdout.read())), holding.held_s))
            process.stderr.close()
    return found


def transit(clicks: Sequence[Handed], recorded: Recording) -> Transit:
    """The transit time of clicks, from the recording of them all."""
    clock = recorded.clock()
    sound = np.abs(recorded.sound()[:, 0])
    held_s, transit_s, apart_s = [], [], [0.0]
    for handed in clicks:
        ways_s = []
        for time_s in handed.times_s:
            start = clock.frame(time_s)
            heard = sound[start : start + RATE_HZ // 2] > FAINTEST_PLUCK
            if heard.any():
                ways_s.append(clock.time_s(start + int(np.argmax(heard))) - time_s)
        if ways_s:
            held_s.append(handed.held_s)
            transit_s.append(float(np.median(ways_s)))
            apart_s.extend(np.abs(np.array(ways_s) - transit_s[-1]))
    order = np.argsort(held_s)
    return Transit(
        tuple(np.array(held_s)[order]), tuple(np.array(transit_s)[order]), float(np.quantile(apart_s, 0.9))
    )


def main(latency_s: float) -> None:
    """Play clicks through PortAudio and print the times (`time.monotonic`) at which the device was handed each."""
    import sounddevice

    times_s: list[float] = []
    started_s = time.monotonic()

    def callback(out: Any, frames: int, _times: Any, _status: Any) -> None:
        now_s = time.monotonic()
        out[:] = bytes(len(out))
        if len(times_s) < CLICKS and now_s > started_s + FIRST_S + EVERY_S * len(times_s):
            memoryview(out).cast("B").cast("f")[0] = 0.5  # the first frame's left sample
            times_s.append(now_s)

    with sounddevice.RawOutputStream(
        RATE_HZ, BLOCK_FRAMES, channels=2, dtype="float32", latency=latency_s, callback=callback
    ):
        time.sleep(FIRST_S + EVERY_S * (CLICKS + 2))
    print(json.dumps(times_s))


if __name__ == "__main__":
    main(float(sys.argv[1]))
