"""The processes that train: plain ones here, or those of a Dask cluster.

A worker is given a `Task`, reports its progress, and ends it with a row or with what went wrong. A process that dies
is replaced, and its task continues from the last checkpoint; a task that kills one process after another is given up.

`base`       tasks, the reports on them, and the contract of all workers
`layout`     how many workers fit a machine
`performing` what a worker does with a task
`on_dask`    workers of a Dask cluster
`processes`  workers of this machine, reached through pipes that nobody else can open
"""

from __future__ import annotations

from training.sweeping.workers.base import Workers
from training.sweeping.workers.layout import Layout, fitted
from training.sweeping.workers.on_dask import cluster_workers, open_to_anybody
from training.sweeping.workers.processes import process_workers as local_workers

__all__ = ["Layout", "Workers", "cluster_workers", "fitted", "local_workers", "open_to_anybody"]
