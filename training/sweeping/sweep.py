"""A sweep: the runs of a plan on workers, their rows in the results file.

Only this process writes the file, a row as soon as its run has ended. The same call continues after an interruption:
finished runs are skipped, failed ones tried again, unfinished ones continued from their checkpoints.
"""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from engine.plain_text import one_line
from engine.schema import SchemaError, read, write
from training.configuration import Run
from training.provenance import now
from training.results import RESULTS, Row, add_rows
from training.run import default_runs, row_facts
from training.sweeping.plan import Plan
from training.sweeping.task import PROGRESS, Task, Workers, WorkersError, read_progress

if TYPE_CHECKING:
    from training.fitting.fit import FitProgress

POLL_S = 1.0  # for progress, and for workers that came or went


@dataclass(frozen=True)
class Options:
    """The options for the run of a plan.

    Attributes:
        results: the file; None: the plan's own, see `results_of`.
        runs, cache: folders, as the workers see them; None: their defaults.
        threads: of the CPU in each worker; None: as the worker was started.
        retries: further tries after a run has failed.
        checkpoint_every_s: between two checkpoints of a run; None: `CHECKPOINT_EVERY_S` of `training.fitting.fit`.
        seeds_at_once: the seeds of a cell are one piece of work, as is worth it on a GPU; else each is one.
        ends_s: on the clock of `time.monotonic`, when the sweep ends with what is done by then; None: when all is.
    """

    results: Path | None = None
    runs: Path | None = None
    cache: Path | None = None
    device: str = "cpu"
    threads: int | None = None
    retries: int = 1
    checkpoint_every_s: float | None = None
    seeds_at_once: bool = False
    ends_s: float | None = None

    @property
    def left_s(self) -> float:
        """The seconds until the sweep ends; infinite where it ends with its runs."""
        return math.inf if self.ends_s is None else self.ends_s - time.monotonic()

    def pieces(self, runs: Iterable[Run]) -> list[tuple[Run, ...]]:
        """The pieces of work, runs that one task trains together, in the order of their first runs."""
        pieces: dict[str, list[Run]] = {}
        for run in runs:
            recipe = replace(run.configuration.recipe, seed=0)
            cell = replace(run.configuration, recipe=recipe).digest if self.seeds_at_once else run.digest
            pieces.setdefault(cell, []).append(run)
        return [tuple(piece) for piece in pieces.values()]

    def task(self, plan: Plan, *runs: Run) -> Task:
        """The task of one piece of a plan's work."""
        return Task(
            runs=runs,
            digests=tuple(run.digest for run in runs),
            folder=str(self.runs.absolute()) if self.runs else None,
            group=group_of(plan),
            cache=str(self.cache.absolute()) if self.cache else None,
            device=self.device,
            threads=self.threads,
            checkpoint_every_s=self.checkpoint_every_s,
        )


class Watch(Protocol):
    """Receives what happens in a sweep."""

    def started(self, run: Run) -> None:
        """A run was handed to the workers."""

    def progressed(self, run: Run, progress: FitProgress) -> None:
        """A run is under way."""

    def failed(self, run: Run, error: str) -> None:
        """A run has failed and is tried again."""

    def finished(self, row: Row) -> None:
        """A run has ended, and its row is in the results file."""


def group_of(plan: Plan) -> str:
    """The folder in the folder of runs for a plan's runs: of its name for a trial, "" for any other plan.

    A trial's runs have cells' names and are other runs.
    """
    return plan.name if plan.trial else ""


def results_of(plan: Plan, runs: Path | None = None) -> Path:
    """The file that a plan's rows go to: the committed one, for a trial one beside its runs."""
    return (runs or default_runs()) / group_of(plan) / RESULTS.name if plan.trial else RESULTS


def is_finished(row: Row | None) -> bool:
    """Return True if a run needs no further work. One that diverged would do so again."""
    return row is not None and row.status in ("done", "diverged")


def unfinished(plan: Plan, rows: Iterable[Row]) -> list[Run]:
    """The runs that are still to be done, in the plan's order."""
    known = {row.digest: row for row in rows}
    return [run for run in plan.runs if not is_finished(known.get(run.digest))]


def sweep(plan: Plan, workers: Workers, options: Options, watch: Watch) -> list[Row]:
    """Run what is unfinished of a plan, the most valuable first.

    Where it ends in time, runs under way are left with their checkpoints.

    Returns:
        The rows of the plan's runs, in its order; of those alone that have ended.

    Raises:
        SchemaError, OSError: the results file cannot be read or written. No run is lost for that: rows lie in the
            runs' folders too.
        WorkersError: the workers are gone.
    """
    file = options.results or results_of(plan, options.runs)
    folder = (options.runs or default_runs()) / group_of(plan)
    rows = {row.digest: row for row in add_rows(file, ())}  # fails before the work where it cannot be written
    waiting = deque(options.pieces(unfinished(plan, rows.values())))
    running: dict[Future[dict[str, Any]], tuple[Run, ...]] = {}
    failures: Counter[str] = Counter()  # of pieces by their first run
    while (waiting or running) and options.left_s > 0:
        while waiting and len(running) < workers.capacity():
            # another machine's rows may have come in meanwhile
            piece = tuple(run for run in waiting.popleft() if not is_finished(rows.get(run.digest)))
            if piece:
                for run in piece:
                    (folder / run.name / PROGRESS).unlink(missing_ok=True)  # of an earlier try
                    watch.started(run)
                running[workers.submit(write(options.task(plan, *piece)))] = piece
        ended, _ = wait(running, min(POLL_S, max(options.left_s, 0.0)), FIRST_COMPLETED)
        for run in chain(*running.values()):
            if progress := read_progress(folder / run.name):
                watch.progressed(run, progress)
        for future in ended:
            piece = running.pop(future)
            finished, error = _outcome(future)
            failures[piece[0].name] += bool(error)
            if error and failures[piece[0].name] <= options.retries:
                watch.failed(piece[0], error)
                waiting.appendleft(piece)
                continue
            finished = finished or [_failed(run, error) for run in piece]
            rows.update((other.digest, other) for other in add_rows(file, finished))
            for row in finished:
                watch.finished(row)
    return [rows[run.digest] for run in plan.runs if run.digest in rows]


def _outcome(future: Future[dict[str, Any]]) -> tuple[list[Row], str]:
    """The rows of a task that has ended; or none, and why it failed."""
    if future.cancelled():
        raise WorkersError("the scheduler has given up its tasks; is it still there? The same command continues")
    if died := future.exception():
        error = f"{type(died).__name__}: {died}"
        return [], one_line(f"its worker died: {error}; too little memory, or a fault in a library")
    try:
        outcome = future.result()
        return [read(Row, row, "row") for row in outcome["rows"]], one_line(outcome["error"])
    except SchemaError as refused:
        return [], f"its result makes no sense: {refused}"


def _failed(run: Run, error: str) -> Row:
    """The row of a run that has failed; `error`: why, in one line."""
    return Row(**row_facts(run), status="failed", finished=now(), message=error)
