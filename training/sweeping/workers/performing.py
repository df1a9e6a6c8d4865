"""The work on a task in a worker's own process, and the reading of its report by the sweep's."""

from __future__ import annotations

import os
import socket
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from engine.schema import SchemaError, read, write
from training.results import Row
from training.sweeping.workers.base import Ended, Event, Noted, OtherSeed, Progressed, Task

if TYPE_CHECKING:
    from training.fitting.fit import Progress

TELL_EVERY_S = 1.0  # of a run's progress
FAILURE = "failure.txt"  # in the run's folder: why it failed, in full
_one_at_a_time = threading.Lock()  # a worker of several threads still trains one model: they would share its cores


def perform(plain: Mapping[str, Any], tell: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    """Perform a written `Task` in this process: {"rows": …}, its own first, or {"error": text} where it failed.

    Args:
        tell: is given plain data that `event_of` reads.
    """
    folder = None
    with _one_at_a_time:
        try:
            task = read(Task, plain, "task")
            folder = _runs(task) / task.name
            rows = _train(task, folder, tell)
            with suppress(OSError):  # of an earlier try, or of a worker whose coordinator was killed
                (folder / FAILURE).unlink(missing_ok=True)
            return {"rows": [write(row) for row in rows]}
        except Exception as error:
            if folder is not None:
                with suppress(OSError):
                    folder.joinpath(FAILURE).write_text(traceback.format_exc(), encoding="utf-8")
            _leave_if_broken(str(plain.get("device")))
            return {"error": " ".join(f"{type(error).__name__}: {error}".split())}


def _train(task: Task, folder: Path, tell: Callable[[dict[str, Any]], None]) -> list[Row]:
    import torch

    from training.configuration import TrainingConfiguration
    from training.run import NamedRun, run_rows

    if task.threads is not None:
        torch.set_num_threads(task.threads)
    device = task.device
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    cache = Path(task.cache) if task.cache else None
    runs: list[Task | OtherSeed] = [task, *task.others]
    named = []
    for run in runs:
        configuration = read(TrainingConfiguration, run.configuration, run.name)
        if configuration.digest != run.digest:
            raise RuntimeError("this worker's code is of another version than that which began the sweep; update it")
        named.append(NamedRun(run.name, task.recipe, configuration, report=_reporter(run.name, tell)))
    return run_rows(
        named,
        folder.parent,
        cache=cache,
        device=device,
        waits=lambda: tell({"name": task.name, "text": "waits: another process trains it"}),
        checkpoint_every_s=task.checkpoint_every_s,
    )


def _reporter(name: str, tell: Callable[[dict[str, Any]], None]) -> Callable[[Progress], None]:
    """A function that reports a run's progress now and then."""
    reported = -TELL_EVERY_S

    def report(progress: Progress) -> None:
        nonlocal reported
        now = time.monotonic()
        if now - reported >= TELL_EVERY_S:
            reported = now
            tell({"name": name, "progress": write(progress), "host": socket.gethostname(), "pid": os.getpid()})

    return report


def _runs(task: Task) -> Path:
    from training.run import default_runs

    return (Path(task.runs) if task.runs else default_runs()) / task.group


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


def event_of(reported: Mapping[str, Any]) -> Event | None:
    """A worker's report; None where it is not understood, for example a loss that is not finite."""
    from training.fitting.fit import Progress

    if "text" in reported:
        return Noted(reported["name"], reported["text"])
    try:
        return Progressed(
            reported["name"], read(Progress, reported["progress"], "progress"), reported["host"], reported["pid"]
        )
    except SchemaError:
        return None


def end_of(name: str, outcome: Mapping[str, Any]) -> Ended:
    """The end of a task whose `perform` gave `outcome`."""
    if "error" in outcome:
        return Ended(name, None, outcome["error"])
    try:
        row, *others = (read(Row, row, "row") for row in outcome["rows"])
        return Ended(name, row, others=tuple(others))
    except SchemaError as error:
        return Ended(name, None, f"its result makes no sense: {error}")
