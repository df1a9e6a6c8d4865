"""Simulated trajectories, kept as modal amplitudes in a cache keyed by all that determines them.

The kept modes make the data band-limited, so 10 or 25 amplitudes hold a frame of 101 points exactly.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from engine.excitation import DRAWS
from engine.reference import ModalState, SplittingSolver
from engine.schema import write
from engine.sine_transform import synthesis_matrix, to_modes
from training.configuration import DatasetConfiguration

CACHE_VERSION = 1  # raise when the solver or a draw changes what it yields
CHUNK = 50  # trajectories a step of the progress

SPLITS = ("train", "validation", "test")


@dataclass(frozen=True)
class Dataset:
    """Trajectories at rest at frame 0.

    Attributes:
        amplitudes: float32 (count, steps + 1, modes) in m, memory-mapped from the cache.
        scale_m: one standard deviation of displacement over the training split; models see displacement/scale.
    """

    configuration: DatasetConfiguration
    amplitudes: Tensor
    scale_m: float

    def split(self, name: str) -> Tensor:
        """The amplitudes of "train", "validation" or "test": 80/10/10 in order."""
        if name not in SPLITS:
            raise ValueError(f"split {name!r} is not one of {', '.join(SPLITS)}")
        return _split(self.amplitudes, name)


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
    shape = (configuration.count, configuration.steps + 1, configuration.modes)
    file = folder / "amplitudes.npy"
    try:
        amplitudes = np.load(file, mmap_mode="c")  # copy on write: nothing can change the cache
        facts = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))
        scale_m = float(facts["scale_m"])
        if amplitudes.shape != shape or amplitudes.dtype != np.float32:
            raise ValueError(f"holds {amplitudes.dtype} {amplitudes.shape}, expected float32 {shape}")
    except (ValueError, KeyError, OSError, EOFError) as error:
        raise ValueError(f"{file}: damaged data cache ({error}); delete {folder} to make it again") from error
    return Dataset(configuration, torch.from_numpy(amplitudes), scale_m)


def _generate(configuration: DatasetConfiguration, folder: Path, progress: Callable[[int, int], None]) -> None:
    """Writes into a temporary folder that is renamed when it is whole."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    unfinished = Path(tempfile.mkdtemp(prefix="unfinished-", dir=folder.parent))
    try:
        c = configuration
        solver = SplittingSolver(c.string, c.modes, c.rate_hz, tension_modulated=c.tension_modulated)
        shape = (c.count, c.steps + 1, c.modes)
        file = np.lib.format.open_memmap(unfinished / "amplitudes.npy", "w+", np.float32, shape)
        initial = draw_initial(c)
        for start in range(0, c.count, CHUNK):
            progress(start, c.count)
            state = ModalState.at_rest(initial[start : start + CHUNK])
            file[start : start + CHUNK] = solver.solve(state, c.steps).numpy()
        file.flush()
        scale_m = displacement_deviation(_split(torch.from_numpy(file), "train"), c.grid_points)
        facts = {"configuration": write(c), "cache_version": CACHE_VERSION, "scale_m": scale_m}
        (unfinished / "dataset.json").write_text(json.dumps(facts, indent=2), encoding="utf-8")
        del file
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


def _split(amplitudes: Tensor, name: str) -> Tensor:
    count = len(amplitudes)
    train, validation = count * 8 // 10, count // 10
    first = {"train": 0, "validation": train, "test": train + validation}[name]
    last = {"train": train, "validation": train + validation, "test": count}[name]
    return amplitudes[first:last]
