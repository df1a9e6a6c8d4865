"""Takes of known motion, and what computations are given in place of a thread's job."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.rendering import Take
from app.shared.worker import Cancelled
from engine.pluck import Pluck
from engine.presets import read_info
from engine.values.ear import Ear
from tests.app.takes import append_to

MakeTake = Callable[..., Take]


@pytest.fixture
def make_take(small_preset: Path) -> MakeTake:
    """A take of given motions (frames, 101), of which the first `ready` frames are there; at 4 kHz."""

    def make(model_m: NDArray[np.float32], truth_m: NDArray[np.float32], ready: int | None = None) -> Take:
        info = read_info(small_preset)
        seconds = (len(truth_m) - 1) / info.rate_hz
        take = Take("small", info, Pluck(0.35, 4.0, "gaussian", 0.06), seconds, Ear((0.5,)))
        append_to(take, model_m[:ready], truth_m[:ready])
        return take

    return make


class RecordingJob:
    """A job that remembers what is reported, and cancels after so many reports."""

    def __init__(self) -> None:
        self.shares: list[float] = []
        self.results: list[object] = []
        self.cancel_after: int | None = None

    def check(self) -> None:
        if self.cancel_after is not None and len(self.shares) >= self.cancel_after:
            raise Cancelled

    def report(self, share: float, text: str = "", so_far: object = None) -> None:
        self.check()
        self.shares.append(share)
        if so_far is not None:
            self.results.append(so_far)


@pytest.fixture
def job() -> RecordingJob:
    return RecordingJob()
