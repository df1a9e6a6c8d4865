"""Results that are computed from a take while it is rendered, a little at a time."""

from __future__ import annotations

from typing import Protocol

from app.shared.worker import Job

BLOCK_FRAMES = 2048  # of a take, computed at a time: a millisecond or two, so that the interpreter is soon free again
LOOK_AGAIN_S = 0.03  # while the take has nothing new


class Growing(Protocol):
    """Results of which the first so many are ready and never change: one thread calls `advance`, any thread reads."""

    @property
    def complete(self) -> bool:
        """Return True if all results are ready."""

    def advance(self) -> bool:
        """Compute the next few results; return False where the take has nothing new for them yet."""


def keep_up(growing: Growing, job: Job) -> None:
    """Compute all results as the take grows. Raises Cancelled: they are no longer wanted."""
    while not growing.complete:
        job.wait(0.0 if growing.advance() else LOOK_AGAIN_S)
