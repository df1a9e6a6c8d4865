"""What the player says of itself."""

from __future__ import annotations

from dataclasses import dataclass

from app.audio.devices import AudioDevice
from app.audio.mixer import METER_FLOOR_DB

DEFAULT_RATE_HZ = 48_000  # until a device says otherwise


@dataclass(frozen=True)
class PlayerStatus:
    """A snapshot of the player, some 10 ms old at most."""

    position_s: float = 0.0  # of what is heard now: written to the device, less its latency
    playing: bool = False  # as rendered: the last of it is heard a queue and `latency_s` later
    waiting: bool = False  # playing, but rendering has not arrived at the playhead
    ringing: int = 0  # earlier plucks that still sound
    source: str | None = None
    peak_db: float = METER_FLOOR_DB  # dBFS, after volume and limiter
    gain_reduction_db: float = 0.0
    limiting: bool = False  # the safety limiter changes what is heard
    non_finite: bool = False  # samples of the loaded track were replaced by silence
    underruns: int = 0  # of the present device
    device: AudioDevice | None = None  # None: silent
    rate_hz: int = DEFAULT_RATE_HZ  # of the tracks; opening a device may change it and unload the track
    latency_s: float = 0.0
    changes_done: int = 0  # how many calls of `open` have been obeyed, or refused
    problem: str | None = None  # why there is no sound, or why the last device could not be opened
