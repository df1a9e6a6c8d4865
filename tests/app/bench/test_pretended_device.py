from __future__ import annotations

import threading
from typing import Any

import numpy as np

from app.bench.pretended_device import PretendedCard, PretendedStream


def test_the_device_asks_for_blocks_and_hears_the_first_sound() -> None:
    asked = threading.Event()
    blocks = 0

    def callback(outdata: np.ndarray, frames: int, _time: Any, _status: Any) -> None:
        nonlocal blocks
        blocks += 1
        outdata[:] = 0.5 if blocks > 3 else 0.0
        assert outdata.shape == (frames, 2) == (64, 2)
        if blocks == 3:
            silent.append(stream.sounded_s)
        if blocks > 5:
            asked.set()

    silent: list[float | None] = []
    stream = PretendedStream(48_000, 64, callback)
    stream.start()
    assert asked.wait(10)
    assert silent == [None]
    assert stream.sounded_s is not None
    stream.close()
    assert "pretended-device" not in [thread.name for thread in threading.enumerate()]


def test_a_player_opens_it() -> None:
    card, problems = PretendedCard(512), []
    with card.player(problems.append) as player:
        player.open(buffer_s=0.05)
        while player.status().changes_done == 0:
            threading.Event().wait(0.01)
        assert player.status().device is not None
        assert card.output is not None
        assert card.output.block_frames == 512
    assert problems == []
    assert card.stream is not None
    assert not card.stream.active
