"""A blow on a drum as it is drawn: motion of model and truth, error, and sound, which grow.

A string's take has pictures of points. A drum's has its lowest modes at flashes: amplitude, and the angle that the
mode has turned through since the blow. A picture at any speed of slow motion follows from these: all modes turn more
slowly by one factor, and decay in real time. Waves that run out from
the mallet are thus seen as they run, only slower.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.rendering.note_sound import NoteSound
from app.rendering.strobe import FLASH_HZ
from app.rendering.take import SOURCES, WINDOW_PERIODS, Listened, Sounding
from engine.compare.relative import ErrorWindows
from engine.levels import FULL_SCALE_PA
from engine.resonators.base import Array
from engine.resonators.drum import DrumModes
from engine.resonators.surface import Surface

MOST_SHOWN = 160  # modes in a picture: their waves are wider than three points of its grid
GRID = 57  # points of a picture along the longer side; odd: one is the centre
MOST_HEADS = 24  # that are kept, of 2 MB at most
RATE_HZ = 48_000
FRAMES_OF_FLASH = RATE_HZ // FLASH_HZ
TURNS = 4  # angles computed in a turn of the fastest mode that is shown, at least: they must not skip a turn


@dataclass(frozen=True, eq=False)
class Head:
    """A drum as it is drawn: the shapes of its lowest modes on a grid.

    Attributes:
        inside: which points of the grid (rows, columns) lie on the drum; the first row is the farthest (y = 1).
        shapes: of a surface's modes at amplitude 1 there, float32 (modes, points inside).
        places: (points inside, 2), from the centre in half-lengths.
    """

    inside: NDArray[np.bool_]
    shapes: NDArray[np.float32]
    places: Array

    @classmethod
    def of(cls, surface: Surface, sides: tuple[float, float]) -> Head:
        """The head on a grid; `sides`: length and width in any unit, which give the numbers of columns and rows."""
        inside, places = grid_of(surface, sides)
        shapes = surface.picked(np.arange(min(len(surface.wavenumber), MOST_SHOWN))).shapes(places)
        return cls(inside, shapes.astype(np.float32), places)

    def picture(self, amplitudes: NDArray[np.floating]) -> NDArray[np.float32]:
        """Displacement (rows, columns) of modal amplitudes (modes,), in their unit; 0 outside the drum."""
        picture_m = np.zeros(self.inside.shape, np.float32)
        picture_m[self.inside] = amplitudes.astype(np.float32) @ self.shapes[: len(amplitudes)]
        return picture_m


def grid_of(surface: Surface, sides: tuple[float, float], points: int = GRID) -> tuple[NDArray[np.bool_], Array]:
    """Points over a drum, an odd number of them along the longer side: `inside` and `places` as `Head` has them."""
    longer = max(sides)
    columns, rows = (max(3, 2 * round((points - 1) / 2 * side / longer) + 1) for side in sides)
    x, y = (np.arange(-(n // 2), n // 2 + 1) / (n // 2) for n in (columns, rows))
    grid = np.stack([part.ravel() for part in np.meshgrid(x, y[::-1])], axis=1)
    inside = np.hypot(*grid.T) <= 1 if surface.round else np.ones(len(grid), bool)
    return inside.reshape(rows, columns), grid[inside]


def head_of(modes: DrumModes) -> Head:
    """The head of a drum, made once for each, whatever its damping; half a second of work at most."""
    drum, rows = modes.drum, modes.rows
    for known, head in _heads:
        if known is rows:
            return head
    head = Head.of(modes.surface, (drum.length_m, drum.width_m))
    _heads.append((rows, head))
    return head


_heads: deque[tuple[Array, Head]] = deque(maxlen=MOST_HEADS)  # the worker's


class ModalMotion:
    """The lowest modes of one source at flashes, which grow.

    A mode's angle follows from its amplitude and speed, its speed at a frame from the frames beside it.

    Attributes:
        size_m, angle: of the modes at flashes, (flashes, modes): amplitude, and what it has turned through.
        ready: flashes so far.
        ready_frames: so far; the first is at the blow, at rest.
        block_m: the latest frames, (frames, modes), of all modes.
    """

    def __init__(self, seconds: float, omega: Array) -> None:
        self.flashes = int(seconds * FLASH_HZ) + 1
        self.ready, self.ready_frames = 0, 1
        self.size_m = np.zeros((self.flashes, len(omega)))
        self.angle = np.zeros((self.flashes, len(omega)))
        self.block_m = np.zeros((0, len(omega)))
        self._turn = omega / RATE_HZ  # radians in a frame, (modes,)
        most = max(1.0, math.tau / TURNS / float(self._turn[-1]))
        steps = [step for step in range(1, FRAMES_OF_FLASH + 1) if FRAMES_OF_FLASH % step == 0 and step <= most]
        self._step = steps[-1]  # frames from one whose angle is computed to the next
        self._known = 0  # frames whose angles are known, as far as they are computed
        self._last = np.zeros((1, len(omega)))  # the last two frames, of which the second has no angle yet
        self._wrapped = self._angle = np.zeros(len(omega))  # the last angle, within a turn and as it has grown

    def append(self, block_m: Array) -> None:
        """Append the next frames, (frames, all modes) in m; the last one gets its angle with the next call."""
        q = block_m[:, : len(self._turn)]  # of the modes that are shown
        before_m = self._last if len(self._last) == 2 else np.concatenate([-q[:1], self._last])  # odd about the blow
        q = np.concatenate([before_m, q])
        first, stop = self._known, self._known + len(q) - 2
        # frames whose angles are computed
        numbers = np.arange(-(-first // self._step) * self._step, stop, self._step)
        indices = numbers - first + 1
        swing = (q[indices + 1] - q[indices - 1]) / (2 * np.sin(self._turn))  # v/ω
        size_m, angle = np.hypot(q[indices], swing), np.arctan2(-swing, q[indices])
        if len(numbers):
            before = angle[0] if first == 0 else self._wrapped
            steps = (np.diff(np.concatenate([before[None], angle]), axis=0) + math.pi) % math.tau - math.pi
            angles = (before if first == 0 else self._angle) + np.cumsum(steps, axis=0)
            self._wrapped, self._angle = angle[-1], angles[-1]  # (modes,)
            flash = numbers % FRAMES_OF_FLASH == 0
            count = min(int(flash.sum()), self.flashes - self.ready)  # those after the last are left out
            flashes = slice(self.ready, self.ready + count)
            self.size_m[flashes], self.angle[flashes] = size_m[flash][:count], angles[flash][:count]
            self.ready += count
        self._known, self._last, self.block_m = stop, q[-2:], block_m
        self.ready_frames += len(block_m)


class BlowTake(Sounding):
    """The motion, sound and errors of model and truth of a blow, which grow while they are rendered.

    Its frames are samples, the first at the blow, and one more than `seconds` has. Its fundamental is that of the
    lowest mode at rest, its signals are in Pa at 1 m, with a column for each direction. Errors are over the whole
    surface. The model was trained on no drum.

    Attributes:
        request: its listening points are directions: 0 and 1 lie along the head, on the left and on the right, 0.5
            above it.
        head: the drum's shapes on a grid.
    """

    full_scale = FULL_SCALE_PA
    pickup = "pressure"
    motions: Mapping[str, ModalMotion]

    def __init__(self, request: NoteSound, modes: DrumModes) -> None:
        self.request, self.modes = request, modes
        self.head = head_of(modes)
        self.seconds = self.horizon_s = request.seconds
        self.rate_hz = RATE_HZ
        self.frames = int(request.seconds * RATE_HZ) + 2
        self.frames_hz = RATE_HZ
        omega = modes.omega[: len(self.head.shapes)]
        self.motions = {name: ModalMotion(request.seconds, omega) for name in SOURCES}
        self.partials_hz = np.asarray(modes.omega / math.tau)
        lowest = modes.omega[0] ** 2 - modes.sigma[0] ** 2
        self.fundamental_hz = math.sqrt(max(lowest, 1.0)) / math.tau
        window_s = WINDOW_PERIODS / self.fundamental_hz
        self.error_course = ErrorWindows(self.frames - 1, window_s, RATE_HZ, ("rmse", "level_db"))
        self.listened = Listened(request.ear)
        self._measured = 1  # frames; the first is no prediction

    def measure(self) -> None:
        """Add the errors of the latest block, which is all that is new of model and truth."""
        if self.ready_frames > self._measured:
            model, truth = (self.motions[name].block_m for name in SOURCES)
            self.error_course.add(model, truth, self.modes.scale**2)
            self._measured = self.ready_frames

    @property
    def ready_s(self) -> float:
        """The latest time at which both sources can be shown."""
        return max(0, min(motion.ready for motion in self.motions.values()) - 1) / FLASH_HZ

    @property
    def scale(self) -> Array:
        """The factors (modes,) from amplitudes of the modes to those that `head` has shapes of."""
        return self.modes.scale[: len(self.head.shapes)]

    def modal_m(self, source: str, position_s: float, speed: float) -> Array | None:
        """Amplitudes (modes,) in m of `head`'s shapes as slow motion shows them at a time; None: not rendered yet.

        `speed` is a share of real time; from 1 on nothing is slowed.

        "difference" is that of the true motions, turned as slowly as the truth is.
        """
        parts = [self.motions[name] for name in (SOURCES if source == "difference" else (source,))]
        ready = min(part.ready for part in parts)
        if ready == 0:
            return None
        flash = min(int(position_s * FLASH_HZ), ready - 1)
        motion = parts[-1]
        begins, angle = motion.angle[0], motion.angle[flash]
        slowed = begins + min(speed, 1.0) * (angle - begins)
        modal_m = motion.size_m[flash] * np.cos(slowed)
        if source == "difference":
            model = parts[0]
            modal_m = model.size_m[flash] * np.cos(slowed + model.angle[flash] - angle) - modal_m
        return np.asarray(modal_m * self.scale)
