"""A take: one pluck as pictures and signals, which grow while it is rendered.

Each source has a *motion*, the string as a series of pictures, and a *signal*, its sound at the present
listening points, sample by sample. One thread appends and any thread reads. Values are written first, then the count
of ready ones is raised; values below it never change.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.rendering.strobe import Flashes
from engine.compare.relative import ErrorSums, ErrorWindows
from engine.pluck import Pluck
from engine.presets import PresetInfo
from engine.sources import StringSource
from engine.values.ear import Ear

SOURCES = ("model", "truth")
WINDOW_PERIODS = 2.0  # of the fundamental, in which errors are measured: shorter windows would show its phase
_TINY = 1e-6  # of a frame: tolerance for rounding


class Motion(Protocol):
    """The motion of one source, growing at its end."""

    @property
    def ready_frames(self) -> int: ...


class FrameSeries:
    """Frames of one source, (frames, places), growing at their end.

    Attributes:
        rate_hz: frames per second; the first is at the release.
        places: values in a frame: grid points, or listening points.
        frames: when complete.
        ready_frames: so far.
    """

    def __init__(self, rate_hz: float, places: int, seconds: float) -> None:
        self.rate_hz, self.places = rate_hz, places
        self.frames = int(seconds * rate_hz + _TINY) + 1
        self.ready_frames = 0
        self._values = np.empty((self.frames, places), np.float32)

    @property
    def complete(self) -> bool:
        return self.ready_frames == self.frames

    def append(self, values: NDArray[np.float32]) -> None:
        """Append frames, (frames, places)."""
        start, stop = self.ready_frames, self.ready_frames + len(values)
        self._values[start:stop] = values
        self.ready_frames = stop

    def read(self, start: int = 0, stop: int | None = None) -> NDArray[np.float32]:
        """The frames start … stop - 1 that are ready."""
        ready = self.ready_frames
        return self._values[min(start, ready) : ready if stop is None else min(stop, ready)]


class Signal(FrameSeries):
    """The signal of a source at the listening points, in the unit of the pick-up, at the source's own rate."""

    rate_hz: int

    def end_in_silence(self) -> None:
        """Complete the signal with zeros."""
        self._values[self.ready_frames :] = 0.0
        self.ready_frames = self.frames


class Pictures(FrameSeries):
    """Pictures: the displacement of a source on its grid, in m.

    Attributes:
        flashes: the string at the times that slow motion shows; None: there are none.
    """

    flashes: Flashes | None = None

    def shape_m(self, position_s: float) -> NDArray[np.float32]:
        """The string (places,) that the strobe shows; the nearest picture where its flash is not ready."""
        flashes = self.flashes
        frame_m = None if flashes is None else flashes.shape_m(flashes.strobe.flash(position_s))
        if frame_m is None:
            nearest = min(max(round(position_s * self.rate_hz), 0), self.ready_frames - 1)
            frame_m = self.read(nearest, nearest + 1)[0]
        return frame_m


@dataclass(frozen=True, eq=False)
class Listened:
    """The signals of a take's sources for one choice of listening points and pick-up."""

    ear: Ear
    signals: dict[str, Signal] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Return True if the signals of model and truth are complete."""
        return all(name in self.signals and self.signals[name].complete for name in SOURCES)


class Sounding(ABC):
    """The motion and sound of a pluck or of a blow, which grow as they are rendered.

    Attributes:
        seconds: the duration.
        rate_hz: of the signals of model and truth.
        horizon_s: the end of the time that the model was trained for. Where it was trained on none, of the motion.
        listened: signals by source; replaced as a whole when the listening points change.
        partials_hz: the frequencies of the partials at rest, (modes,), rising.
        frames: of the motions of model and truth when complete, `frames_hz` a second.
        error_course: the model's errors over time, of all frames after the first that are ready.
        motions: by source.
        model_ends_s: the time of the last valid frame where the model's output ran away; it is at rest from then on.
    """

    seconds: float
    rate_hz: int
    horizon_s: float
    listened: Listened
    fundamental_hz: float
    partials_hz: NDArray[np.float64]
    frames: int
    frames_hz: float
    error_course: ErrorWindows
    motions: Mapping[str, Motion]
    model_ends_s: float | None = None

    @abstractmethod
    def measure(self) -> None:
        """Add the errors of new frames."""

    @property
    def ready_frames(self) -> int:
        """Frames that are ready of both model and truth."""
        return min(self.motions[name].ready_frames for name in SOURCES)

    @property
    def complete(self) -> bool:
        """Return True if all frames of model and truth are ready."""
        return self.ready_frames == self.frames

    @property
    def pickup(self) -> str:
        """The kind of pick-up, which gives the unit of the signals."""
        return self.listened.ear.pickup

    @property
    def full_scale(self) -> float:
        """The level of 0 dB, in the unit of the signals."""
        return self.listened.ear.full_scale

    @property
    def progress(self) -> tuple[object, ...]:
        """A value that changes whenever more of it is ready, or signals are replaced."""
        return self.ready_frames, self.listened, *(part.ready_frames for part in self.listened.signals.values())


class Take(Sounding):
    """Motions and signals of model and truth for a pluck, and of other presets' models beside them.

    Its frames are pictures; its fundamental is that of the string at small amplitudes.

    Attributes:
        stride: samples between two pictures of model and truth.
        model: renders more of the model where it is needed; has no state.
        motions: by source; those of other presets' models each at its own rate and on its own grid.
        errors: of the model, over the pictures after the first that are ready.
    """

    motions: dict[str, Pictures]

    def __init__(
        self,
        preset_name: str,
        info: PresetInfo,
        pluck: Pluck,
        seconds: float,
        ear: Ear,
        stride: int = 1,
        model: StringSource | None = None,
    ) -> None:
        self.preset_name = preset_name
        self.info = info
        self.pluck = pluck
        self.seconds = seconds
        self.stride = stride
        self.model = model
        self.rate_hz = info.rate_hz
        self.horizon_s = info.horizon_s
        self.frames_hz = info.rate_hz / stride
        self.motions = {name: Pictures(self.frames_hz, info.grid_points, seconds) for name in SOURCES}
        self.frames = self.motions["truth"].frames
        self.listened = Listened(ear, {name: Signal(info.rate_hz, len(ear.points), seconds) for name in SOURCES})
        self.partials_hz = np.asarray(info.resonator.omega / math.tau)
        self.fundamental_hz = float(self.partials_hz[0])
        self.errors = ErrorSums(self.frames - 1)
        self.error_course = ErrorWindows(self.frames - 1, WINDOW_PERIODS / self.fundamental_hz, self.frames_hz)
        self._measured = 1  # pictures; the first is no prediction

    @property
    def error(self) -> float:
        """The larger of `errors_by_training` as far as there are, so far; not a number where there are none."""
        return max((error for error in self.errors_by_training if not math.isnan(error)), default=math.nan)

    @property
    def errors_by_training(self) -> tuple[float, ...]:
        """Relative mean absolute errors within the time of the training, and beyond it where it reaches there."""
        ends_s = 0.0, self.horizon_s, max(self.seconds, self.horizon_s)
        return tuple(window.rel_mae for window in self.errors.windows(self.frames_hz, ends_s))

    @property
    def progress(self) -> tuple[object, ...]:
        """A value as that of any sound, which flashes change too."""
        motions = self.motions.values()
        flashes = [(motion.flashes, motion.flashes.ready) for motion in motions if motion.flashes is not None]
        return *super().progress, *(motion.ready_frames for motion in motions), *flashes

    def measure(self) -> None:
        """Add the errors of the pictures that both model and truth have since the last call."""
        first, stop = self._measured, self.ready_frames
        if stop > first:
            model, truth = (self.motions[name].read(first, stop) for name in SOURCES)
            self.errors.add(model[None], truth[None], first - 1, row=0)
            self.error_course.add(model, truth)
            self._measured = stop

    def motion_m(self, source: str) -> NDArray[np.float32]:
        """The pictures so far, (ready_frames, grid_points), in m."""
        return self.motions[source].read(0, self.ready_frames if source in SOURCES else None)
