"""Simulated trajectories, kept as modal amplitudes in a cache keyed by all that determines them.

The kept modes make the data band-limited, so 10 or 25 amplitudes hold a frame of 101 points exactly.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from engine.excitation import DRAWS
from engine.reference import ModalState, SplittingSolver
from engine.schema import write
from engine.sine_transform import synthesis_matrix, to_modes
from training.configuration import DatasetConfiguration

CACHE_VERSION = 2  # raise when the solver, a draw or the files change what they hold
CHUNK = 50  # trajectories a step of the progress
START_EVERY = 100  # kept frames between those of which the velocity is kept, from which a trajectory can be entered

SPLITS = ("train", "validation", "test")


@dataclass(frozen=True)
class Dataset:
    """Trajectories at rest at frame 0.

    Attributes:
        amplitudes: float32 (count, kept + 1, modes) in m of frames 0, stride, 2 stride, … steps, memory-mapped from
            the cache.
        velocities: float32 (count, starts, modes) in m/s, of every START_EVERY-th of these.
        scale_m: one standard deviation of displacement over the training split; models see displacement/scale.
    """

    configuration: DatasetConfiguration
    amplitudes: Tensor
    velocities: Tensor
    scale_m: float

    def split(self, name: str) -> Tensor:
        """The amplitudes of "train", "validation" or "test"."""
        return self.amplitudes[split_rows(self.configuration.count, name)]


def split_rows(count: int, name: str) -> slice:
    """The trajectories of a split: 80/10/10 in order."""
    if name not in SPLITS:
        raise ValueError(f"split {name!r} is not one of {', '.join(SPLITS)}")
    train, validation = count * 8 // 10, count // 10
    first = {"train": 0, "validation": train, "test": train + validation}[name]
    return slice(first, {"train": train, "validation": train + validation, "test": count}[name])


def default_cache() -> Path:
    """LEARNED_STRINGS_CACHE, else `cache` beside the project."""
    return Path(os.environ.get("LEARNED_STRINGS_CACHE", Path(__file__).parents[1] / "cache"))


def dataset_key(configuration: DatasetConfiguration) -> str:
    """A digest of everything that determines the data."""
    text = json.dumps([CACHE_VERSION, write(configuration)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def dataset_folder(configuration: DatasetConfiguration, cache: Path | None = None) -> Path:
    """Where the data set lies, or will."""
    return (cache or default_cache()) / "datasets" / dataset_key(configuration)


def draw_initial(configuration: DatasetConfiguration) -> Tensor:
    """Initial modal amplitudes of all trajectories, float64 (count, modes)."""
    generator = torch.Generator().manual_seed(configuration.seed)
    draw = DRAWS[configuration.initial]
    return to_modes(draw(configuration.count, configuration.grid_points, generator), configuration.modes)


def load_dataset(
    configuration: DatasetConfiguration,
    cache: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Dataset:
    """The data set from the cache, generated first where it is not there. Safe to kill at any time.

    Args:
        progress: called with (trajectories done, all).

    Raises:
        OSError: the cache folder cannot be written.
        ValueError: a cached file is damaged; the message names the file to delete.
    """
    folder = dataset_folder(configuration, cache)
    if not folder.exists():
        _generate(configuration, folder, progress)
    try:
        amplitudes = _map(folder / "amplitudes.npy", _amplitudes_shape(configuration))
        velocities = _map(folder / "velocities.npy", _velocities_shape(configuration))
        facts = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))
        scale_m = float(facts["scale_m"])
        if not (scale_m > 0 and math.isfinite(scale_m)):
            raise ValueError(f"dataset.json: scale_m is {scale_m}")
    except (ValueError, KeyError, TypeError, OSError, EOFError) as error:
        raise ValueError(f"{folder}: damaged data cache ({error}); delete that folder to make it again") from error
    return Dataset(configuration, torch.from_numpy(amplitudes), torch.from_numpy(velocities), scale_m)


def _amplitudes_shape(c: DatasetConfiguration) -> tuple[int, int, int]:
    return c.count, c.steps // c.stride + 1, c.modes


def _velocities_shape(c: DatasetConfiguration) -> tuple[int, int, int]:
    return c.count, -(-c.steps // (c.stride * START_EVERY)), c.modes


def _map(file: Path, shape: tuple[int, int, int]) -> np.ndarray[Any, np.dtype[np.float32]]:
    """An array of the cache, copied on write: nothing can change the cache."""
    values = np.load(file, mmap_mode="c")
    if values.shape != shape or values.dtype != np.float32:
        raise ValueError(f"{file.name} holds {values.dtype} {values.shape}, expected float32 {shape}")
    return values


def _generate(configuration: DatasetConfiguration, folder: Path, progress: Callable[[int, int], None]) -> None:
    """Writes into a temporary folder that is renamed when it is whole."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    unfinished = Path(tempfile.mkdtemp(prefix="unfinished-", dir=folder.parent))
    try:
        c = configuration
        solver = SplittingSolver(
            c.string, c.modes, c.rate_hz, tension_modulated=c.tension_modulated, substeps=c.substeps
        )
        new = np.lib.format.open_memmap
        amplitudes = new(unfinished / "amplitudes.npy", "w+", np.float32, _amplitudes_shape(c))
        velocities = new(unfinished / "velocities.npy", "w+", np.float32, _velocities_shape(c))
        initial = draw_initial(c)
        for first in range(0, c.count, CHUNK):
            progress(first, c.count)
            rows = slice(first, first + CHUNK)
            state = ModalState.at_rest(initial[rows])
            amplitudes[rows, 0] = state.amplitude.numpy()
            for start, done in enumerate(range(0, c.steps // c.stride, START_EVERY)):
                velocities[rows, start] = state.velocity.numpy()
                frames, state = solver.advance(state, min(START_EVERY * c.stride, c.steps - done * c.stride))
                kept = frames[:, c.stride - 1 :: c.stride].numpy()
                amplitudes[rows, done + 1 : done + 1 + kept.shape[1]] = kept
        amplitudes.flush()
        velocities.flush()
        training = torch.from_numpy(amplitudes)[split_rows(c.count, "train")]
        scale_m = displacement_deviation(training, c.grid_points)
        facts = {"configuration": write(c), "cache_version": CACHE_VERSION, "scale_m": scale_m}
        (unfinished / "dataset.json").write_text(json.dumps(facts, indent=2), encoding="utf-8")
        del amplitudes, velocities, training
        if folder.exists():  # another process was faster with the same data
            return
        unfinished.rename(folder)
        progress(c.count, c.count)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def displacement_deviation(amplitudes: Tensor, grid_points: int) -> float:
    """The standard deviation of displacement over trajectories, frames and grid points, for (…, modes)."""
    synthesis = synthesis_matrix(grid_points, amplitudes.shape[-1])
    gram, column = synthesis @ synthesis.T / grid_points, synthesis.mean(1)
    total = squared = 0.0
    frames = amplitudes.reshape(-1, amplitudes.shape[-1])
    for chunk in frames.split(100_000):
        chunk = chunk.double()
        squared += float(((chunk @ gram) * chunk).sum())
        total += float((chunk @ column).sum())
    mean = total / len(frames)
    return (squared / len(frames) - mean**2) ** 0.5
