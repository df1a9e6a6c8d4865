"""The processes that train: Dask's, here or on a cluster, or plain ones where Dask is not installed.

A worker is given a `Task`, tells how far it is, and ends it with a row or with what went wrong. A process that dies
is replaced, and its task goes on from the last checkpoint; a task that kills one process after another is given up.
"""

from __future__ import annotations

import importlib.util
import logging
import multiprocessing
import os
import queue
import signal
import socket
import threading
import time
import traceback
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from engine.schema import SchemaError, read, write
from training.results import Row

if TYPE_CHECKING:
    from distributed import Client, Future

    from training.fitting.fit import Progress

RUN_BYTES = 8 * 2**30  # that a training takes at most: an LRU over 50 strings and 4000 frames
DEATHS = 3  # of processes that a task survives; Dask's own default
TELL_EVERY_S = 1.0  # of a run's progress
CONNECT_S = 10.0  # to a scheduler
_one_at_a_time = threading.Lock()  # a worker of several threads still trains one model: they would share its cores


class WorkersError(RuntimeError):
    """No workers can be had, or they are gone; the message says which and the remedy."""


@dataclass(frozen=True)
class Task:
    """A run as plain data, so that a worker of another version says so instead of training something else.

    Attributes:
        configuration: a TrainingConfiguration, written.
        runs, cache: folders, None: the worker's own defaults.
        group: a folder in `runs` for this run's folder, "" for none.
        device: "cpu", "cuda" or "auto".
        threads: of the CPU, None: as the worker was started.
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


@dataclass(frozen=True)
class Progressed:
    """An epoch of a run is over; told now and then. `host` and `pid` are of the process that trains it."""

    name: str
    progress: Progress
    host: str
    pid: int


@dataclass(frozen=True)
class Noted:
    """Something that a person may want to know of a run."""

    name: str
    text: str


@dataclass(frozen=True)
class Ended:
    """A task is over. Without a row, `error` says why; `final`: to try again is no use."""

    name: str
    row: Row | None
    error: str = ""
    final: bool = False


Event = Progressed | Noted | Ended


class Workers(Protocol):
    """What carries out tasks."""

    description: str

    def capacity(self) -> int:
        """How many tasks can be under way at present."""

    def start(self, task: Task) -> None:
        """Begins a task, or lets it wait for the next worker that is free."""

    def next(self, timeout_s: float) -> Event | None:
        """What happened next; None where nothing did in time.

        Raises:
            WorkersError: the workers are gone.
        """


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
    """Of this machine; without bound where it cannot be told."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 2**63


def _environment(threads: int, gpu: str | None = None) -> dict[str, str]:
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    return dict.fromkeys(names, str(threads)) | ({} if gpu is None else {"CUDA_VISIBLE_DEVICES": gpu})


def dask_is_installed() -> bool:
    return importlib.util.find_spec("distributed") is not None


def local_workers(layout: Layout) -> AbstractContextManager[Workers]:
    """Workers of this machine: Dask's, or plain processes where it is not installed."""
    return _dask_here(layout) if dask_is_installed() else _plain(layout)


# --- what a worker does


def perform(plain: Mapping[str, Any], tell: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    """Does a written `Task` in this process: {"row": …}, or {"error": text} where it failed.

    Args:
        tell: is given plain data that `_event` reads.
    """
    folder = None
    with _one_at_a_time:
        try:
            task = read(Task, plain, "task")
            folder = _runs(task) / task.name
            return {"row": write(_train(task, folder, tell))}
        except Exception as error:
            if folder is not None:
                with suppress(OSError):
                    folder.joinpath("failure.txt").write_text(traceback.format_exc(), encoding="utf-8")
            _leave_if_broken(str(plain.get("device")))
            return {"error": " ".join(f"{type(error).__name__}: {error}".split())}


def _train(task: Task, folder: Path, tell: Callable[[dict[str, Any]], None]) -> Row:
    import torch

    from training.configuration import TrainingConfiguration
    from training.run import run_row

    configuration = read(TrainingConfiguration, task.configuration, task.name)
    if configuration.digest != task.digest:
        raise RuntimeError("this worker's code is of another version than that which began the sweep; update it")
    if task.threads is not None:
        torch.set_num_threads(task.threads)
    device = task.device
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    cache = Path(task.cache) if task.cache else None
    told = -TELL_EVERY_S

    def report(progress: Progress) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told >= TELL_EVERY_S:
            told = now
            facts = {"progress": write(progress), "host": socket.gethostname(), "pid": os.getpid()}
            tell({"name": task.name, **facts})

    return run_row(
        task.name,
        task.recipe,
        configuration,
        folder.parent,
        cache=cache,
        device=device,
        report=report,
        waits=lambda: tell({"name": task.name, "text": "waits: another process trains it"}),
        checkpoint_every_s=task.checkpoint_every_s,
    )


def _runs(task: Task) -> Path:
    from training.run import default_runs

    return (Path(task.runs) if task.runs else default_runs()) / task.group


def _leave_if_broken(device: str) -> None:
    """Ends this process if its CUDA device has faulted: nothing later would work in it, and a new one replaces it."""
    if device == "cpu":
        return
    import torch

    try:
        if torch.cuda.is_initialized():
            torch.cuda.empty_cache()
            torch.zeros(1, device="cuda").add(1).cpu()
    except RuntimeError:
        os._exit(1)


def _event(told: Mapping[str, Any]) -> Event | None:
    """What a worker told; None where it is not understood, for example a loss that is not finite."""
    from training.fitting.fit import Progress

    if "text" in told:
        return Noted(told["name"], told["text"])
    try:
        return Progressed(told["name"], read(Progress, told["progress"], "progress"), told["host"], told["pid"])
    except SchemaError:
        return None


def _ended(name: str, outcome: Mapping[str, Any]) -> Ended:
    if "error" in outcome:
        return Ended(name, None, outcome["error"])
    try:
        return Ended(name, read(Row, outcome["row"], "row"))
    except SchemaError as error:
        return Ended(name, None, f"its result makes no sense: {error}")


# --- Dask


class _DaskWorkers:
    """Tasks as Dask futures; what they tell comes through the scheduler's events."""

    def __init__(self, client: Client, description: str, most: int | None = None) -> None:
        self.description = description
        self._client, self._most = client, most
        self._topic = f"learned-strings-{uuid.uuid4().hex}"
        self._events: queue.SimpleQueue[Event | WorkersError] = queue.SimpleQueue()
        self._futures: dict[str, Future[dict[str, Any]]] = {}  # by key
        self._names: dict[str, str] = {}
        client.subscribe_topic(self._topic, self._told)
        client.subscribe_topic("all", self._scheduler_told)

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

    def _told(self, event: tuple[float, Any]) -> None:
        if understood := _event(event[1]):
            self._events.put(understood)

    def _scheduler_told(self, event: tuple[float, Any]) -> None:
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
            self._events.put(_ended(name, future.result()))
        elif future.status == "error":
            error = future.exception()
            killed = isinstance(error, KilledWorker)
            text = _killed(DEATHS + 1) if killed else f"{type(error).__name__}: {error}"
            self._events.put(Ended(name, None, text, final=killed))
        else:
            self._events.put(WorkersError(f"the Dask scheduler gave up {name} ({future.status}); is it still there?"))


def _perform_on_dask(task: dict[str, Any], topic: str) -> dict[str, Any]:
    from distributed import get_worker

    worker = get_worker()
    return perform(task, lambda told: worker.log_event(topic, told))


def dask_setup(worker: object) -> None:
    """Dask calls this in each of our own workers: the interrupt of a terminal is for the command alone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


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


@contextmanager
def _dask_here(layout: Layout) -> Iterator[Workers]:
    import dask
    from distributed import Client, Nanny, Scheduler, SpecCluster

    common = {
        "nthreads": 1,  # tasks at once, not threads of one
        "memory_limit": 0,  # memory-mapped data sets would count, and the run be killed for them
        "host": "127.0.0.1",
        "preload": [__name__],
        "silence_logs": logging.CRITICAL,  # what matters is told by `Noted`
    }
    workers = {
        number: {"cls": Nanny, "options": {**common, "env": dict(environment)}}
        for number, environment in enumerate(layout.environments)
    }
    settings = {"host": "127.0.0.1", "port": 0, "dashboard_address": "127.0.0.1:0", "allowed_failures": DEATHS}
    with (
        dask.config.set({"distributed.worker.profile.enabled": False}),
        SpecCluster(workers, {"cls": Scheduler, "options": settings}, silence_logs=logging.CRITICAL) as cluster,
        Client(cluster, set_as_default=False) as client,
        closing(_DaskWorkers(client, f"Dask workers here: {layout.description}")) as found,
    ):
        yield found


# --- without Dask


@dataclass
class _Place:
    """Where one process works after another."""

    environment: Mapping[str, str]
    process: Any = None  # a spawned one; its class has no public name
    connection: Connection | None = None
    task: Task | None = None
    deaths: int = 0


class _PlainWorkers:
    """Processes of this machine, each with a pipe of its own: the death of one disturbs no other."""

    def __init__(self, layout: Layout) -> None:
        self.description = f"processes here, as Dask is not installed: {layout.description}"
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
            place.process.start()
            theirs.close()  # so that its death is the end of the pipe
        assert place.connection is not None
        with suppress(OSError):  # a process that has died meanwhile is found by `next`
            place.connection.send(write(place.task))

    def _understand(self, place: _Place, told: Mapping[str, Any]) -> Event | None:
        if "name" in told:
            return _event(told)
        assert place.task is not None
        name, place.task = place.task.name, None
        return _ended(name, told)

    def _bury(self, place: _Place) -> Event | None:
        pid = place.process.pid
        self._clear(place)
        if place.task is None:
            return None
        name = place.task.name
        place.deaths += 1
        if place.deaths > DEATHS:
            place.task = None
            return Ended(name, None, _killed(place.deaths), final=True)
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
def _plain(layout: Layout) -> Iterator[Workers]:
    with closing(_PlainWorkers(layout)) as found:
        yield found


def _killed(times: int) -> str:
    return f"its worker died {times} times; too little memory, or a fault in a library"
