"""How a long computation tells how far it is, and learns that nobody waits for it any more."""

from __future__ import annotations

from typing import Protocol


class Cancelled(Exception):
    """The result of a computation is no longer wanted."""


class Job(Protocol):
    """What a computation is given. It calls `check` or `report` a few times a second."""

    def check(self) -> None:
        """Raises `Cancelled` where the result is no longer wanted."""

    def report(self, share: float, so_far: object = None) -> None:
        """Tells the share that is done, 0 … 1, and, where there is one, a result that can be shown already.

        Raises:
            Cancelled: see `check`.
        """
