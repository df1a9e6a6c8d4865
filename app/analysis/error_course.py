"""The error of a pluck over time, in windows of a few periods."""

from __future__ import annotations

from app.analysis.growing import BLOCK_FRAMES
from app.rendering import SOURCES, Take
from app.rendering.blow import WINDOW_PERIODS
from engine.compare.relative import ErrorWindows


class ErrorCourse(ErrorWindows):
    """The errors of a take over all its grid points, without the initial picture. A `Growing`."""

    def __init__(self, take: Take) -> None:
        super().__init__(take.frames - 1, WINDOW_PERIODS / take.fundamental_hz, take.picture_hz)
        self.take, self._next = take, 1

    def advance(self) -> bool:
        frames = slice(self._next, min(self._next + BLOCK_FRAMES, self.take.ready_frames))
        if frames.stop <= frames.start:
            return False
        model, truth = (self.take.motion_m(name)[frames] for name in SOURCES)
        self.add(model, truth)
        self._next = frames.stop
        return True
