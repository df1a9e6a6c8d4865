"""The contract of all workers: what they are given, and what they report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from training.results import Row

if TYPE_CHECKING:
    from training.fitting.fit import Progress

DEATHS = 3  # of processes that a task survives; Dask's own default


class WorkersError(RuntimeError):
    """A lack of workers: none can be had, or they are gone; the message says which and the remedy."""


@dataclass(frozen=True)
class OtherSeed:
    """A run that differs from a task's own in its seed alone; the fields are those of `Task`."""

    name: str
    configuration: dict[str, Any]
    digest: str


@dataclass(frozen=True)
class Task:
    """A run as plain data, so that a worker of another version says so instead of training something else.

    Attributes:
        configuration: a TrainingConfiguration, written.
        runs, cache: folders, None: the worker's own defaults.
        group: a folder in `runs` for this run's folder, "" for none.
        device: "cpu", "cuda" or "auto".
        threads: of the CPU, None: as the worker was started.
        others: are trained step by step together with the run.
    """

    name: str
    recipe: str
    configuration: dict[str, Any]
    digest: str
    runs: str | None = None
    group: str = ""
    cache: str | None = None
    device: str = "cpu"
    threads: int | None = None
    checkpoint_every_s: float | None = None
    others: tuple[OtherSeed, ...] = ()


@dataclass(frozen=True)
class Progressed:
    """An epoch of a run is over; reported now and then. `host` and `pid` are of the process that trains it."""

    name: str
    progress: Progress
    host: str
    pid: int


@dataclass(frozen=True)
class Noted:
    """A note on a run for a person."""

    name: str
    text: str


@dataclass(frozen=True)
class Ended:
    """A task is over. Without a row, `error` says why; `final`: to try again is no use.

    Attributes:
        others: rows of the task's others.
    """

    name: str
    row: Row | None
    error: str = ""
    final: bool = False
    others: tuple[Row, ...] = ()


Event = Progressed | Noted | Ended


class Workers(Protocol):
    """The workers that carry out tasks."""

    description: str

    def capacity(self) -> int:
        """The number of tasks that can be under way at present."""

    def start(self, task: Task) -> None:
        """Begins a task, or lets it wait for the next worker that is free."""

    def next(self, timeout_s: float) -> Event | None:
        """The next event; None where nothing happened in time.

        Raises:
            WorkersError: the workers are gone.
        """


def given_up(times: int) -> str:
    """The reason for giving up a task."""
    return f"its worker died {times} times; too little memory, or a fault in a library"
