"""Priorities where threads compete for cores: sound, then the window, then rendering, then background work.

And how OpenMP's threads wait while they have nothing to do.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from enum import IntEnum
from pathlib import Path

NICEST = 19  # the lowest priority on Linux
REAL_TIME_PRIORITY = 4  # below the sound server itself


class Rank(IntEnum):
    """The rank of a thread: its niceness above the window's."""

    RENDERING = 5
    BACKGROUND = 10


def lower_priority(rank: Rank) -> None:
    """Lower the priority of the calling thread, and of those that it starts later, by `rank`.

    Only Linux gives each thread a niceness of its own; elsewhere this does nothing.
    """
    if sys.platform == "linux":
        thread = threading.get_native_id()
        with contextlib.suppress(OSError):
            niceness = os.getpriority(os.PRIO_PROCESS, thread) + rank
            os.setpriority(os.PRIO_PROCESS, thread, min(niceness, NICEST))


def wait_asleep() -> None:
    """Make OpenMP's threads, which compute for torch, sleep between operations; call it before torch is loaded.

    By default each spins on its core and keeps it from other work. Next to other busy processes a command took two to
    three times as long, and as much processor time, as with one thread.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


def leave_a_core() -> None:
    """Make torch leave one core to sound and picture, whether it is loaded already, as on Windows, or later."""
    cores = max(1, (os.cpu_count() or 2) - 1)
    os.environ.setdefault("OMP_NUM_THREADS", str(cores))
    if (torch := sys.modules.get("torch")) is not None:
        torch.set_num_threads(cores)


def native_threads() -> set[int]:
    """The system's ids of this process's threads; empty where `/proc` cannot be read (not on Linux)."""
    try:
        return {int(folder.name) for folder in Path("/proc/self/task").iterdir()}
    except OSError:
        return set()


def put_first(threads: set[int]) -> bool:
    """Schedule threads of a sound device in real time; return True if Linux has granted it to at least one.

    Other systems do so by themselves; there it returns False.
    """
    granted = False
    for thread in threads if sys.platform == "linux" else ():
        with contextlib.suppress(OSError):
            policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(thread, policy, os.sched_param(REAL_TIME_PRIORITY))
            granted = True
    return granted
