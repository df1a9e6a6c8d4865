"""A sound device made of nothing: the tests call its callback themselves."""

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.audio.devices import AudioDevice, Callback

HEADPHONES = AudioDevice("Headphones", "Test API", 48_000)


class FakeRawStream:
    """What `sounddevice.OutputStream` would be; `tick` is one call of the device."""

    def __init__(self, device: AudioDevice, block_frames: int, callback: Callback) -> None:
        self.shape = (block_frames, min(device.channels, 2))
        self.callback = callback
        self.active = False
        self.latency = 0.02
        self.status: Any = None
        self.calls: list[str] = []
        self.refusal: Exception | None = None

    def start(self) -> None:
        self.calls.append("start")
        if self.refusal is not None:
            raise self.refusal
        self.active = True

    def abort(self) -> None:
        self.calls.append("abort")
        self.active = False

    def close(self) -> None:
        self.calls.append("close")

    def tick(self) -> np.ndarray:
        out = np.full(self.shape, np.nan, np.float32)
        self.callback(out, len(out), None, self.status)
        return out


@pytest.fixture
def headphones() -> AudioDevice:
    return HEADPHONES


@pytest.fixture
def raw_streams() -> list[FakeRawStream]:
    """The streams that `open_fake` has made, in order."""
    return []


@pytest.fixture
def open_fake(raw_streams: list[FakeRawStream]) -> Any:
    """Takes the place of `app.audio.devices.open_device`."""

    def open_device(device: AudioDevice, buffer_s: float, block_frames: int, callback: Callback) -> FakeRawStream:
        raw_streams.append(FakeRawStream(device, block_frames, callback))
        return raw_streams[-1]

    return open_device


@pytest.fixture(autouse=True)
def no_thread_stays() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) <= before
