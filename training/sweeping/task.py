"""A task of a sweep, what a worker does with it, and the contract of all workers.

A worker's process trains the runs of a task and returns their rows. While it does, it writes each run's progress into
the run's folder, where the sweep reads it; a cluster whose folders are out of the sweep's reach reports rows alone.
"""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from engine.schema import SchemaError, parse_json, read, write
from engine.whole_file import whole_file
from training.configuration import Run

if TYPE_CHECKING:
    from training.fitting.fit import FitProgress
    from training.results import Row

TELL_EVERY_S = 1.0  # of a run's progress
# in the run's folder
FAILURE = "failure.txt"  # why it failed, in full
PROGRESS = "progress.json"
_one_at_a_time = threading.Lock()  # a worker of several threads still trains one model: they would share its cores


class WorkersError(ConnectionError):
    """A lack of workers: none can be had, or they are gone; the message says which and the remedy."""


@dataclass(frozen=True)
class Workers:
    """The workers that carry out tasks.

    Attributes:
        submit: begins a written `Task`, or lets it wait for the next worker that is free. Its future has what
            `perform` returns, the error of a worker that died, or is cancelled where the workers are gone.
        capacity: the number of tasks that can be under way at present.
    """

    description: str
    submit: Callable[[Mapping[str, Any]], Future[dict[str, Any]]]
    capacity: Callable[[], int]


@dataclass(frozen=True)
class Task:
    """Runs as plain data, so that a worker of another version says so instead of training something else.

    Attributes:
        runs: differ in their seeds alone, and are trained step by step together.
        digests: of the runs, by the code that began the sweep.
        folder, cache: None: the worker's own defaults.
        group: a folder in `folder` for the runs' folders, "" for none.
        device: "cpu", "cuda" or "auto".
        threads: of the CPU, None: as the worker was started.
        checkpoint_every_s: between two checkpoints of a run; None: see `Options`.
    """

    runs: tuple[Run, ...]
    digests: tuple[str, ...]
    folder: str | None = None
    group: str = ""
    cache: str | None = None
    device: str = "cpu"
    threads: int | None = None
    checkpoint_every_s: float | None = None

    def folder_of(self, name: str) -> Path:
        """The folder of a run."""
        from training.run import default_runs

        return (Path(self.folder) if self.folder else default_runs()) / self.group / name


def perform(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Perform a written `Task` in this process: its runs' "rows", or none and the "error" why it failed."""
    task = None
    with _one_at_a_time:
        try:
            task = read(Task, plain, "task")
            rows = _train(task)
            for run in task.runs:
                for name in (PROGRESS, FAILURE):  # a failure of an earlier try, or of a worker whose sweep was killed
                    with suppress(OSError):
                        (task.folder_of(run.name) / name).unlink(missing_ok=True)
            return {"rows": [write(row) for row in rows], "error": ""}
        except Exception as error:
            if task is not None:
                with suppress(OSError):
                    file = task.folder_of(task.runs[0].name) / FAILURE
                    file.write_text(traceback.format_exc(), encoding="utf-8")
            _leave_if_broken(str(plain.get("device")))
            return {"rows": [], "error": f"{type(error).__name__}: {error}"}


def read_progress(folder: Path) -> FitProgress | None:
    """The progress in a run's folder; None where there is none, or one that is not finite."""
    from training.fitting.fit import FitProgress

    with suppress(OSError, SchemaError):
        return read(FitProgress, parse_json((folder / PROGRESS).read_bytes(), PROGRESS), PROGRESS)
    return None


def _train(task: Task) -> list[Row]:
    """Train the runs of a task together, write their progress into their folders, and return their rows."""
    import torch

    from training.run import device_of, run_rows

    if task.threads is not None:
        torch.set_num_threads(task.threads)
    if tuple(run.digest for run in task.runs) != task.digests:
        raise RuntimeError("this worker's code is of another version than that which began the sweep; update it")
    written_s: dict[str, float] = {}  # by run, when its progress was written

    def tell(run: Run, progress: FitProgress) -> None:
        now = time.monotonic()
        if now - written_s.get(run.name, -math.inf) >= TELL_EVERY_S:
            written_s[run.name] = now
            with suppress(OSError), whole_file(task.folder_of(run.name) / PROGRESS) as unfinished:
                unfinished.write_text(json.dumps(write(progress)), encoding="utf-8")

    return run_rows(
        task.runs,
        task.folder_of(""),
        report=tell,
        cache=Path(task.cache) if task.cache else None,
        device=device_of(task.device),
        waits=lambda: print(f"{task.runs[0].name}: waits: another process trains it", file=sys.stderr, flush=True),
        checkpoint_every_s=task.checkpoint_every_s,
    )


def _leave_if_broken(device: str) -> None:
    """End this process if its CUDA device has faulted: nothing later would work, and a new process replaces it."""
    if device == "cpu":
        return
    import torch

    try:
        if torch.cuda.is_initialized():
            torch.cuda.empty_cache()
            torch.zeros(1, device="cuda").add(1).cpu()
    except RuntimeError:
        os._exit(1)
