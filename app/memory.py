"""How the process keeps its memory: nothing here changes what the app does, only how steadily it does it."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import sys

LARGE_BYTES = 2**20
_M_MMAP_THRESHOLD = -3  # of glibc's mallopt


def spare_the_collector() -> None:
    """What is loaded by now stays, and garbage is not looked for in it again.

    A look at all of torch holds the interpreter for a quarter of a second, many times what a callback can wait.
    """
    gc.freeze()


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
