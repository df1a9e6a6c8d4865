"""Which moment of the motion a picture shows: slow motion by stroboscope, and the blur of real time.

The sound is never slowed, and there is one playhead. A stroboscope keeps both: each flash shows the string near
the playhead, at a phase of its period that moves on slowly.
"""

from __future__ import annotations

import math

import numpy as np

from app.rendering.take import SOURCES, Take
from app.views.string_view import StringFrame

BLUR_S = 1 / 60  # an eye's or a picture's exposure
MM = np.float32(1000)


class Strobe:
    """The phase at which the string is seen, in periods of its fundamental."""

    def __init__(self) -> None:
        self._periods = 0.0
        self._real_time = False

    def restart(self) -> None:
        self._periods = 0.0

    def advance(self, elapsed_s: float, speed: float, fundamental_hz: float) -> None:
        """Moves the phase on by `speed` (1 is real time) over `elapsed_s` of the watcher's time."""
        self._real_time = speed >= 1
        self._periods = (self._periods + elapsed_s * speed * fundamental_hz) % 1.0

    def time_s(self, position_s: float, fundamental_hz: float) -> float:
        """The moment to show: within one period before the playhead; in real time the playhead itself."""
        if self._real_time:
            return position_s
        whole = math.floor(position_s * fundamental_hz)
        return (whole + self._periods) / fundamental_hz


def frame_at(take: Take, position_s: float, shown_s: float, speed: float) -> StringFrame:
    """The picture of a take: the shapes at `shown_s`, blurred over the exposure before the playhead."""
    rate_hz = take.info.rate_hz
    last = min(max(math.ceil(position_s * rate_hz), 1), max(take.ready_frames, 1))
    first = max(0, last - math.ceil(BLUR_S * rate_hz))
    shapes, lowest, highest = {}, {}, {}
    for name in SOURCES:
        motion = take.motion_m(name)[first:last]
        shapes[name] = take.shape_m(name, shown_s) * MM
        lowest[name] = motion.min(axis=0) * MM
        highest[name] = motion.max(axis=0) * MM
    caption = f"{position_s:.3f} s" + ("" if speed >= 1 else f"   slow motion × {speed:.3f}")
    return StringFrame(shapes, lowest, highest, caption, position_s > take.info.horizon_s)
