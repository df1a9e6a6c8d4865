"""A sound device made of nothing that keeps time as a real one does: it asks for a block every block duration."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from app.audio import AudioDevice, AudioProblem, Player
from app.audio.devices import Callback
from app.audio.stream import BLOCK_FRAMES, OutputStream

RATE_HZ = 48_000


class PretendedStream:
    """The part of `sounddevice.OutputStream` that the app uses; a thread stands for the driver's.

    Attributes:
        sounded_s: when the callback first gave a sample that is not zero (`time.perf_counter`), since `listen_anew`.
        gap_s: of silence between then and the last such sample, of whole blocks.
        late: how often a callback came more than a block late: the interpreter was busy, or the machine.
    """

    latency = 0.0  # there is no buffer behind this one

    def __init__(self, rate_hz: int, block_frames: int, callback: Callback) -> None:
        self.active = False
        self.sounded_s: float | None = None
        self.gap_s = 0.0
        self.late = 0
        self._rate_hz = rate_hz
        self._block = np.zeros((block_frames, 2), np.float32)
        self._callback = callback
        self._thread = threading.Thread(target=self._run, name="pretended-device", daemon=True)

    def listen_anew(self) -> None:
        self.sounded_s, self.gap_s = None, 0.0

    def start(self) -> None:
        self.active = True
        self._thread.start()

    def abort(self) -> None:
        self.active = False

    def close(self) -> None:
        self.active = False
        if self._thread.ident is not None:
            self._thread.join(5)

    def _run(self) -> None:
        block_s = len(self._block) / self._rate_hz
        due_s, silent_s = time.perf_counter(), 0.0
        while self.active:
            asked_s = time.perf_counter()
            self._callback(self._block, len(self._block), None, None)
            if not self._block.any():
                silent_s += block_s
            else:
                if self.sounded_s is None:
                    self.sounded_s = asked_s
                else:
                    self.gap_s += silent_s
                silent_s = 0.0
            due_s += block_s
            wait_s = due_s - time.perf_counter()
            if wait_s > 0:
                time.sleep(wait_s)
            elif wait_s < -block_s:  # a driver does not race to catch up: what was due is lost
                self.late += 1
                due_s = time.perf_counter()


class PretendedCard:
    """Lets a player find and open such a device. `stream` and `output` are the present ones."""

    def __init__(self, block_frames: int = BLOCK_FRAMES) -> None:
        self._block_frames = block_frames
        self._device = AudioDevice("Pretended device", "none", RATE_HZ)
        self.stream: PretendedStream | None = None
        self.output: OutputStream | None = None

    def player(self, on_problem: Callable[[AudioProblem], None]) -> Player:
        return Player(on_problem, look_up=lambda device, rescan: self._device, open_output=self._open)

    def _open(self, device: AudioDevice, buffer_s: float) -> OutputStream:
        self.output = OutputStream(device, buffer_s, self._block_frames, self._open_stream)
        return self.output

    def _open_stream(
        self, device: AudioDevice, buffer_s: float, block_frames: int, callback: Callback
    ) -> PretendedStream:
        self.stream = PretendedStream(device.default_rate_hz, block_frames, callback)
        return self.stream
