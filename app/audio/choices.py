"""Which device is used, and how it is opened."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

Buffer = Literal["low", "medium", "high", 128, 256, 512, 1024, 2048]  # a latency, or frames


class DeviceChoice(BaseModel):
    """An output device by name and host API, never by index: indices drift."""

    model_config = ConfigDict(extra="forbid")

    name: str
    host_api: str


class SoundChoice(BaseModel):
    """How a device is opened. rate_hz 0: at its own rate."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rate_hz: Literal[0, 44_100, 48_000, 96_000] = 0
    buffer: Buffer = "medium"
