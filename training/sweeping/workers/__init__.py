"""The processes that train: Dask's, here or on a cluster, or plain ones where Dask is not installed.

A worker is given a `Task`, tells how far it is, and ends it with a row or with what went wrong. A process that dies
is replaced, and its task goes on from the last checkpoint; a task that kills one process after another is given up.

`base`       tasks, what is told of them, and the contract of all workers
`layout`     how many workers fit a machine
`performing` what a worker does with a task
`on_dask`    workers of Dask, here or on a cluster
`processes`  workers without Dask
"""

from __future__ import annotations

from contextlib import AbstractContextManager

from training.sweeping.workers.base import Workers
from training.sweeping.workers.layout import Layout, fitted
from training.sweeping.workers.on_dask import cluster_workers, dask_is_installed, dask_workers
from training.sweeping.workers.processes import process_workers


def local_workers(layout: Layout) -> AbstractContextManager[Workers]:
    """Workers of this machine: Dask's, or plain processes where it is not installed."""
    return dask_workers(layout) if dask_is_installed() else process_workers(layout)


__all__ = ["Layout", "Workers", "cluster_workers", "fitted", "local_workers"]
