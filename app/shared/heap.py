"""Garbage collection and glibc's heap: settings that change no result, only pauses and the memory taken."""

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
    """Collect garbage in the calling thread, the window's, every `COLLECT_EVERY_S`, as long as the result is kept.

    Python itself collects in whichever thread happens to allocate, and would delete parts of closed views there, for
    which Qt ends the process. Objects that exist by now are left out of every later collection. A pass through all
    of torch would hold the interpreter for a quarter of a second, and keys and painting with it.
    """
    from pyqtgraph.util.garbage_collector import GarbageCollector  # with all of pyqtgraph

    gc.freeze()
    return GarbageCollector(COLLECT_EVERY_S)


def collect_anywhere() -> None:
    """Take `collect_between_events` back: Python collects in any thread, as it does by default."""
    gc.unfreeze()
    gc.enable()


def return_large_blocks() -> None:
    """Make glibc give blocks of `LARGE_BYTES` and more back to the system when they are freed.

    By default it raises this threshold once large blocks are freed, and keeps later ones. Takes of many sizes would
    then fragment the heap, by a hundred MiB and more.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library
            ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, LARGE_BYTES)


def return_free_pages() -> None:
    """Make glibc give every wholly free page back to the system, which takes a few milliseconds.

    It does not do so by itself: the heap that it keeps for each thread stays at its largest size.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).malloc_trim(0)
