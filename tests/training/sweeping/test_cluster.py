import sys
from concurrent.futures import wait
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import pytest

from engine.schema import write
from tests.training.sweeping.test_sweep import alone_rows, measured
from training.sweeping import cluster as module
from training.sweeping.cluster import cluster_workers
from training.sweeping.sweep import sweep
from training.sweeping.task import WorkersError


@pytest.fixture
def distributed() -> Any:
    return pytest.importorskip("distributed", reason="Dask is not installed (the extra learned-strings[cluster])")


def test_a_cluster_without_the_extra_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    remedy = r"a cluster needs Dask .* install the extra learned-strings\[cluster\] .*, or leave --scheduler out$"
    with pytest.raises(WorkersError, match=remedy), cluster_workers("tcp://127.0.0.1:9"):
        pass


def test_a_scheduler_that_is_not_there_is_reported(distributed, monkeypatch):
    monkeypatch.setattr(module, "CONNECT_S", 0.2)
    with pytest.raises(WorkersError, match="no Dask scheduler answers there"), cluster_workers("tcp://127.0.0.1:9"):
        pass


@pytest.mark.parametrize("count", [1, 0])
def test_workers_of_a_cluster_do_the_same_and_tasks_without_any_end_with_it(distributed, plan, options, task, count):
    made = plan(seeds="0")
    local = distributed.LocalCluster(n_workers=count, threads_per_worker=1, processes=False, dashboard_address=None)
    with local as cluster:
        with cluster_workers(cluster.scheduler_address) as workers:
            assert "the Dask cluster inproc://" in workers.description
            assert workers.capacity() >= count
            if count:
                sweep(made, workers, options, Mock())
                folder = options.results.parent / "alone"
                alone = replace(options, results=folder / "alone.csv", runs=folder)
                assert measured(options.results) == alone_rows(made, alone)
            else:
                left = workers.submit(write(task))
        if not count:
            wait([left], timeout=10)
            assert left.cancelled()
