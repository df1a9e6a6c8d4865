from __future__ import annotations

from types import SimpleNamespace

import pytest

from training.sweeping.workers import on_dask as module
from training.sweeping.workers.base import Ended, Task, WorkersError, given_up
from training.sweeping.workers.on_dask import cluster_workers


def test_a_scheduler_that_is_not_there_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CONNECT_S", 0.2)
    with pytest.raises(WorkersError, match="no Dask scheduler answers there"), cluster_workers("tcp://127.0.0.1:9"):
        pass
    monkeypatch.setattr(module, "dask_is_installed", lambda: False)
    with pytest.raises(WorkersError, match="a cluster needs Dask"), cluster_workers("tcp://127.0.0.1:9"):
        pass


def test_what_dask_gives_up_is_final_or_the_end() -> None:
    from distributed import KilledWorker
    from distributed.scheduler import WorkerState

    client = SimpleNamespace(subscribe_topic=lambda topic, handler: None, submit=lambda *a, **o: future)
    state = WorkerState(address="tcp://a:1", status="closed", pid=1, name="a", nthreads=1, memory_limit=0,
                        local_directory="", nanny=None, server_id="a")  # fmt: skip
    killed = KilledWorker("key", state, 3)
    future = SimpleNamespace(add_done_callback=lambda done: None)
    task = Task("a", "ours", {}, "a")
    workers = module._DaskWorkers(client, "")  # type: ignore[arg-type]
    workers.start(task)
    (key,) = workers._names
    workers._done(SimpleNamespace(key=key, status="error", exception=lambda: killed))  # type: ignore[arg-type]
    assert workers.next(1) == Ended("a", None, given_up(4), final=True)
    workers.start(task)
    (key,) = workers._names
    workers._done(SimpleNamespace(key=key, status="cancelled"))  # type: ignore[arg-type]
    with pytest.raises(WorkersError, match="gave up a"):
        workers.next(1)
