"""Workers of a Dask cluster.

Anyone who reaches a scheduler can run code on its workers: with tls:// only those who hold its certificates can, with
tcp:// anybody. Certificates are named in Dask's own configuration (`distributed.comm.tls`).
"""

from __future__ import annotations

import importlib.util
import queue
import uuid
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Any

from engine.schema import write
from training.sweeping.workers.base import DEATHS, Ended, Event, Noted, Task, Workers, WorkersError, given_up
from training.sweeping.workers.performing import end_of, event_of, perform

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT_S = 10.0  # to a scheduler


def open_to_anybody(address: str) -> bool:
    """Return True if a scheduler's address says that it neither encrypts nor asks who is there."""
    return not address.startswith("tls://")


def dask_is_installed() -> bool:
    return importlib.util.find_spec("distributed") is not None


class _DaskWorkers:
    """Tasks as Dask futures; what they tell comes through the scheduler's events."""

    def __init__(self, client: Client, description: str, most: int | None = None) -> None:
        self.description = description
        self._client, self._most = client, most
        self._topic = f"learned-strings-{uuid.uuid4().hex}"
        self._events: queue.SimpleQueue[Event | WorkersError] = queue.SimpleQueue()
        self._futures: dict[str, Future[dict[str, Any]]] = {}  # by key
        self._names: dict[str, str] = {}
        client.subscribe_topic(self._topic, self._reported)
        client.subscribe_topic("all", self._scheduler_reported)

    def close(self) -> None:
        self._client.unsubscribe_topic("all")
        self._client.unsubscribe_topic(self._topic)

    def capacity(self) -> int:
        # No more than there are workers: what waits for a busy one cannot be overtaken by what is worth more. One
        # where there is none yet.
        return self._most or max(1, len(self._client.nthreads()))

    def start(self, task: Task) -> None:
        key = f"{task.name}-{uuid.uuid4().hex}"  # a second try is another task
        self._names[key] = task.name
        future = self._client.submit(_perform_on_dask, write(task), self._topic, key=key, pure=False)
        self._futures[key] = future
        future.add_done_callback(self._done)

    def next(self, timeout_s: float) -> Event | None:
        try:
            event = self._events.get(timeout=timeout_s)
        except queue.Empty:
            return None
        if isinstance(event, WorkersError):
            raise event
        return event

    def _reported(self, event: tuple[float, Any]) -> None:
        if understood := event_of(event[1]):
            self._events.put(understood)

    def _scheduler_reported(self, event: tuple[float, Any]) -> None:
        message = event[1]
        if isinstance(message, Mapping) and message.get("action") == "remove-worker":
            for key in message.get("processing-tasks", ()):
                if key in self._names:
                    self._events.put(Noted(self._names[key], f"its worker {message['worker']} died"))

    def _done(self, future: Future[dict[str, Any]]) -> None:
        from distributed import KilledWorker

        name = self._names.pop(str(future.key))
        self._futures.pop(str(future.key), None)
        if future.status == "finished":
            self._events.put(end_of(name, future.result()))
        elif future.status == "error":
            error = future.exception()
            killed = isinstance(error, KilledWorker)
            text = given_up(DEATHS + 1) if killed else f"{type(error).__name__}: {error}"
            self._events.put(Ended(name, None, text, final=killed))
        else:
            self._events.put(WorkersError(f"the Dask scheduler gave up {name} ({future.status}); is it still there?"))


def _perform_on_dask(task: dict[str, Any], topic: str) -> dict[str, Any]:
    from distributed import get_worker

    worker = get_worker()
    return perform(task, lambda reported: worker.log_event(topic, reported))


@contextmanager
def cluster_workers(address: str, most: int | None = None) -> Iterator[Workers]:
    """The workers of the Dask cluster at `address`; `most` of them, None: as many as there are.

    Raises:
        WorkersError: Dask is not installed, or no scheduler answers.
    """
    if not dask_is_installed():
        raise WorkersError("a cluster needs Dask; install dask and distributed, or leave --scheduler out")
    from distributed import Client

    try:
        client = Client(address, set_as_default=False, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise WorkersError(
            f"{address}: no Dask scheduler answers there ({error}); start one with `dask scheduler`, or leave "
            "--scheduler out"
        ) from error
    with client, closing(_DaskWorkers(client, f"the Dask cluster {address}", most)) as found:
        yield found
