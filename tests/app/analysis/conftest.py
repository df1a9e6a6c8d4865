"""What computations are given in place of a thread's job."""

from __future__ import annotations

import pytest

from app.analysis.job import Cancelled


class RecordingJob:
    """Remembers what it is told, and cancels after so many reports."""

    def __init__(self) -> None:
        self.shares: list[float] = []
        self.results: list[object] = []
        self.cancel_after: int | None = None

    def check(self) -> None:
        if self.cancel_after is not None and len(self.shares) >= self.cancel_after:
            raise Cancelled

    def report(self, share: float, so_far: object = None) -> None:
        self.check()
        self.shares.append(share)
        if so_far is not None:
            self.results.append(so_far)


@pytest.fixture
def job() -> RecordingJob:
    return RecordingJob()
