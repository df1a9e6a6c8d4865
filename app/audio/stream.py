"""An open sound device behind a bounded queue of ready blocks.

Two threads meet here. The device's callback copies one ready block per call, or zeros if there is none, and
does nothing else. The feeder renders the next block whenever the queue has room.

The queue is prompt and patient at once. A command must be heard soon, so that only a few blocks may lie before it;
yet Python, or the computer, is busy elsewhere for a tenth of a second now and then. So the feeder goes on far beyond
those few blocks as long as nothing can change them but a command; and for a command it replaces them. The old ones
stay until the new ones are ready: nobody hears how long that takes.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.audio.devices import AudioDevice, Callback, RawStream, open_device
from app.audio.pieces import pieces
from app.audio.problems import refused

BLOCK_FRAMES = 256
SHORTEST_BLOCK = 64
BUFFER_S = 0.025  # of ready sound that a command waits for
AHEAD_S = 0.25  # and of more, which it replaces: outlasts a busy moment of Python
SOON_S = 0.05  # of that in any case: right after a command, and where rendering may still change it
REPLACED_S = 0.02  # of new sound that takes the old one's place in one go, where it is rendered
LEFT_S = 0.01  # to the device, while what lies behind is mended
STALLED_AFTER_S = 1.5  # without a callback
LOST_AFTER_S = 6.0  # a stall that is this long does not end: the device was unplugged, or its driver hangs
SETTLING_S = 0.1
START_GRACE_S = 3.0  # some sound servers let a new stream stand still for a second or two

OpenDevice = Callable[[AudioDevice, float, int, Callback], RawStream]


class OutputStream:
    """A device that plays, at its own rate, what is written block by block.

    Preallocated buffers travel in a circle: free → (write) → ready → (callback) → free. So the queue is bounded
    by construction, and the callback neither allocates nor waits.

    Args:
        device: Where to play.
        buffer_s: Sound that is always kept ready in the queue, and at least as much in the device's own buffer.
        block_frames: Frames per block, for the device as well as for `write`; fewer where the buffer is short.
        open_device: Makes the raw stream; tests put another one in.

    Raises:
        AudioUnavailable: If the device cannot be opened or started.
    """

    def __init__(
        self,
        device: AudioDevice,
        buffer_s: float = BUFFER_S,
        block_frames: int = BLOCK_FRAMES,
        open_device: OpenDevice = open_device,
    ) -> None:
        self.device: AudioDevice | None = device
        self.rate_hz = device.default_rate_hz
        self.block_frames = block_frames = min(block_frames, max(SHORTEST_BLOCK, round(buffer_s * self.rate_hz) // 2))
        self.callback_count = 0
        self.frames_written = 0  # by the callback to the device, without the zeros of underruns
        self.underruns = 0  # blocks that came too late, and gaps that the device itself has noticed
        self.frames_queued = 0  # by `write`
        self._free: deque[NDArray[np.float32]] = deque()
        self._ready: deque[NDArray[np.float32]] = deque()
        self._taken: SimpleQueue[None] = SimpleQueue()  # a token for each block that the device has asked for
        self._replaced_at = 0  # the callback_count then
        self._raw = open_device(device, buffer_s, block_frames, self._callback)
        self.latency_s = float(self._raw.latency)
        # A device that starts fills its own buffer, some twice, faster than the queue follows: inaudibly.
        self._settled_count = math.ceil((self.latency_s + SETTLING_S) * self.rate_hz / block_frames)
        # Devices with a long buffer ask for many blocks at a time; half of that buffer is a safe guess.
        blocks = max(2, int(max(buffer_s, self.latency_s / 2) * self.rate_hz / block_frames))
        self.prompt_blocks = blocks  # always kept ready; a command is heard after them
        # no more than what is kept ready meanwhile: the device must not be there first
        self.replaced_blocks = min(math.ceil(REPLACED_S * self.rate_hz / block_frames), blocks - 1)
        self._soon_blocks = blocks + math.ceil(SOON_S * self.rate_hz / block_frames)
        self._most_blocks = blocks + math.ceil(AHEAD_S * self.rate_hz / block_frames)
        for _ in range(self._most_blocks + self.replaced_blocks + 1):  # one is with the callback
            self._free.append(np.zeros((block_frames, min(device.channels, 2)), np.float32))
        for _ in range(blocks):  # the queue starts full, of silence
            self._ready.append(self._free.pop())
            self.frames_queued += block_frames
        self._alive = _Heartbeat(grace_s=START_GRACE_S)
        try:
            self._raw.start()
        except Exception as error:
            self.close()
            raise refused(error, device.name, self.rate_hz) from error

    @property
    def queued_blocks(self) -> int:
        """Written, and not yet taken by the device."""
        return len(self._ready)

    def wait_for_space(self, timeout_s: float, ahead: bool = False) -> bool:
        """Waits for the device to take a block, if there is no space; returns whether one can be written.

        Args:
            ahead: Up to `AHEAD_S` beyond what is always kept ready, otherwise up to `SOON_S`. What is beyond that
                opens with every block that is played since `replace`, so that the feeder catches up at twice the
                pace of the sound and a knob that is turned costs little.
        """
        if not self._has_space(ahead):
            with contextlib.suppress(Empty):
                self._taken.get(timeout=timeout_s)
        return self._has_space(ahead)

    def stop_waiting(self) -> None:
        """Ends a `wait_for_space`, or the next one, before there is space. From any thread."""
        self._taken.put(None)

    def write(self, block: NDArray[np.float32]) -> None:
        """Queues one block, shape (block_frames, 2), after `wait_for_space` has returned True."""
        if not self._free:
            raise RuntimeError("The queue is full: wait_for_space comes first.")
        self._ready.append(self._filled(block))
        self.frames_queued += self.block_frames

    @property
    def changeable_blocks(self) -> int:
        """The last so many may be replaced: enough is ready before them, so that there is time for it."""
        return max(0, len(self._ready) - max(1, self.prompt_blocks - 1))

    @property
    def mendable_blocks(self) -> int:
        """The last so many may be mixed anew as a whole: the queue is as long as before, whenever that is ready.

        No more than there are buffers for beside those in the queue.
        """
        left = max(2, math.ceil(LEFT_S * self.rate_hz / self.block_frames))
        return max(0, min(len(self._ready) - left, len(self._free)))

    def replace(self, count: int, blocks: Sequence[NDArray[np.float32]] = ()) -> bool:
        """Puts `blocks`, at most `replaced_blocks` or `count`, in the place of the last `count` of the queue.

        Returns:
            Whether the device had not come so far yet. Otherwise the queue is as it was.
        """
        buffers = [self._filled(block) for block in blocks]
        if len(self._ready) <= count:  # one more: it may be taken just now
            self._free.extend(buffers)
            return False
        for _ in range(count):
            self._free.append(self._ready.pop())
        self._ready.extend(buffers)
        self.frames_queued += (len(buffers) - count) * self.block_frames
        self._replaced_at = self.callback_count
        return True

    def stalled(self) -> bool:
        """Whether the device takes nothing at the moment. To be asked again and again, by one thread."""
        return self._alive.silence_s(self.callback_count) > STALLED_AFTER_S

    def lost(self) -> bool:
        """Whether the device has gone: it calls back no more. To be asked as `stalled` is."""
        try:
            active = self._raw.active
        except Exception:  # PortAudio itself has already given up the stream
            active = False
        return not active or self._alive.silence_s(self.callback_count) > LOST_AFTER_S

    def close(self) -> None:
        """Stops at once and frees the device. Never from inside a callback, which could not end then."""
        with contextlib.suppress(Exception):  # nothing can be done about a device that cannot even stop
            self._raw.abort()
        with contextlib.suppress(Exception):
            self._raw.close()

    def _callback(self, outdata: NDArray[np.float32], frames: int, _time: Any, status: Any) -> None:
        self.callback_count += 1
        if status and status.output_underflow:
            self._count_underrun()
        try:
            block = self._ready.popleft()
        except IndexError:
            outdata.fill(0)
            self._count_underrun()
            self._taken.put(None)
            return
        if len(block) == len(outdata):  # always, unless a driver ignores the block size that it was given
            _copy(outdata, block)
            self.frames_written += frames
        else:
            outdata.fill(0)
            self._count_underrun()
        self._free.append(block)
        self._taken.put(None)

    def _filled(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        buffer = self._free.popleft()
        _copy(buffer, block[:, : buffer.shape[1]])
        return buffer

    def _has_space(self, ahead: bool) -> bool:
        earned = self.callback_count - self._replaced_at if ahead else 0
        return len(self._ready) < min(self._soon_blocks + earned, self._most_blocks)

    def _count_underrun(self) -> None:
        if self.callback_count > self._settled_count:
            self.underruns += 1


def _copy(into: NDArray[np.float32], block: NDArray[np.float32]) -> None:
    for piece in pieces(len(into)):
        into[piece] = block[piece]


class _Heartbeat:
    """Measures for how long a counter has stood still.

    A gap between two looks counts only a little, so that a computer which slept, or was too busy for either
    thread, is not taken for an unplugged device.
    """

    _LONGEST_STEP_S = 0.1

    def __init__(self, grace_s: float) -> None:
        self._count = 0
        self._looked_s = time.monotonic()
        self._grace_until_s = self._looked_s + grace_s
        self._silence_s = 0.0

    def silence_s(self, count: int) -> float:
        now_s = time.monotonic()
        self._silence_s += min(now_s - self._looked_s, self._LONGEST_STEP_S)
        self._looked_s = now_s
        if count != self._count or now_s < self._grace_until_s:
            self._count, self._silence_s = count, 0.0
        return self._silence_s
