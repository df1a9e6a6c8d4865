"""The number of workers that fit this machine, and the set-up of each process."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

RUN_BYTES = 8 * 2**30  # that a training takes at most: an LRU over 50 strings and 4000 frames


@dataclass(frozen=True)
class Layout:
    """Workers of this machine.

    Attributes:
        environments: variables of each worker's process.
        threads: of each.
    """

    device: str
    threads: int
    environments: tuple[Mapping[str, str], ...]

    @property
    def description(self) -> str:
        count = len(self.environments)
        return f"{count} × {self.device}, {self.threads} thread{'s' if self.threads > 1 else ''} each"


def fitted(
    tasks: int, *, device: str = "auto", workers: int | None = None, threads: int | None = None, per_device: int = 1
) -> Layout:
    """Workers that fit this machine: one on each core as far as memory goes, or `per_device` processes on each GPU.

    Args:
        tasks: more workers than these are not made.
        device: "auto" takes CUDA devices where there are some.

    Raises:
        ValueError: there is no CUDA device, though one is asked for.
    """
    import torch

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if device != "cpu" and torch.cuda.is_available():
        # as they are visible to this process: numbers, or names of parts of a device
        visible = os.environ.get("CUDA_VISIBLE_DEVICES", "")
        gpus = [gpu.strip() for gpu in visible.split(",") if gpu.strip()] or list(
            map(str, range(torch.cuda.device_count()))
        )
        count = max(1, min(workers or per_device * len(gpus), tasks))
        threads = threads or max(1, cores // count)
        return Layout("cuda", threads, tuple(_environment(threads, gpus[i % len(gpus)]) for i in range(count)))
    if device == "cuda":
        raise ValueError("no CUDA device can be used here; choose --device cpu")
    threads = threads or 1
    count = max(1, min(workers or min(cores // threads, _memory_bytes() // RUN_BYTES), tasks))
    return Layout("cpu", threads, (_environment(threads),) * count)


def _memory_bytes() -> int:
    """The memory of this machine; without bound where it is unknown."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 2**63


def _environment(threads: int, gpu: str | None = None) -> dict[str, str]:
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    return dict.fromkeys(names, str(threads)) | ({} if gpu is None else {"CUDA_VISIBLE_DEVICES": gpu})
