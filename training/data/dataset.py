"""The simulated trajectories, kept as modal amplitudes in a cache keyed by all that determines them.

The kept modes make the data band-limited, so 10 or 25 amplitudes hold a frame of 101 points exactly.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from filelock import FileLock
from torch import Tensor

from engine import bounds
from engine.folders import working_folder
from engine.resonators.base import Array
from engine.schema import write
from engine.truth import ModalState, SplittingSolver
from engine.whole_file import naming, whole_folder
from training.configuration import DATA_VERSION, DatasetConfiguration, digest_of, non_default
from training.data.draws import DRAWS

CHUNK = 50  # trajectories a step of the progress
FRAMES_AT_ONCE = 100  # kept frames that are simulated in one go

SPLITS = ("train", "validation", "test", "all")


@dataclass(frozen=True)
class Dataset:
    """Trajectories at rest at frame 0.

    Attributes:
        amplitudes: float32 (count, kept + 1, modes) in m of frames 0, stride, 2 stride, … steps, memory-mapped from
            the cache.
        scale_m: one standard deviation of displacement over the training split; models see displacement/scale.
    """

    configuration: DatasetConfiguration
    amplitudes: Tensor
    scale_m: float

    @property
    def synthesis(self) -> Tensor:
        """The map from amplitudes to displacement in normalised units, float64 (modes, grid_points)."""
        return torch.from_numpy(self.configuration.resonator.shapes / self.scale_m)

    def split(self, name: str) -> Tensor:
        """The amplitudes of "train", "validation" or "test"."""
        return self.amplitudes[split_rows(self.configuration.count, name)]


def split_rows(count: int, name: str) -> slice:
    """The trajectories of a split: 80/10/10 in order, or all."""
    bounds.check_choice("split", name, SPLITS)
    train, validation = count * 8 // 10, count * 8 // 10 + count // 10
    ends = {"train": (0, train), "validation": (train, validation), "test": (validation, count), "all": (0, count)}
    return slice(*ends[name])


def default_cache() -> Path:
    """LEARNED_STRINGS_CACHE, else the working folder `cache`."""
    return working_folder("LEARNED_STRINGS_CACHE", "cache")


def dataset_key(configuration: DatasetConfiguration) -> str:
    """A digest of everything that determines the data."""
    return digest_of([DATA_VERSION, non_default(configuration)])


def dataset_folder(configuration: DatasetConfiguration, cache: Path | None = None) -> Path:
    """The folder in which the data set lies, or will."""
    return (cache or default_cache()) / "datasets" / dataset_key(configuration)


def draw_initial(configuration: DatasetConfiguration) -> Array:
    """Initial modal amplitudes of all trajectories, float64 (count, modes)."""
    generator = torch.Generator().manual_seed(configuration.seed)
    draw = DRAWS[configuration.initial]
    initial = configuration.resonator.to_modes(draw(configuration.count, configuration.grid_points, generator))
    if configuration.largest_tension_rise is not None:
        rise = configuration.resonator.relative_tension_rise(initial)
        with np.errstate(divide="ignore"):  # of silence
            initial = initial * np.minimum(np.sqrt(configuration.largest_tension_rise / rise), 1)[:, None]
    return initial


def load_dataset(
    configuration: DatasetConfiguration,
    cache: Path | None = None,
    report: Callable[[float], None] = lambda share: None,
) -> Dataset:
    """The data set from the cache, generated first where it is not there. Safe to kill at any time.

    Args:
        report: receives the share that is done.

    Raises:
        OSError: the cache folder cannot be written.
        ValueError: a cached file is damaged; the message names the file to delete.
    """
    folder = dataset_folder(configuration, cache)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(folder.with_suffix(".lock")):  # one process makes it, the others wait
        if not folder.exists():
            _generate(configuration, folder, report)
    try:
        facts = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))
        amplitudes = _map(folder / "amplitudes.npy", _amplitudes_shape(configuration), facts["amplitudes_crc32"])
        scale_m = float(facts["scale_m"])
        if not (scale_m > 0 and math.isfinite(scale_m)):
            raise ValueError(f"dataset.json: scale_m is {scale_m}")
    except (ValueError, KeyError, TypeError, OSError, EOFError) as error:
        raise ValueError(f"{folder}: damaged data cache ({error}); delete that folder to make it again") from error
    return Dataset(configuration, torch.from_numpy(amplitudes), scale_m)


def _amplitudes_shape(c: DatasetConfiguration) -> tuple[int, int, int]:
    return c.count, c.steps // c.stride + 1, c.modes


def _map(file: Path, shape: tuple[int, int, int], checksum: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    """An array of the cache, copied on write: nothing can change the cache."""
    values = np.load(file, mmap_mode="c")
    if values.shape != shape or values.dtype != np.float32:
        raise ValueError(f"{file.name} holds {values.dtype} {values.shape}, expected float32 {shape}")
    sum_so_far = 0
    for part in values:
        sum_so_far = zlib.crc32(part.tobytes(), sum_so_far)
    if sum_so_far != checksum:
        raise ValueError(f"{file.name} does not have its checksum")
    return values


def _generate(configuration: DatasetConfiguration, folder: Path, report: Callable[[float], None]) -> None:
    """Write the files of a data set; the caller holds the lock."""
    with whole_folder(folder) as unfinished, naming(folder):
        facts = {"configuration": write(configuration), "data_version": DATA_VERSION}
        facts["amplitudes_crc32"] = _simulate(configuration, unfinished / "amplitudes.npy", report)
        values = np.load(unfinished / "amplitudes.npy", mmap_mode="r")[split_rows(configuration.count, "train")]
        facts["scale_m"] = displacement_deviation(values, configuration.resonator.shapes)
        del values  # an open mapping would hold the folder on Windows
        (unfinished / "dataset.json").write_text(json.dumps(facts, indent=2), encoding="utf-8")
    report(1.0)


def _simulate(c: DatasetConfiguration, file: Path, report: Callable[[float], None]) -> int:
    """Write the amplitudes row by row, so that a full disk is an OSError and no broken mapping; their checksum."""
    solver = SplittingSolver(c.resonator, c.rate_hz, substeps=c.substeps)
    initial = draw_initial(c)
    checksum = 0
    with file.open("wb") as amplitudes:
        header = {"descr": "<f4", "fortran_order": False, "shape": _amplitudes_shape(c)}
        np.lib.format.write_array_header_1_0(amplitudes, header)
        for first in range(0, c.count, CHUNK):
            report(first / c.count)
            state = ModalState.at_rest(initial[first : first + CHUNK])
            frames = [state.amplitude[:, None]]
            for done in range(0, c.steps, FRAMES_AT_ONCE * c.stride):
                block, state = solver.advance(state, min(FRAMES_AT_ONCE * c.stride, c.steps - done))
                frames.append(block[:, c.stride - 1 :: c.stride])
            rows = np.ascontiguousarray(np.concatenate(frames, axis=1), dtype="<f4")
            amplitudes.write(rows.data)
            checksum = zlib.crc32(rows.data, checksum)
    return checksum


def displacement_deviation(amplitudes: np.ndarray[Any, Any], shapes: Array) -> float:
    """The standard deviation of displacement in m over trajectories, frames and grid points.

    Args:
        amplitudes: of modes in m, (…, modes).
        shapes: (modes, grid_points).
    """
    # products of shapes over the grid's points, (modes, modes), and each one's mean, (modes,)
    gram, column = shapes @ shapes.T / shapes.shape[1], shapes.mean(1)
    total = squared = 0.0
    frames = amplitudes.reshape(-1, amplitudes.shape[-1])
    for first in range(0, len(frames), 100_000):
        chunk = frames[first : first + 100_000].astype(np.float64)
        squared += float(((chunk @ gram) * chunk).sum())
        total += float((chunk @ column).sum())
    mean = total / len(frames)
    return (squared / len(frames) - mean**2) ** 0.5
