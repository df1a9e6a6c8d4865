"""The modes that a matching pursuit works on: those of the string, or those that its motions show.

Either way a mode is a shape over the grid, its motion in every trajectory, and the grid of exponentials that it may
contain. What is known of the string says all of it at once: sines, linear frequencies, the range of the tension.
A black box has the displacement alone: its shapes are those that the regression of u(t+1) + u(t-1) on u(t) leaves as
they are; whatever their frequencies are, and also where these move (a second-order dynamic mode decomposition;
Schmid 2010); frequencies and decay are read off each shape's motions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from training.data.dataset import Dataset

FREQUENCIES = 80  # of a mode's grid, between the lowest and the highest
DECAYS = (0.0, 1.0, 3.0, 8.0)  # nepers over the horizon, beside the mode's own
SLOWEST = 0.01  # nepers over the horizon: what beats may seem to grow, and no eigenvalue lies on the circle
SILENT = 1e-9  # share of the strongest direction's energy below which there is no motion
OUTSIDE = 1e-4  # share of a motion's energy that may lie below its lowest frequency, and above its highest
AT_ONCE = 50  # trajectories


@dataclass(frozen=True)
class Modes:
    """The modes of a data set's training split, in normalised units.

    Attributes:
        shapes: (modes, grid_points), of mean square one half where they do not vanish.
        motions: of each in every trajectory, (count, steps + 1, modes).
        grids: for each the logarithms of the eigenvalues to choose from, complex128 (any,).
        mirror: for each, whether it is the same from the string's other end (1), or turned over (-1).
    """

    shapes: Tensor
    motions: Tensor
    grids: tuple[Tensor, ...]
    mirror: tuple[float, ...]


def known_modes(dataset: Dataset, steps: int) -> Modes:
    """The modes of the string: prior knowledge that the paper's models do not have."""
    c = dataset.configuration
    amplitudes = dataset.split("train")[:, : steps + 1].double() / dataset.scale_m
    linear = torch.from_numpy(c.resonator.eigenvalues() / c.rate_hz)
    rise = 0.0
    if c.tension_modulated:  # at most half of the tension's, at the start of the strongest motion
        rise = 0.5 * float(c.resonator.relative_tension_rise(amplitudes[:, 0].numpy() * dataset.scale_m).max())
    grids = []
    for eigenvalue in linear:
        linear_frequency = float(eigenvalue.imag)
        # rad a sample
        reach = linear_frequency - 4 * math.pi / steps, linear_frequency * (1 + rise) + math.pi / steps
        spacing = max(math.pi / 2 / steps, linear_frequency * rise / FREQUENCIES)
        grids.append(_grid(linear_frequency, reach, spacing, -float(eigenvalue.real), steps))
    mirror = [1.0] * c.modes if c.resonator.mirror is None else c.resonator.mirror.tolist()
    return Modes(torch.from_numpy(c.resonator.shapes), amplitudes, tuple(grids), tuple(mirror))


def found_modes(dataset: Dataset, steps: int) -> Modes:
    """The modes that the displacement shows, and nothing else.

    Raises:
        ValueError: the motions are no sum of vibrating shapes, or not every frame is there.
    """
    points, stride = dataset.configuration.grid_points, dataset.configuration.stride
    if stride != 1:
        raise ValueError(f"a blind start needs every frame: the data's stride must be 1, not {stride}")
    # sums of u uᵀ, and of (u(t+1) + u(t-1)) uᵀ: (grid_points, grid_points)
    now, next_to_it = torch.zeros(2, points, points, dtype=torch.float64)
    for frames in _displacements(dataset, steps):
        middle = frames[:, 1:-1].flatten(0, 1)
        now += middle.T @ middle
        next_to_it += (frames[:, 2:] + frames[:, :-2]).flatten(0, 1).T @ middle
    energies, directions = torch.linalg.eigh(now)
    audible = energies > SILENT * energies[-1]
    inside = directions[:, audible]
    regression = (inside.T @ next_to_it @ inside) / energies[audible]
    cosines, vectors = torch.linalg.eig(regression / 2)
    if float(cosines.imag.abs().max()) > 1e-6 or float(cosines.real.abs().max()) >= 1:
        raise ValueError("the motions of the training data are no sum of vibrating shapes: no modes to be found")
    order = cosines.real.argsort(descending=True)  # the lowest frequency first
    shapes = (inside @ vectors.real[:, order]).T
    shapes = shapes / shapes.square().sum(1, keepdim=True).sqrt() * math.sqrt((points - 1) / 2)
    apart = torch.linalg.pinv(shapes)
    motions = torch.cat([frames @ apart for frames in _displacements(dataset, steps)])
    grids = tuple(_seen_grid(motions[:, 1:, mode], steps) for mode in range(len(shapes)))
    mirror = tuple(math.copysign(1.0, float(shape @ shape.flip(0))) for shape in shapes)
    return Modes(shapes, motions, grids, mirror)


def _displacements(dataset: Dataset, steps: int) -> Iterator[Tensor]:
    """The training split on the grid, float64 (AT_ONCE, steps + 1, grid_points) at a time."""
    for part in dataset.split("train")[:, : steps + 1].split(AT_ONCE):
        yield part.double() @ dataset.synthesis


def _seen_grid(motions: Tensor, steps: int) -> Tensor:
    """The log eigenvalues to choose from, see `_grid`, where motions (count, steps) of a shape have their energy."""
    window = torch.hann_window(steps, periodic=False, dtype=motions.dtype)
    power = torch.fft.rfft(motions * window).abs().square().mean(0)
    share = power.cumsum(0) / power.sum()
    bin_width = 2 * math.pi / steps
    first, last = (share < OUTSIDE).sum(), (share < 1 - OUTSIDE).sum()
    reach = float(first - 2) * bin_width, float(last + 2) * bin_width
    early, late = (float(half.square().mean()) for half in motions.tensor_split(2, dim=1))
    decay = max(SLOWEST, math.log(early / late)) / steps
    spacing = max(math.pi / 2 / steps, (reach[1] - reach[0]) / FREQUENCIES)
    return _grid(float(power.argmax()) * bin_width, reach, spacing, decay, steps)


def _grid(linear_frequency: float, reach: tuple[float, float], spacing: float, decay: float, steps: int) -> Tensor:
    """A grid of log eigenvalues a sample, complex128 (any,): each frequency with each of `DECAYS`.

    Args:
        linear_frequency: of the mode itself, in rad a sample; it is the first of the grid.
        reach: lowest and highest other frequency, `spacing` apart, in rad a sample.
        decay: of the mode itself, in nepers a sample, to which `DECAYS` are added.
    """
    frequencies = torch.arange(*reach, spacing, dtype=torch.float64)
    frequencies = torch.cat([torch.tensor([linear_frequency], dtype=torch.float64), frequencies[frequencies > 0]])
    decays = torch.tensor(DECAYS, dtype=torch.float64) / steps + decay
    return torch.complex(-decays.expand(len(frequencies), -1), frequencies[:, None].expand(-1, len(decays))).flatten()
