"""The chosen output device and how it is opened, as the settings keep them."""

from __future__ import annotations

from typing import Literal

from app.shared.value import Value

Buffer = Literal["low", "medium", "high", 128, 256, 512, 1024, 2048]  # a latency, or a number of frames
LATENCY_S = {"low": 0.006, "medium": 0.012, "high": 0.04}


class DeviceChoice(Value):
    """An output device by name and host API; its index changes when devices come and go."""

    name: str
    host_api: str


class SoundChoice(Value):
    """The settings that a device is opened with. `rate_hz`: 0 for the device's own rate.

    A longer buffer is safer, a shorter one has less latency.
    """

    rate_hz: Literal[0, 44_100, 48_000, 96_000] = 0
    buffer: Buffer = "medium"

    def buffer_s(self, rate_hz: int) -> float:
        """The length of the device's buffer, which is nearly all that sound waits for."""
        return LATENCY_S[self.buffer] if isinstance(self.buffer, str) else self.buffer / rate_hz
