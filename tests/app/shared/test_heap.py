"""Memory is returned to the system, and garbage is deleted in the window's own thread."""

from __future__ import annotations

import subprocess
import sys

import pytest

# in a process of its own: this one's heap has seen many blocks already
LARGE_BLOCKS = """
import numpy as np
import psutil
from app.shared.heap import return_large_blocks

return_large_blocks()
process = psutil.Process()
before = process.memory_info().rss
blocks = [np.ones(2**18) for _ in range(32)]  # of 2 MiB
pinned = [np.ones(2**10) for _ in range(32)]  # what would keep a heap from shrinking
most = process.memory_info().rss
del blocks
print((most - before) // 2**20, (process.memory_info().rss - before) // 2**20)
"""

SMALL_BLOCKS = """
import threading
import numpy as np
import psutil
from app.shared.heap import return_free_pages, return_large_blocks

return_large_blocks()
process = psutil.Process()

def work():
    before.append(process.memory_info().rss)
    blocks = [np.ones(2**15) for _ in range(256)]  # of 256 KiB
    pinned.extend(np.ones(2**10) for _ in range(8))
    del blocks

before, pinned = [], []
thread = threading.Thread(target=work)
thread.start()
thread.join()
kept = process.memory_info().rss
return_free_pages()
print((kept - before[0]) // 2**20, (process.memory_info().rss - before[0]) // 2**20)
"""

GARBAGE = """
import gc, sys, threading, time
from PySide6.QtCore import QCoreApplication
from app.shared.heap import collect_between_events

class Cycle:
    def __init__(self): self.itself = self
    def __del__(self): deleted_in.add(threading.current_thread() is threading.main_thread())

def litter():
    for _ in range(5000):
        Cycle()

deleted_in = set()
application = QCoreApplication([])
collector = collect_between_events()
assert gc.get_freeze_count() > 1000
thread = threading.Thread(target=litter)
thread.start()
thread.join()
until_s = time.monotonic() + 20
while not deleted_in and time.monotonic() < until_s:
    application.processEvents()
print(deleted_in)
"""


def printed(script: str) -> str:
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.strip()


def test_garbage_of_any_thread_is_deleted_in_the_windows() -> None:
    assert printed(GARBAGE) == "{True}"


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's heap")
@pytest.mark.parametrize(("script", "least_mib"), [(LARGE_BLOCKS, 48), (SMALL_BLOCKS, 32)])
def test_large_blocks_and_free_pages_of_a_threads_heap_are_returned(script: str, least_mib: int) -> None:
    most_mib, left_mib = map(int, printed(script).split())
    assert most_mib > least_mib and left_mib < 8
