"""Workers of this machine: how many fit it, and a pool of one process for each. Nothing listens."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from engine.python_process import safe_children
from training.sweeping.task import Workers, perform

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
        workers: how many; None: as many as fit.
        threads: of each; None: one on a CPU, an even share of the cores with GPUs.

    Raises:
        ValueError: there is no CUDA device, though one is asked for.
    """
    import torch

    from training.run import device_of

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if device_of(device) == "cuda":
        # as they are visible to this process: numbers, or names of parts of a device
        visible = os.environ.get("CUDA_VISIBLE_DEVICES", "")
        gpus = [gpu.strip() for gpu in visible.split(",") if gpu.strip()] or list(
            map(str, range(torch.cuda.device_count()))
        )
        count = max(1, min(workers or per_device * len(gpus), tasks))
        threads = threads or max(1, cores // count)
        return Layout("cuda", threads, tuple(_environment(threads, gpus[i % len(gpus)]) for i in range(count)))
    threads = threads or 1
    count = max(1, min(workers or min(cores // threads, _memory_bytes() // RUN_BYTES), tasks))
    return Layout("cpu", threads, (_environment(threads),) * count)


@contextmanager
def process_workers(layout: Layout) -> Iterator[Workers]:
    """The workers of a layout. At the end of the block their processes end: only time since a checkpoint is lost."""
    leashes, ours = multiprocessing.get_context("spawn").Pipe(duplex=False)

    def submit(task: Mapping[str, Any]) -> Future[dict[str, Any]]:
        return next(place for place in places if place.is_free).submit(task)

    with safe_children():  # also the process that a pool's semaphores start
        places = [_Place(environment, leashes) for environment in layout.environments]
        try:
            yield Workers(f"processes here: {layout.description}", submit, lambda: len(places))
        finally:
            ours.close()
            for place in places:
                place.pool.shutdown()
            leashes.close()


class _Place:
    """A place where one process works after another: the death of one disturbs no other.

    Attributes:
        pool: of its one process; a new one where that has died.
    """

    def __init__(self, environment: Mapping[str, str], leash: Connection) -> None:
        # variables of its process, and a pipe that ends the process when its other end is closed
        self._environment, self._leash = environment, leash
        self._last: Future[dict[str, Any]] | None = None  # task; None: it had none
        self.pool = self._new_pool()

    @property
    def is_free(self) -> bool:
        return self._last is None or self._last.done()

    def submit(self, task: Mapping[str, Any]) -> Future[dict[str, Any]]:
        """Begin a written `Task` in its process; its future has what `perform` returns."""
        try:
            self._last = self.pool.submit(perform, task)
        except BrokenExecutor:  # its process has died since
            self.pool.shutdown()
            self.pool = self._new_pool()
            self._last = self.pool.submit(perform, task)
        return self._last

    def _new_pool(self) -> ProcessPoolExecutor:
        spawn = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(1, spawn, _enter, (dict(self._environment), self._leash))


def _enter(environment: Mapping[str, str], leash: Connection) -> None:
    """Set up a worker's process: its variables, and a thread that ends it when the leash is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the interrupt of a terminal is for the command alone
    os.environ.update(environment)
    threading.Thread(target=_leave_with, args=(leash,), daemon=True).start()


def _leave_with(leash: Connection) -> None:
    """End this process at once when the sweep closes the leash, or has died."""
    with suppress(EOFError, OSError):
        leash.recv()
    os._exit(1)


def _memory_bytes() -> int:
    """The memory of this machine; without bound where it is unknown."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 2**63


def _environment(threads: int, gpu: str | None = None) -> dict[str, str]:
    """The variables of a worker: its number of threads, and the one GPU that it can use; None: not restricted."""
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    return dict.fromkeys(names, str(threads)) | ({} if gpu is None else {"CUDA_VISIBLE_DEVICES": gpu})
