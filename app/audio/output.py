"""The output that takes the mixer's frames: a device, or, where there is none, a clock that drops them."""

from __future__ import annotations

import contextlib
import math
import threading
import time

from app.audio.devices import AudioDevice, close_device, open_device
from app.audio.problems import refused
from app.shared.thread_priority import native_threads, put_first
from engine.voices.mixer import Mixer
from engine.voices.voice import possible_s

STALLED_AFTER_S = 2.5  # without a call: longer than any start of a sound server that was seen
LOST_AFTER_S = 6.0  # a stall of this length does not end: the device was unplugged, or its driver hangs
CLOCK_FRAMES = 512  # taken at a time
LONGEST_LAG_S = 0.1  # further behind than this, the clock skips what it has missed


class Output:
    """An output that takes the mixer's frames.

    Attributes:
        device: None for the clock.
        rate_hz: at which frames are taken.
        latency_s: the length of the output's buffer, as reported when it was opened; as asked for, if that cannot be.
    """

    device: AudioDevice | None = None
    rate_hz: int
    latency_s = 0.0

    def now_s(self) -> float:
        """The output's time in seconds, on the clock of the times at which voices began; 0: not known."""
        return 0.0

    def load(self) -> float:
        """The share of the output's time that the mixer takes, 0 … 1."""
        return 0.0

    def stalled(self) -> bool:
        """Return True if it has taken no frames for a while, and may recover."""
        return False

    def lost(self) -> bool:
        """Return True if it has gone and must be opened again."""
        return False

    def close(self) -> None:
        """Take no more frames."""


class DeviceOutput(Output):
    """A device that plays, at its own rate.

    Raises:
        AudioProblem: it cannot be opened or started.
    """

    def __init__(self, device: AudioDevice, buffer_s: float, mixer: Mixer) -> None:
        self.device = device
        self.rate_hz = device.default_rate_hz
        self._mixer = mixer
        self._closing = threading.Lock()  # held while the stream's time is read, and while `_closed` is set
        self._closed = False
        threads = native_threads()  # those that come with the stream are the device's
        self._stream = open_device(device, buffer_s, mixer)
        self.latency_s = possible_s(self._stream.latency) or buffer_s
        self._calls, self._called_s = mixer.calls, time.monotonic()  # the device's calls, and when one was last seen
        try:
            self._stream.start()
        except Exception as error:
            self.close()
            raise refused(error, device.name, self.rate_hz) from error
        self.real_time = put_first(native_threads() - threads)  # whether the system has granted it

    def now_s(self) -> float:
        with self._closing:  # called from any thread: PortAudio must not be given a stream that was freed
            if self._closed:
                raise RuntimeError("the output has been closed")
            now_s = float(self._stream.time)
        return now_s if math.isfinite(now_s) else 0.0

    def load(self) -> float:
        load = float(self._stream.cpu_load)
        return max(load, 0.0) if math.isfinite(load) else 0.0

    def stalled(self) -> bool:
        return self._silent_s() > STALLED_AFTER_S

    def lost(self) -> bool:
        try:
            active = self._stream.active
        except Exception:  # PortAudio has closed the stream by itself
            active = False
        return not active or self._silent_s() > LOST_AFTER_S

    def close(self) -> None:
        with self._closing:
            self._closed = True
        close_device(self._stream)

    def _silent_s(self) -> float:
        """Seconds since the device last called the mixer, as far as this was polled; from one thread only."""
        now_s, calls = time.monotonic(), self._mixer.calls
        if calls != self._calls:
            self._calls, self._called_s = calls, now_s
        return now_s - self._called_s


class ClockOutput(Output):
    """An output that drops its frames in real time, so that pictures move without a device."""

    def __init__(self, mixer: Mixer) -> None:
        self.rate_hz = mixer.rate_hz
        self._mixer = mixer
        self._closing = threading.Event()  # set: the thread is to end
        self._thread = threading.Thread(target=self._run, name="sound-clock", daemon=True)
        self._thread.start()

    def now_s(self) -> float:
        return self._mixer.seconds

    def close(self) -> None:
        self._closing.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(2)

    def _run(self) -> None:
        """Take CLOCK_FRAMES from the mixer at the pace of real time and drop them; the clock's thread."""
        next_s, block_s = time.monotonic(), CLOCK_FRAMES / self.rate_hz
        while not self._closing.wait(max(0.0, next_s - time.monotonic())):
            with contextlib.suppress(MemoryError):
                self._mixer.render(CLOCK_FRAMES)
            next_s = max(next_s + block_s, time.monotonic() - LONGEST_LAG_S)
