"""Workers of this machine: plain processes, each reached through a pipe that it inherits. Nothing listens."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from engine.python_process import safe_children
from engine.schema import write
from training.sweeping.workers.base import DEATHS, Ended, Event, Noted, Task, Workers, given_up
from training.sweeping.workers.layout import Layout
from training.sweeping.workers.performing import end_of, event_of, perform


@dataclass
class _Place:
    """A place where one process works after another."""

    environment: Mapping[str, str]
    process: Any = None  # a spawned one; its class has no public name
    connection: Connection | None = None
    task: Task | None = None
    deaths: int = 0


class _ProcessWorkers:
    """Processes of this machine, each with a pipe of its own: the death of one disturbs no other."""

    def __init__(self, layout: Layout) -> None:
        self.description = f"processes here: {layout.description}"
        self._places = [_Place(environment) for environment in layout.environments]
        self._context = multiprocessing.get_context("spawn")

    def capacity(self) -> int:
        return len(self._places)

    def start(self, task: Task) -> None:
        place = next(place for place in self._places if place.task is None)
        place.task, place.deaths = task, 0
        self._give(place)

    def next(self, timeout_s: float) -> Event | None:
        places = {place.connection: place for place in self._places if place.connection is not None}
        for ready in wait(list(places), timeout_s):
            place = places[ready]  # type: ignore[index]
            assert place.connection is not None
            try:
                return self._understand(place, place.connection.recv())
            except (EOFError, OSError):
                return self._bury(place)
        return None

    def close(self) -> None:
        for place in self._places:
            if place.process is not None:
                place.process.kill()  # nothing is lost but the time since the last checkpoint
                self._clear(place)

    def _give(self, place: _Place) -> None:
        if place.process is None:
            place.connection, theirs = self._context.Pipe()
            place.process = self._context.Process(
                target=_serve, args=(theirs, dict(place.environment)), daemon=True, name="learned-strings worker"
            )
            with safe_children():
                place.process.start()
            theirs.close()  # so that its death is the end of the pipe
        assert place.connection is not None
        with suppress(OSError):  # a process that has died meanwhile is found by `next`
            place.connection.send(write(place.task))

    def _understand(self, place: _Place, reported: Mapping[str, Any]) -> Event | None:
        if "name" in reported:
            return event_of(reported)
        assert place.task is not None
        name, place.task = place.task.name, None
        return end_of(name, reported)

    def _bury(self, place: _Place) -> Event | None:
        pid = place.process.pid
        self._clear(place)
        if place.task is None:
            return None
        name = place.task.name
        place.deaths += 1
        if place.deaths > DEATHS:
            place.task = None
            return Ended(name, None, given_up(place.deaths), final=True)
        self._give(place)
        return Noted(name, f"its worker {pid} died")

    def _clear(self, place: _Place) -> None:
        assert place.connection is not None
        place.connection.close()
        place.process.join()
        place.process.close()
        place.process = place.connection = None


def _serve(connection: Connection, environment: Mapping[str, str]) -> None:
    """A process's life: task after task until the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the interrupt of a terminal is for the command alone
    os.environ.update(environment)
    with suppress(EOFError, OSError):
        while True:
            connection.send(perform(connection.recv(), connection.send))


@contextmanager
def process_workers(layout: Layout) -> Iterator[Workers]:
    """A process for each of the layout's."""
    with closing(_ProcessWorkers(layout)) as found:
        yield found
