"""sweep, results merge, results measure: many runs, and the results file with their rows."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from engine.plain_text import duration, one_line
from training.cli.arguments import Cache, Device, Json, Runs
from training.cli.console import Failure, number, print_json, print_table, say

if TYPE_CHECKING:
    from rich.console import RenderableType

    from training.results import Row
    from training.sweeping.plan import Plan, Run
    from training.sweeping.workers.base import Noted, Progressed

LINE_EVERY_S = 60.0  # between two lines of a run's progress, where standard error is not a terminal
NAMED = 3  # failed runs that a message names at most

results = typer.Typer(no_args_is_help=True, help="The results file: one row per run.", rich_markup_mode=None)
Results = Annotated[Path | None, typer.Option(help="The results file; default training/results.csv.")]


def sweep(
    plan: Annotated[str, typer.Argument(metavar="PLAN", help="A plan's name, or the path of its .toml file.")],
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="A Dask scheduler, such as tls://HOST:PORT; default workers on this machine."
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Runs at once; default one on each core, or --per-device on each GPU.")
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of the CPU in each worker.")] = None,
    device: Annotated[Device, typer.Option(help="auto: CUDA if it can be used.")] = "auto",
    per_device: Annotated[
        int, typer.Option(min=1, help="Runs at once on each GPU: several small models fill it better than one.")
    ] = 1,
    results: Annotated[
        Path | None,
        typer.Option(help="The results file; default training/results.csv, or, for a trial, one in --runs."),
    ] = None,
    runs: Runs = None,
    cache: Cache = None,
    retries: Annotated[int, typer.Option(min=0, help="Further tries of a run that failed.")] = 1,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List the runs in their order, and train none.")] = False,
    json: Json = False,
) -> None:
    """Train all runs of a plan.

    In the plan's order; each adds a row to the results file. Finished runs are skipped and failed ones tried again:
    the same command continues after an interruption.
    """
    from training.results import read_results
    from training.sweeping.plan import load_plan
    from training.sweeping.sweep import Options, results_of, unfinished
    from training.sweeping.sweep import sweep as run  # this command has the name
    from training.sweeping.workers import cluster_workers, fitted, local_workers, open_to_anybody

    chosen = load_plan(plan)
    file = results or results_of(chosen, runs)
    known = read_results(file)
    if dry_run:
        _list(chosen, known, json)
        return
    left = len(unfinished(chosen, known))
    if scheduler is None:
        layout = fitted(max(left, 1), device=device, workers=workers, threads=threads, per_device=per_device)
        options = Options(file, runs, cache, layout.device, layout.threads, retries)
        opened = local_workers(layout)
    else:
        options = Options(file, runs, cache, device, threads, retries)
        if open_to_anybody(scheduler):
            say(
                f"warning: {scheduler} neither authenticates nor encrypts: anyone who can connect to it can run code"
                " on its workers; use tls:// with certificates, or a private network"
            )
        opened = cluster_workers(scheduler, workers)
    say(f"{chosen.name}: {left} of {len(chosen.runs)} runs to do; rows go to {file}")
    rows = [row for row in known if row.digest in {run.digest for run in chosen.runs}]
    if left:
        try:
            with opened as found:
                say(f"on {found.description}")
                with _watching(left, found.capacity) as watch:
                    rows = run(chosen, found, options, watch)
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
    """Add the rows of other results files. Of several rows of a run the latest is kept, a finished one before others.

    Rows of an earlier version get the digests of this version where their names still mean the same runs.
    """
    from training.migration import migrated
    from training.results import RESULTS, add_rows, read_results

    file = results or RESULTS
    before = len(read_results(file))
    rows = migrated(row for other in others for row in read_results(other))
    after = len(add_rows(file, rows))
    print(f"{one_line(str(file))}: {after} rows, {after - before} of them new")


@results.command()
def measure(
    presets: Annotated[
        list[str] | None,
        typer.Argument(metavar="PRESET...", help="Names or files; default all that have a row."),
    ] = None,
    results: Results = None,
    cache: Cache = None,
) -> None:
    """Add the standard errors that earlier rows lack.

    Their presets are measured again. Nothing is trained, and no figure that a row has is changed.
    """
    from engine.presets import find_preset, preset_files, read_info
    from training.results import RESULTS, add_rows, read_results
    from training.row_errors import configuration_of, filled

    file = results or RESULTS
    rows = {row.digest: row for row in read_results(file)}
    found = [find_preset(name) for name in presets] if presets else _of_one_string(preset_files())
    pairs = [(path, rows.get(configuration_of(read_info(path), str(path)).digest)) for path in found]
    for path, row in pairs:
        if row is None:
            if presets:
                raise Failure(f"{path}: {file} has no row of its run; train it, or give another preset")
            continue
        whole = filled(row, path, cache)
        add_rows(file, [whole])
        gained = sum(old is None and new is not None for old, new in zip(astuple(row), astuple(whole), strict=True))
        print(one_line(f"{row.name}: {gained} figures added"))


def _of_one_string(files: list[Path]) -> list[Path]:
    """Those that can be read and are no model of many strings, which has no row."""
    from engine.presets import PresetError, read_info

    found = []
    for file in files:
        with contextlib.suppress(PresetError):
            if read_info(file).family is None:
                found.append(file)
    return found


def _list(plan: Plan, known: list[Row], json: bool) -> None:
    rows = {row.digest: row for row in known}
    facts = []
    for run in plan.runs:
        row = rows.get(run.digest)
        facts.append({"name": run.name, "status": row.status if row else "", "rel_mae": row.rel_mae if row else None})
    if json:
        print_json(facts)
        return
    print_table(("run", "status", "rel. MAE"), [list(fact.values()) for fact in facts])
    print(f"{sum(not fact['status'] for fact in facts)} of {len(facts)} runs were never done")


def _tell(rows: list[Row], json: bool) -> None:
    """Prints the rows.

    Raises:
        Failure: one has failed.
    """
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


@dataclass
class Board:
    """The progress of a sweep.

    Attributes:
        left: number of runs that have not ended.
        ended: number of runs by status.
        running: the last report of each run; None before its first.
        maes: of the last validation of each run.
    """

    left: int
    ended: dict[str, int] = field(default_factory=lambda: {"done": 0, "diverged": 0, "failed": 0})
    running: dict[str, Progressed | None] = field(default_factory=dict)
    maes: dict[str, float] = field(default_factory=dict)
    _seconds: list[float] = field(default_factory=list)  # that finished runs took

    def started(self, run: Run) -> None:
        self.running[run.name] = None

    def progressed(self, event: Progressed) -> None:
        if event.name in self.running:
            self.running[event.name] = event
            if event.progress.validation:
                self.maes[event.name] = event.progress.validation.rel_mae

    def finished(self, row: Row) -> None:
        self.running.pop(row.name, None)
        self.maes.pop(row.name, None)
        self.left -= 1
        self.ended[row.status] += 1
        if row.seconds is not None:
            self._seconds.append(row.seconds)

    def seconds_left(self, at_once: int) -> float | None:
        """Until all runs have ended, `at_once` at a time, if each takes as long as those so far; None: unknown."""
        told = [event.progress for event in self.running.values() if event]
        whole = self._seconds + [progress.seconds + progress.seconds_left for progress in told]
        if not whole:
            return None
        mean = sum(whole) / len(whole)
        work = sum(progress.seconds_left for progress in told) + mean * (self.left - len(told))
        return work / max(1, min(at_once, self.left))

    def summary(self, at_once: int) -> str:
        parts = [f"{count} {status}" for status, count in self.ended.items() if count or status == "done"]
        parts += [f"{len(self.running)} running", f"{self.left - len(self.running)} waiting"]
        seconds = self.seconds_left(at_once)
        return ", ".join(parts) + ("" if seconds is None else f"; about {duration(seconds)} left")

    def line(self, event: Progressed) -> list[str]:
        """A run's name, epoch, horizon, loss, validation error and time."""
        p = event.progress
        mae = number(self.maes.get(event.name))
        return [event.name, f"{p.epoch}/{p.epochs}", str(p.horizon), number(p.loss), mae, duration(p.seconds_left)]


class _Lines:
    """Shows a sweep as lines of a log."""

    def __init__(self, board: Board, at_once: int) -> None:
        self._board, self._at_once = board, at_once
        self._told: dict[str, float] = {}

    def started(self, run: Run) -> None:
        self._board.started(run)
        self._told[run.name] = time.monotonic()

    def progressed(self, event: Progressed) -> None:
        self._board.progressed(event)
        now = time.monotonic()
        if now - self._told.get(event.name, now) >= LINE_EVERY_S:
            self._told[event.name] = now
            name, epoch, horizon, loss, mae, left = self._board.line(event)
            self.say(f"{name}: epoch {epoch}, horizon {horizon}, loss {loss}, val. MAE {mae}, {left} left")

    def noted(self, event: Noted) -> None:
        self.say(f"{event.name}: {event.text}")

    def finished(self, row: Row) -> None:
        self._board.finished(row)
        result = f"rel. MAE {number(row.rel_mae)}, {_time(row)}" if row.status == "done" else row.message
        self.say(f"{row.name}: {row.status}, {result} ({self._board.summary(self._at_once)})")

    def say(self, text: str) -> None:
        say(text)


class _Live(_Lines):
    """Shows a sweep as lines with a live table of the present runs below them."""

    def progressed(self, event: Progressed) -> None:
        self._board.progressed(event)

    def picture(self) -> RenderableType:
        from rich import box
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        table = Table("run", "epoch", "horizon", "loss", "val. MAE", "left", box=box.SIMPLE_HEAD)
        for name, event in list(self._board.running.items()):
            table.add_row(*(self._board.line(event) if event else [name, *["-"] * 5]))
        return Group(table, Text(self._board.summary(self._at_once)))


@contextmanager
def _watching(left: int, capacity: Any) -> Iterator[_Lines]:
    """What shows the sweep on standard error: a live table in a terminal, else lines."""
    if not sys.stderr.isatty():
        yield _Lines(Board(left), capacity())
        return
    from rich.console import Console
    from rich.live import Live

    console = Console(stderr=True, markup=False, highlight=False)
    watch = _Live(Board(left), capacity())
    # lines that are printed meanwhile appear above the table
    with Live(get_renderable=watch.picture, console=console, refresh_per_second=2, transient=True):
        yield watch
