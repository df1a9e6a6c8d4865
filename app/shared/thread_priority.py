"""Which threads go first where they are more than the cores: sound, then picture, then rendering, then all else.

And how those wait that have nothing to do.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from enum import IntEnum
from pathlib import Path

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


REAL_TIME_PRIORITY = 4  # below the sound server itself


def wait_asleep() -> None:
    """Lets threads that compute for torch sleep until there is more to do; to be called before torch is loaded.

    They would spin otherwise, each on a core, and keep from it whoever should work there: beside other busy
    processes a command took two to three times as long, and as much of the processor, as with one thread.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


def native_threads() -> set[int]:
    """The system's numbers of this process's threads; none where it does not tell."""
    try:
        return {int(folder.name) for folder in Path("/proc/self/task").iterdir()}
    except OSError:
        return set()


def put_first(threads: set[int]) -> bool:
    """Real time for a device's own threads, where Linux grants it; elsewhere the system does so itself."""
    granted = False
    for thread in threads if sys.platform == "linux" else ():
        with contextlib.suppress(OSError):
            policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(thread, policy, os.sched_param(REAL_TIME_PRIORITY))
            granted = True
    return granted
