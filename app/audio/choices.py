"""The chosen output device and how it is opened, as the settings keep them."""

from __future__ import annotations

from typing import Literal

from app.shared.value import Value

Buffer = Literal["low", "medium", "high", 128, 256, 512, 1024, 2048]  # a latency, or a number of frames


class DeviceChoice(Value):
    """An output device by name and host API; its index changes when devices come and go."""

    name: str
    host_api: str


class SoundChoice(Value):
    """The settings that a device is opened with. `rate_hz`: 0 for the device's own rate."""

    rate_hz: Literal[0, 44_100, 48_000, 96_000] = 0
    buffer: Buffer = "medium"
