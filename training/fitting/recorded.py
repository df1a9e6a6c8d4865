"""Work of a GPU that is recorded once and then repeated as one launch.

A training step of a small model is thousands of short kernels, and a GPU would wait for each of them to be launched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch

PRECISION = "high"  # of products: by tensor cores (TF32), as the authors' JAX takes them on a GPU
BEFORE = 3  # times before the recording: libraries set themselves up, an optimiser makes its moments


class RecordedWork:
    """A function that works on the current GPU and on tensors that stay where they are; call it for each time.

    It must do the same each time, whatever the tensors hold, and leave no trace on the host: from the fourth call on
    it is not called again. Its products have `PRECISION`.
    """

    def __init__(self, work: Callable[[], None]) -> None:
        self._work, self._calls = work, 0  # calls before the recording
        self._graph: torch.cuda.CUDAGraph | None = None  # the recording; None: not made yet
        self._stream = torch.cuda.Stream()  # of the calls before it

    def __call__(self) -> None:
        if self._graph is None and self._calls == BEFORE:
            self._graph = torch.cuda.CUDAGraph()
            with _products(), torch.cuda.graph(self._graph):
                self._work()
        if self._graph is not None:
            self._graph.replay()
            return
        self._stream.wait_stream(torch.cuda.current_stream())
        with _products(), torch.cuda.stream(self._stream):
            self._work()
        torch.cuda.current_stream().wait_stream(self._stream)
        self._calls += 1


@contextmanager
def _products() -> Iterator[None]:
    """Give products of matrices `PRECISION` within the block."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision(PRECISION)
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)
