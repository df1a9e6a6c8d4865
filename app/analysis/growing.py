"""What is computed from a take while it grows, a little at a time."""

from __future__ import annotations

from typing import Protocol

BLOCK_FRAMES = (
    2048  # about what is computed at a time: a millisecond or two, so that nobody waits for the interpreter
)


class Growing(Protocol):
    """One thread calls `advance`; any thread reads what is below the count of what is ready, which never changes."""

    @property
    def complete(self) -> bool:
        """Whether nothing more will come."""

    def advance(self) -> bool:
        """Computes the next few results. False, at once, where the take has nothing new for them yet."""
