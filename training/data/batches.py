"""The batches of a training: which trajectories, from which frame, and which frames of them.

Every random choice is a function of (seed, iteration) alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from training.configuration import Recipe
from training.data.dataset import Dataset


@dataclass(frozen=True)
class Batch:
    """Trajectories in normalised units.

    Attributes:
        initial: the frame that a model sets out from, (batch, grid_points).
        frames: int64 (frames,), any selection of 1 … N, counted from `initial`.
        target: the truth at these frames, (batch, frames, grid_points).
        every: True where `frames` are known to be 1 … N in order, so that nobody need read them from a GPU.
    """

    initial: Tensor
    frames: Tensor
    target: Tensor
    every: bool = False

    @property
    def last(self) -> int:
        """The last of the frames."""
        return len(self.frames) if self.every else int(self.frames[-1])

    def split(self, count: int) -> Iterator[Batch]:
        """Split the batch into parts of at most `count` trajectories."""
        for initial, target in zip(self.initial.split(count), self.target.split(count), strict=True):
            yield Batch(initial, self.frames, target, self.every)


class TrainingData:
    """The training split on a device, and random batches of it.

    Attributes:
        count: trajectories in it.
    """

    def __init__(self, dataset: Dataset, device: torch.device) -> None:
        c = dataset.configuration
        self._stride = c.stride
        self._amplitudes = dataset.split("train").to(device)  # m, (trajectories, kept frames, modes)
        self._synthesis = dataset.synthesis.float().to(device)  # (modes, grid_points)
        mirror = c.resonator.mirror
        # sign that each mode takes where the string is turned end to end, (modes,)
        self._mirror = (torch.ones(c.modes) if mirror is None else torch.from_numpy(mirror).float()).to(device)
        self.count = len(self._amplitudes)

    def draw(self, recipe: Recipe, rows: Tensor, horizon: int, iteration: int) -> Batch:
        """A batch of trajectories, on the data's device.

        All frames without flips need nothing from the host.

        Args:
            rows: of the training split, int64 (batch,).
            horizon: frames within which those of the batch are chosen.
            iteration: step of the run, which with the seed determines all random choices.
        """
        device = self._amplitudes.device
        generator = torch.Generator().manual_seed((recipe.seed + 1) * 1_000_003 + iteration)
        kept = max(1, horizon // self._stride)  # frames that the data have within the horizon
        every = keeps_every_frame(recipe, kept)
        if every:
            frames = torch.arange(1, kept + 1, device=device)
            amplitudes = self._amplitudes[rows, : kept + 1]
        else:
            frames = _some_frames(recipe.steps_per_batch, kept, generator).to(device)
            amplitudes = self._amplitudes[rows[:, None], functional.pad(frames, (1, 0))]
        if recipe.flip:
            sign, mirrored = flips(len(rows), generator, device)
            amplitudes = amplitudes * (sign[..., None] * torch.where(mirrored[..., None], self._mirror, 1.0))
        displacement = amplitudes @ self._synthesis
        return Batch(displacement[:, 0], self._stride * frames, displacement[:, 1:], every and self._stride == 1)


def flips(count: int, generator: torch.Generator, device: torch.device) -> tuple[Tensor, Tensor]:
    """The random flips of trajectories: signs of those turned over, and True where mirrored, (count, 1) each."""
    coin = torch.randint(0, 2, (2, count, 1), generator=generator).to(device)
    return 1 - 2 * coin[0], coin[1] == 1


def batches(recipe: Recipe, count: int, epoch: int) -> tuple[Tensor, ...]:
    """The rows of each batch of an epoch: every trajectory once."""
    generator = torch.Generator().manual_seed(recipe.seed * 7_368_787 + epoch)
    if recipe.fixed_batches:
        fixed = torch.arange(count).split(recipe.batch_size)
        return tuple(fixed[batch] for batch in torch.randperm(len(fixed), generator=generator))
    return torch.randperm(count, generator=generator).split(recipe.batch_size)


def keeps_every_frame(recipe: Recipe, horizon: int) -> bool:
    """Return True if a batch has all frames of 1 … horizon."""
    return not recipe.steps_per_batch or recipe.steps_per_batch >= horizon


def _some_frames(count: int, horizon: int, generator: torch.Generator) -> Tensor:
    """A random choice of the frames 1 … horizon, ascending."""
    # one frame from each of `count` equal parts of the horizon: less noise than independent draws
    edges = torch.arange(count) * horizon / count
    return (edges + torch.rand(count, generator=generator) * horizon / count).long().clamp(max=horizon - 1) + 1
