"""How the process keeps its memory: nothing here changes what the app does, only how steadily it does it."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pyqtgraph.util.garbage_collector import GarbageCollector

COLLECT_EVERY_S = 0.5
LARGE_BYTES = 2**20
_M_MMAP_THRESHOLD = -3  # of glibc's mallopt


def collect_between_events() -> GarbageCollector:
    """From now on garbage is looked for by this thread alone, the window's, as long as the result is kept.

    Python would look in whatever thread has just made some, and delete parts of closed views there: Qt ends the
    process for it. What is loaded by now stays, and garbage is not looked for in it again: a look at all of torch
    holds the interpreter for a quarter of a second, many times what a callback can wait.
    """
    from pyqtgraph.util.garbage_collector import GarbageCollector  # with all of pyqtgraph

    gc.freeze()
    return GarbageCollector(COLLECT_EVERY_S)


def collect_anywhere() -> None:
    """As Python does by itself."""
    gc.unfreeze()
    gc.enable()


def return_large_blocks() -> None:
    """Blocks of a MiB and more go back to the system when they are freed.

    glibc learns from the first large ones that are freed to keep them; takes of many sizes that come and go then
    leave holes, a hundred MiB and more of them.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library
            ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, LARGE_BYTES)


def return_free_pages() -> None:
    """What was freed in small pieces goes back to the system too, as far as whole pages are free: a few milliseconds.

    Each thread frees into a heap of its own, which glibc keeps at its largest.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).malloc_trim(0)
