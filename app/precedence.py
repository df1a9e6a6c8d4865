"""Which threads go first where they are more than the cores: sound and picture, then rendering, then all else."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from enum import IntEnum

NICEST = 19


class Rank(IntEnum):
    """How much nicer than the window a thread is, in the system's measure."""

    RENDERING = 5
    BACKGROUND = 10


def step_back(rank: Rank) -> None:
    """Lets the calling thread, and those that it starts, wait for the sound and the window.

    Only Linux gives each thread a niceness of its own; elsewhere this does nothing.
    """
    if sys.platform == "linux":
        thread = threading.get_native_id()
        with contextlib.suppress(OSError):
            niceness = os.getpriority(os.PRIO_PROCESS, thread) + rank
            os.setpriority(os.PRIO_PROCESS, thread, min(niceness, NICEST))
