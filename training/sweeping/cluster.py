"""Workers of a Dask cluster, through its executor of `concurrent.futures`. Dask is the extra `cluster`.

Anyone who reaches a scheduler can run code on its workers: with tls:// only those who hold its certificates can, with
tcp:// anybody. Certificates are named in Dask's own configuration (`distributed.comm.tls`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from training.sweeping.task import Workers, WorkersError, perform

CONNECT_S = 10.0  # to a scheduler


def open_to_anybody(address: str) -> bool:
    """Return True if a scheduler's address says that it neither encrypts nor asks who is there."""
    return not address.startswith("tls://")


@contextmanager
def cluster_workers(address: str, most: int | None = None) -> Iterator[Workers]:
    """The workers of the Dask cluster at `address`; `most` of them, None: as many as there are.

    Raises:
        WorkersError: Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise WorkersError(
            f"{address}: a cluster needs Dask ({error}); install the extra learned-strings[cluster] as "
            "docs/install.md says, or leave --scheduler out"
        ) from error
    try:
        client = Client(address, set_as_default=False, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise WorkersError(
            f"{address}: no Dask scheduler answers there ({error}); start one with `dask scheduler`, or leave "
            "--scheduler out"
        ) from error

    def capacity() -> int:
        # No more than there are workers: what waits for a busy one cannot be overtaken by what is worth more. One
        # where there is none yet.
        return most or max(1, len(client.nthreads()))

    with client:
        executor = client.get_executor(pure=False)
        yield Workers(f"the Dask cluster {address}", lambda task: executor.submit(perform, task), capacity)
