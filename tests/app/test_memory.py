from __future__ import annotations

import gc
import sys

import numpy as np
import psutil
import pytest

from app.memory import return_large_blocks, spare_the_collector


def test_what_is_loaded_is_spared() -> None:
    try:
        spare_the_collector()
        assert gc.get_freeze_count() > 1000
    finally:
        gc.unfreeze()


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's heap")
def test_large_blocks_are_returned() -> None:
    return_large_blocks()
    process = psutil.Process()
    before = process.memory_info().rss
    blocks = [np.ones(2**18) for _ in range(32)]  # of 2 MiB
    pinned = [np.ones(2**10) for _ in range(32)]  # what would keep a heap from shrinking
    assert process.memory_info().rss > before + 48 * 2**20
    del blocks
    assert process.memory_info().rss < before + 8 * 2**20
    assert len(pinned) == 32
