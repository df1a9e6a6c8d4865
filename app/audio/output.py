"""Where the player's blocks go: what an output is, and which one is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.audio.devices import AudioDevice, default_device, find
from app.audio.stream import BUFFER_S


class Output(Protocol):
    """Where blocks go: an `OutputStream` or a `SilentOutput`."""

    @property
    def device(self) -> AudioDevice | None: ...
    @property
    def rate_hz(self) -> int: ...
    @property
    def block_frames(self) -> int: ...
    @property
    def latency_s(self) -> float: ...
    @property
    def underruns(self) -> int: ...
    @property
    def frames_written(self) -> int: ...
    @property
    def frames_queued(self) -> int: ...
    @property
    def prompt_blocks(self) -> int: ...
    @property
    def queued_blocks(self) -> int: ...
    @property
    def changeable_blocks(self) -> int: ...
    @property
    def mendable_blocks(self) -> int: ...
    @property
    def replaced_blocks(self) -> int: ...
    def wait_for_space(self, timeout_s: float, ahead: bool = False) -> bool: ...
    def stop_waiting(self) -> None: ...
    def write(self, block: NDArray[np.float32]) -> None: ...
    def replace(self, count: int, blocks: Sequence[NDArray[np.float32]] = ()) -> bool: ...
    def stalled(self) -> bool: ...
    def lost(self) -> bool: ...
    def close(self) -> None: ...


@dataclass(frozen=True)
class Wanted:
    """An output as it was asked for; see `Player.open`."""

    device: AudioDevice | None = None
    buffer_s: float = BUFFER_S
    rate_hz: int = 0
    buffer_frames: int = 0

    def at_its_rate(self, found: AudioDevice) -> AudioDevice:
        return replace(found, default_rate_hz=self.rate_hz) if self.rate_hz else found

    def buffer_s_at(self, rate_hz: int) -> float:
        return self.buffer_frames / rate_hz if self.buffer_frames else self.buffer_s


def same_device(one: AudioDevice, other: AudioDevice) -> bool:
    return (one.name, one.host_api) == (other.name, other.host_api)


def look_up(device: AudioDevice | None, rescan: bool) -> AudioDevice:
    """The device as it is now, or, for None, the system's default."""
    return default_device(rescan) if device is None else find(device.name, device.host_api, rescan)
