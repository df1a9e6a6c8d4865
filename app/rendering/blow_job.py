"""The worker's job for a blow on a drum: motion, sound and errors of model and truth, block by block."""

from __future__ import annotations

import math

import numpy as np

from app.rendering.blow import RATE_HZ, BlowRequest, BlowTake, ModalMotion, head_of
from app.rendering.rendering import Rendering
from app.rendering.strobe import FLASH_HZ
from app.rendering.take import SOURCES, Listened, Signal
from engine.presets import PresetError
from engine.resonators.base import Array
from training.family.drums import StruckDrum
from training.family.motion import Blocks, model_player, true_motion

BLOCK_FRAMES = 1_200  # of 1,600 modes 15 MB
TURNS = 4  # samples in a turn of the fastest mode that is shown, at least: its angle follows from them


class BlowJob(Rendering[BlowRequest, BlowTake]):
    """The rendering of a blow of a preset of many strings."""

    def _continue(self, take: BlowTake) -> None:
        """A block of both sources, or of the signals at other listening points."""
        if not take.complete:
            self._render(take)
        elif not self._satisfied(take):
            self._listen(take)

    def _begin(self) -> BlowTake:
        take = BlowTake(self.request, head_of(self.request.modes))
        take.listened = self._begin_signals()
        return take

    def _begin_signals(self) -> Listened:
        """Begin both sources at the blow, to be heard from the directions of the request."""
        request = self.request
        points = request.ear.points
        self._movers = self._begin_movers()
        # amplitudes in m @ weights (modes, points) = pressure in Pa at 1 m
        self._weights = np.stack([request.modes.radiated((2 * point - 1, 0.0)) for point in points], axis=1)
        return Listened(request.ear, {name: Signal(RATE_HZ, len(points), request.seconds) for name in SOURCES})

    def _begin_movers(self) -> dict[str, _Mover]:
        request = self.request
        struck_drum = StruckDrum.by(request.strike, request.modes)
        try:
            play = model_player(self._load(request.preset).preset.model)
        except ValueError as error:
            raise PresetError(f"{request.preset}: {error}") from error
        return {"model": _Mover(play(struck_drum, RATE_HZ)), "truth": _Mover(true_motion(struck_drum, RATE_HZ))}

    def _blocks(self, frames: int) -> dict[str, Array]:
        """The next frames, (frames, modes) each, of the modes up to the last that moves; one source in the helper."""
        truth = self._helper.submit(self._movers["truth"].advance, frames)
        blocks = {"model": self._movers["model"].advance(frames), "truth": truth.result()}
        moving = 1 + max(
            (int(np.flatnonzero(part.any(axis=0)).max(initial=0)) for part in blocks.values()), default=0
        )
        return {name: np.ascontiguousarray(part[:, :moving]) for name, part in blocks.items()}

    def _render(self, take: BlowTake) -> None:
        first = take.ready_frames
        count = min(BLOCK_FRAMES, take.frames - first)
        blocks = self._blocks(count)
        self._append(take.listened, blocks)
        moving = blocks["truth"].shape[1]
        take.error_course.add(blocks["model"], blocks["truth"], take.request.modes.scale[:moving] ** 2)
        for name, block in blocks.items():
            self._movers[name].show(block, take.motions[name], take.request.modes.omega)
        take.ready_frames = first + count

    def _listen(self, take: BlowTake) -> None:
        """Render the signals for other listening points; those that are there stay until these are complete."""
        listened = self._coming = self._coming or self._begin_signals()
        truth = listened.signals["truth"]
        self._append(listened, self._blocks(min(BLOCK_FRAMES, truth.frames - truth.ready_frames)))
        if listened.complete:
            take.listened, self._coming = listened, None

    def _append(self, listened: Listened, blocks: dict[str, Array]) -> None:
        for name, block in blocks.items():
            signal = listened.signals[name]
            samples = block[: signal.frames - signal.ready_frames] @ self._weights[: block.shape[1]]
            signal.append(samples.astype(np.float32))


class _Mover:
    """The amplitudes of a source's modes from the blow on, block by block, and its lowest modes at flashes."""

    def __init__(self, more: Blocks) -> None:
        self._more, self._begun = more, False
        self._done, self._step = 0, 1  # frames whose angles are known, and how many lie between two that are computed
        self._last = np.zeros((0, 0))  # the last two frames, of which the second has no angle yet
        self._wrapped = self._angle = np.zeros(0)  # the last angle, within a turn and as it has grown

    def advance(self, frames: int) -> Array:
        """The next frames, (frames, modes) in m; the first of all is that of the blow, at rest."""
        if self._begun:
            return self._more(frames).numpy()
        self._begun, amplitudes_m = True, self._more(frames - 1).numpy()
        return np.concatenate([np.zeros((1, amplitudes_m.shape[1])), amplitudes_m])

    def show(self, block: Array, motion: ModalMotion, omega: Array) -> None:
        """Take the flashes of these frames, which follow those of the last call; a speed needs the next frame.

        Modes that the frames leave out rest from now on.
        """
        modes, between = motion.size_m.shape[1], RATE_HZ // FLASH_HZ
        first, moving = self._done, min(block.shape[1], modes)
        turn = omega[:moving] / RATE_HZ
        if first == 0:
            most = max(1.0, math.tau / TURNS * RATE_HZ / float(omega[modes - 1]))
            self._step = max(step for step in range(1, between + 1) if between % step == 0 and step <= most)
            self._last, block = np.stack([-block[1, :moving], block[0, :moving]]), block[1:]  # odd about the blow
        q = np.concatenate([self._last[:, :moving], block[:, :moving]])
        stop = first + len(q) - 2
        numbers = np.arange(-(-first // self._step) * self._step, stop, self._step)
        indices = numbers - first + 1
        swing = (q[indices + 1] - q[indices - 1]) / (2 * np.sin(turn))  # v/ω
        size, angle = np.hypot(q[indices], swing), np.arctan2(-swing, q[indices])
        if len(numbers):
            before = angle[0] if first == 0 else self._wrapped[:moving]
            steps = (np.diff(np.concatenate([before[None], angle]), axis=0) + math.pi) % math.tau - math.pi
            angles = (before if first == 0 else self._angle[:moving]) + np.cumsum(steps, axis=0)
            self._wrapped, self._angle = angle[-1], angles[-1]
            flash = numbers % between == 0
            motion.append(size[flash], angles[flash])
        self._done, self._last = stop, q[-2:]
