"""Memory returned to the system, garbage deleted in the window's thread, and threads that step back alone."""

import os
import subprocess
import sys
import threading

import pytest

from app.shared.thread_priority import NICEST, Rank, lower_priority

# in processes of their own: this one's heap has seen many blocks already
BLOCKS = """
import threading
import numpy as np
import psutil
from app.shared.heap import return_free_pages, return_large_blocks

return_large_blocks()
process = psutil.Process()

def work(count, size):
    used.append(process.memory_info().rss)
    blocks = [np.ones(size) for _ in range(count)]
    pinned.extend(np.ones(2**10) for _ in range(32))  # what would keep a heap from shrinking
    used.append(process.memory_info().rss)

used, pinned = [], []
"""
LARGE = BLOCKS + "work(32, 2**18)"  # of 2 MiB
SMALL = BLOCKS + "thread = threading.Thread(target=work, args=(256, 2**15)); thread.start(); thread.join()"
SMALL += "\nreturn_free_pages()"
USED = "\nprint((used[1] - used[0]) // 2**20, (process.memory_info().rss - used[0]) // 2**20)"

GARBAGE = """
import gc, sys, threading, time
from PySide6.QtCore import QCoreApplication
from app.shared.heap import collect_between_events

class Cycle:
    def __init__(self): self.itself = self
    def __del__(self): deleted_in.add(threading.current_thread() is threading.main_thread())

deleted_in = set()
application = QCoreApplication([])
collector = collect_between_events()
assert gc.get_freeze_count() > 1000
thread = threading.Thread(target=lambda: [Cycle() for _ in range(5000)] and None)
thread.start()
thread.join()
until_s = time.monotonic() + 20
while not deleted_in and time.monotonic() < until_s:
    application.processEvents()
print(deleted_in)
"""
ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="glibc's heap, and a niceness by thread")


def printed(script: str) -> str:
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.strip()


def test_garbage_of_any_thread_is_deleted_in_the_windows():
    assert printed(GARBAGE) == "{True}"


@ON_LINUX
@pytest.mark.parametrize(("script", "least_mib"), [(LARGE, 48), (SMALL, 32)])
def test_large_blocks_and_free_pages_of_a_threads_heap_are_returned(script, least_mib):
    most_mib, left_mib = map(int, printed(script + USED).split())
    assert most_mib > least_mib and left_mib < 8


@ON_LINUX
def test_a_thread_and_what_it_starts_step_back_and_no_other(monkeypatch):
    def niceness() -> int:
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    found, before = [], niceness()

    def work() -> None:
        lower_priority(Rank.RENDERING)
        helper = threading.Thread(target=lambda: found.append(niceness()))
        helper.start()
        helper.join()
        found.append(niceness())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == 2 * [min(before + Rank.RENDERING, NICEST)] and niceness() == before

    def refuse(*_: int) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "setpriority", refuse)
    lower_priority(Rank.BACKGROUND)  # nothing happens
