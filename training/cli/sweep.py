"""sweep, results merge: many runs, and the results file with their rows."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from engine.bounds import MOST_RETRIES, MOST_WORKERS
from engine.plain_text import duration, one_line
from training.cli.arguments import Cache, Device, Json, Runs, check_range
from training.cli.console import Failure, ProgressReport, bars, number, print_json, print_table, say
from training.cli.training import training_report

if TYPE_CHECKING:
    from training.configuration import Run
    from training.fitting.fit import FitProgress
    from training.results import Row
    from training.sweeping.plan import Plan

LINE_EVERY_S = 60.0  # between two lines of a run's progress
MOST_MINUTES = 10_000.0
PIECE_CHECKPOINT_S = 10.0  # between checkpoints of a sweep that ends in time: what a stop costs at most
NAMED = 3  # failed runs that a message names at most

results = typer.Typer(no_args_is_help=True, help="The results file: one row per run.", rich_markup_mode=None)
Results = Annotated[Path | None, typer.Option(help="The results file; default training/results.csv.")]


def sweep(
    plan: Annotated[str, typer.Argument(metavar="PLAN", help="A plan's name, or the path of its .toml file.")],
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="A Dask scheduler, such as tls://HOST:PORT; needs the extra learned-strings[cluster]. "
            "Default workers on this machine.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, max=MOST_WORKERS, help="Runs at once; default one on each core, or --per-device on each GPU."
        ),
    ] = None,
    threads: Annotated[
        int | None, typer.Option(min=1, max=MOST_WORKERS, help="Threads of the CPU in each worker.")
    ] = None,
    device: Annotated[Device, typer.Option(help="auto: CUDA if it can be used.")] = "auto",
    per_device: Annotated[
        int,
        typer.Option(
            min=1, max=MOST_WORKERS, help="Runs at once on each GPU: several small models fill it better than one."
        ),
    ] = 1,
    minutes: Annotated[
        float | None,
        typer.Option(metavar="M", help="End after M minutes; the same command continues, here or elsewhere."),
    ] = None,
    results: Annotated[
        Path | None,
        typer.Option(help="The results file; default training/results.csv, or, for a trial, one in --runs."),
    ] = None,
    runs: Runs = None,
    cache: Cache = None,
    retries: Annotated[
        int, typer.Option(min=0, max=MOST_RETRIES, help="Further tries of a run that failed or died.")
    ] = 1,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List the runs in their order, and train none.")] = False,
    json: Json = False,
) -> None:
    """Train all runs of a plan.

    In the plan's order; each adds a row to the results file. Finished runs are skipped and failed ones tried again:
    the same command continues after an interruption.
    """
    from training.results import read_results
    from training.sweeping.cluster import cluster_workers, open_to_anybody
    from training.sweeping.plan import load_plan
    from training.sweeping.processes import fitted, process_workers
    from training.sweeping.sweep import Options, results_of, unfinished
    from training.sweeping.sweep import sweep as run  # this command has the name

    ends_s = None
    if minutes is not None:
        check_range("--minutes", minutes, 0.1, MOST_MINUTES, "min")
        ends_s = time.monotonic() + 60 * minutes
    chosen = load_plan(plan)
    file = results or results_of(chosen, runs)
    known = read_results(file)
    if dry_run:
        _list(chosen, known, json)
        return
    left = len(unfinished(chosen, known))
    every_s = None if minutes is None else PIECE_CHECKPOINT_S
    kind: str = device
    if scheduler is None:
        layout = fitted(max(left, 1), device=device, workers=workers, threads=threads, per_device=per_device)
        kind, threads = layout.device, layout.threads
        opened = process_workers(layout)
    else:
        if open_to_anybody(scheduler):
            say(
                f"warning: {scheduler} neither authenticates nor encrypts: anyone who can connect to it can run code"
                " on its workers; use tls:// with certificates, or a private network"
            )
        opened = cluster_workers(scheduler, workers)
    options = Options(file, runs, cache, kind, threads, retries, every_s, kind == "cuda", ends_s)
    say(f"{chosen.name}: {left} of {len(chosen.runs)} runs to do; rows go to {file}")
    rows = [row for row in known if row.digest in {run.digest for run in chosen.runs}]
    if left:
        try:
            with opened as pool:
                say(f"on {pool.description}")
                with bars(LINE_EVERY_S) as begin:
                    rows = run(chosen, pool, options, Shown(begin, left, pool.capacity()))
        except KeyboardInterrupt:
            say("stopped; the same command continues")
            raise
    _tell(rows, json)


@results.command()
def merge(
    others: Annotated[
        list[Path],
        typer.Argument(metavar="OTHER.csv...", exists=True, dir_okay=False, help="Results files of other machines."),
    ],
    results: Results = None,
) -> None:
    """Add the rows of other results files. Of a run the latest row is kept, a finished one before others."""
    from training.results import RESULTS, add_rows, read_results

    file = results or RESULTS
    before = len(read_results(file))
    rows = [row for other in others for row in read_results(other)]
    after = len(add_rows(file, rows))
    print(f"{one_line(str(file))}: {after} rows, {after - before} of them new")


def _list(plan: Plan, known: list[Row], json: bool) -> None:
    """Print the runs of a plan in their order, with status and error where `known` rows have them."""
    errors = {row.digest: (row.status, row.rel_mae) for row in known}
    facts = []
    for run in plan.runs:
        status, rel_mae = errors.get(run.digest, ("", None))
        facts.append({"name": run.name, "status": status, "rel_mae": rel_mae})
    if json:
        print_json(facts)
        return
    print_table(("run", "status", "rel. MAE"), [list(fact.values()) for fact in facts])
    print(f"{sum(not fact['status'] for fact in facts)} of {len(facts)} runs were never done")


def _tell(rows: list[Row], json: bool) -> None:
    """Print the rows. Raises Failure: one has failed."""
    from engine.schema import write

    if json:
        print_json([write(row) for row in rows])
    else:
        columns = ("run", "status", "rel. MSE", "rel. MAE", "time")
        print_table(columns, [(r.name, r.status, r.rel_mse, r.rel_mae, _time(r)) for r in rows])
    failed = [row.name for row in rows if row.status == "failed"]
    if failed:
        more = f" and {len(failed) - NAMED} more" if len(failed) > NAMED else ""
        raise Failure(
            f"{len(failed)} of {len(rows)} runs failed: {', '.join(failed[:NAMED])}{more}; their rows say why, and "
            "the same command tries them again"
        )


def _time(row: Row) -> str:
    return "-" if row.seconds is None else duration(row.seconds)


class Shown:
    """Shows a sweep: the progress of each run, and a line for what is worth one."""

    def __init__(self, begin: Callable[[str], ProgressReport], left: int, at_once: int) -> None:
        """`begin`: see `bars`; `left`: runs that have not ended; `at_once`: how many run at a time."""
        self._begin = begin
        self._left = left
        self._at_once = at_once
        # by name, of each run that is under way: its report, and the same for the progress of a training
        self._reports: dict[str, tuple[ProgressReport, Callable[[FitProgress], None]]] = {}
        self._last: dict[str, FitProgress] = {}  # by name, of each run under way that has reported
        self._seconds: list[float] = []  # that finished runs took
        self._ended: Counter[str] = Counter(done=0)  # runs by status

    def started(self, run: Run) -> None:
        report = self._begin(run.name)
        self._reports[run.name] = report, training_report(report)

    def progressed(self, run: Run, progress: FitProgress) -> None:
        self._last[run.name] = progress
        self._reports[run.name][1](progress)

    def failed(self, run: Run, error: str) -> None:
        say(f"{run.name}: failed and is tried again ({error})")

    def finished(self, row: Row) -> None:
        """End the progress of a run, and print a line with its result and the sweep's state."""
        self._reports.pop(row.name)[0](1.0)
        self._last.pop(row.name, None)
        self._left -= 1
        self._ended[row.status] += 1
        if row.seconds is not None:
            self._seconds.append(row.seconds)
        result = f"rel. MAE {number(row.rel_mae)}, {_time(row)}" if row.status == "done" else row.message
        say(f"{row.name}: {row.status}, {result} ({self.summary()})")

    def seconds_left(self) -> float | None:
        """The time until all runs have ended, if each takes as long as those so far; None: unknown."""
        under_way = self._last.values()
        whole = self._seconds + [progress.seconds + progress.seconds_left for progress in under_way]
        if not whole:
            return None
        work = sum(progress.seconds_left for progress in under_way)
        work += sum(whole) / len(whole) * (self._left - len(under_way))
        return work / max(1, min(self._at_once, self._left))

    def summary(self) -> str:
        """The numbers of runs that ended, run and wait, and the time left, in words."""
        running, seconds = len(self._reports), self.seconds_left()
        parts = [f"{count} {status}" for status, count in self._ended.items()]
        parts += [f"{running} running", f"{self._left - running} waiting"]
        return ", ".join(parts) + ("" if seconds is None else f"; about {duration(seconds)} left")
