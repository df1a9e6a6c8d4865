"""A notice for the user: something went wrong, or is worth knowing."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Notice:
    """A message, how often it was shown, and when last."""

    message: str
    details: str = ""
    error: bool = True  # False: information
    times: int = 1
    last_reported: str = ""  # hours:minutes:seconds

    @property
    def line(self) -> str:
        return self.message + (f"  (×{self.times})" if self.times > 1 else "")
