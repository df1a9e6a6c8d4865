"""Which moment of the motion a picture shows: slow motion by stroboscope, and the blur of real time.

The sound is never slowed, and there is one playhead. A stroboscope keeps both: each flash shows the string near
the playhead, at a phase of its period that moves on slowly.
"""

from __future__ import annotations

import math

import numpy as np

from app.rendering.take import SOURCES, Take
from app.views.string_ink import Band, StringFrame

BLUR_S = 1 / 60  # an eye's or a picture's exposure
ENVELOPE_S = 1.0  # the time before the playhead whose range of motion is shown
ENVELOPE_BLOCK_S = 0.05
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


class Envelope:
    """The range of motion within the last second of a take, kept block by block: each frame is looked at once."""

    def __init__(self, take: Take) -> None:
        self._take = take
        self._block = math.ceil(ENVELOPE_BLOCK_S * take.info.rate_hz)
        blocks, points = take.frames // self._block + 1, take.info.grid_points
        self._lowest_mm = {name: np.zeros((blocks, points), np.float32) for name in SOURCES}
        self._highest_mm = {name: np.zeros((blocks, points), np.float32) for name in SOURCES}
        self._known = np.zeros(blocks, bool)
        self._shown: tuple[tuple[int, int], dict[str, Band]] = ((0, 0), {})

    def before(self, position_s: float) -> dict[str, Band]:
        """Lowest and highest displacement (points,) in mm by source, in whole blocks up to the playhead.

        The same object as the last time, where nothing has changed since.
        """
        rate_hz = self._take.info.rate_hz
        last = min(int(position_s * rate_hz), self._take.ready_frames) // self._block
        first = max(0, last - round(ENVELOPE_S / ENVELOPE_BLOCK_S))
        if (first, last) != self._shown[0]:
            for block in np.flatnonzero(~self._known[first:last]) + first:
                self._look_at(int(block))
            bands = {
                name: (self._lowest_mm[name][first:last].min(axis=0), self._highest_mm[name][first:last].max(axis=0))
                for name in SOURCES
                if first < last
            }
            self._shown = (first, last), bands
        return self._shown[1]

    def _look_at(self, block: int) -> None:
        frames = slice(block * self._block, (block + 1) * self._block)
        for name in SOURCES:
            motion = self._take.motion_m(name)[frames]
            self._lowest_mm[name][block] = motion.min(axis=0) * MM
            self._highest_mm[name][block] = motion.max(axis=0) * MM
        self._known[block] = True


def frame_at(
    take: Take, position_s: float, shown_s: float, speed: float, envelope: Envelope | None = None
) -> StringFrame:
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
    envelopes = envelope.before(position_s) if envelope else {}
    return StringFrame(shapes, lowest, highest, caption, position_s > take.info.horizon_s, envelopes)
