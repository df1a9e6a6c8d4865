"""The string at the playhead: its shape in slow motion, its motion's blur, and the range of the last second."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.analysis.heard import HeardMotion
from app.rendering import Take

BLUR_S = 1 / 60  # exposure of the blur: one picture of the screen
ENVELOPE_S = 1.0  # the time before the playhead whose range of motion is shown
ENVELOPE_BLOCK_S = 0.1  # the range is kept for each block of this length
MM = np.float32(1000)


Band = tuple[NDArray[np.float32], NDArray[np.float32]]  # lowest and highest displacement, (points,) each


@dataclass(frozen=True)
class StringFrame:
    """The string at one moment; displacements (points,) in mm.

    Attributes:
        shapes: by source.
        blurs: by source, the extremes within `BLUR_S`: the blur of the motion in real time.
        caption: as of `caption_of`.
        envelopes: by source, the extremes within `ENVELOPE_S`; empty where they are not shown.
    """

    shapes: dict[str, NDArray[np.float32]]
    blurs: Mapping[str, Band]
    caption: str = ""
    envelopes: Mapping[str, Band] = field(default_factory=dict)

    def largest_mm(self, with_envelopes: bool = False) -> float:
        """The largest displacement, in mm, of the motion; 0 where nothing is drawn yet."""
        bands = [*self.blurs.values(), *(self.envelopes.values() if with_envelopes else ())]
        return max((float(np.abs(edge).max()) for band in bands for edge in band), default=0.0)


class Envelope:
    """The range of motion within the last second of a take, kept by blocks: each frame is read only once."""

    def __init__(self) -> None:
        self._ranges: dict[str, _Range] = {}  # by source
        self._bands: dict[str, Band] = {}  # by source, as `before` returned them last

    def before(self, position_s: float, motions: Iterable[HeardMotion]) -> dict[str, Band]:
        """Lowest and highest displacement (points,) in mm by source, over the whole blocks before the playhead.

        The same object as at the last call where nothing has changed since.
        """
        bands = {}
        for motion in motions:
            known = self._ranges.get(motion.source)
            if known is None or known.motion != motion:
                known = self._ranges[motion.source] = _Range(motion)
            if band := known.before(position_s):
                bands[motion.source] = band
        if bands.keys() != self._bands.keys() or any(bands[name] is not self._bands[name] for name in bands):
            self._bands = bands
        return self._bands


class _Range:
    """The range of motion of one source."""

    def __init__(self, motion: HeardMotion) -> None:
        self.motion = motion
        self._block = math.ceil(ENVELOPE_BLOCK_S * motion.rate_hz)  # frames
        blocks, points = motion.frames // self._block + 1, motion.grid_points
        self._lowest_mm = np.zeros((blocks, points), np.float32)
        self._highest_mm = np.zeros((blocks, points), np.float32)
        self._known = np.zeros(blocks, bool)  # blocks whose range has been computed
        self._blocks_shown = (0, 0)  # first and stop of those that `_band` is of
        self._band: Band | None = None  # as `before` returned it last; None: not yet

    def before(self, position_s: float) -> Band | None:
        """Lowest and highest displacement (points,) in mm of the second before a time; None: no block is whole."""
        last = min(int(position_s * self.motion.rate_hz), self.motion.ready) // self._block
        first = max(0, last - round(ENVELOPE_S / ENVELOPE_BLOCK_S))
        if last == first:
            return None
        if (first, last) != self._blocks_shown:
            for block in np.flatnonzero(~self._known[first:last]) + first:
                self._look_at(int(block))
            self._band = self._lowest_mm[first:last].min(axis=0), self._highest_mm[first:last].max(axis=0)
            self._blocks_shown = first, last
        return self._band

    def _look_at(self, block: int) -> None:
        """Read the frames of a block, by its number, and keep their range in mm."""
        frames = self.motion.read_all(block * self._block, (block + 1) * self._block)
        self._lowest_mm[block] = frames.min(axis=0) * MM
        self._highest_mm[block] = frames.max(axis=0) * MM
        self._known[block] = True


def frame_at(
    take: Take, motions: Iterable[HeardMotion], position_s: float, speed: float, envelope: Envelope | None = None
) -> StringFrame:
    """The string of each motion at the playhead, as slow motion shows it, with its blur.

    Args:
        motions: the sources that are shown; those of which nothing is rendered yet are left out.
        position_s: the playhead.
        envelope: gives the range of the last second too; None: without.
        speed: of slow motion; 1 is real time.
    """
    rendered = [motion for motion in motions if motion.there]
    shapes, blurs = {}, {}
    for motion in rendered:
        last = min(max(math.ceil(position_s * motion.rate_hz), 1), motion.ready)
        frames = motion.read_all(max(0, last - math.ceil(BLUR_S * motion.rate_hz)), last)
        shapes[motion.source] = motion.shape(position_s) * MM
        blurs[motion.source] = frames.min(axis=0) * MM, frames.max(axis=0) * MM
    envelopes = envelope.before(position_s, rendered) if envelope else {}
    caption = caption_of(position_s, speed, take.horizon_s)
    return StringFrame(shapes, blurs, caption, envelopes)


def caption_of(position_s: float, speed: float, horizon_s: float) -> str:
    """The time, the speed of slow motion, and that the training ended before."""
    slow = "" if speed >= 1 else f"   slow motion × {speed:.3f}"
    return f"{position_s:.3f} s{slow}{'   past training' if position_s > horizon_s else ''}"
