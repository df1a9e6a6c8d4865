"""How a long computation reports its progress, and learns that it is cancelled."""

from __future__ import annotations

from typing import Protocol


class Cancelled(Exception):
    """The result of a computation is no longer wanted."""


class Job(Protocol):
    """Passed to a computation, which calls `check` or `report` a few times a second."""

    def check(self) -> None:
        """Raises `Cancelled` where the result is no longer wanted."""

    def report(self, share: float, so_far: object = None) -> None:
        """Reports the share that is done, 0 … 1, and, where there is one, a result that can be shown already.

        Raises:
            Cancelled: see `check`.
        """
