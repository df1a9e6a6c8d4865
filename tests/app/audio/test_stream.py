"""The callback, called directly: one ready block or zeros, and nothing that could go wrong."""

import threading
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from app.audio.stream import AHEAD_S, BLOCK_FRAMES, BUFFER_S, SOON_S, OutputStream

from app.audio import AudioDevice, AudioUnavailable, ProblemKind
from app.audio import stream as stream_module


@pytest.fixture
def stream(headphones: AudioDevice, open_fake: Any) -> OutputStream:
    return OutputStream(headphones, open_device=open_fake)


def settle(stream: OutputStream, raw: Any) -> None:
    """Lets the device play silence until underruns count, and leaves the queue full."""
    for _ in range(50):
        raw.tick()
        assert stream.wait_for_space(0)
        stream.write(block(0))


def block(value: float) -> np.ndarray:
    return np.full((BLOCK_FRAMES, 2), value, np.float32)


def test_it_starts_full_of_silence(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    assert raw.active
    assert stream.queued_blocks == stream.prompt_blocks
    assert not raw.tick().any()
    assert stream.underruns == 0


def test_blocks_come_out_in_order_and_whole(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    waiting = stream.frames_queued // BLOCK_FRAMES
    heard = []
    for value in range(1, 20):
        heard.append(raw.tick()[[0, -1], [0, 1]].tolist())
        assert stream.wait_for_space(0)
        stream.write(block(value))
    assert heard == [[0.0, 0.0]] * waiting + [[float(v)] * 2 for v in range(1, 20 - waiting)]
    assert stream.callback_count == 19
    assert stream.frames_written == 19 * BLOCK_FRAMES
    assert stream.frames_queued == (19 + waiting) * BLOCK_FRAMES


def test_the_queue_is_bounded(stream: OutputStream) -> None:
    assert stream.frames_queued <= 0.03 * stream.rate_hz
    while stream._free:
        stream.write(block(0))
    assert stream.frames_queued <= 0.03 * stream.rate_hz + (AHEAD_S + 0.02) * stream.rate_hz
    with pytest.raises(RuntimeError, match="queue is full"):
        stream.write(block(1))


def fill(stream: OutputStream) -> None:
    while stream.wait_for_space(0):
        stream.write(block(0))


def go_ahead(stream: OutputStream, value: float) -> int:
    """Fills the room that is open; returns with how many blocks."""
    written = 0
    while stream.wait_for_space(0, ahead=True):
        stream.write(block(value))
        written += 1
    return written


def test_it_goes_ahead_at_twice_the_pace(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    soon = go_ahead(stream, 0)
    assert soon == pytest.approx(SOON_S * stream.rate_hz / BLOCK_FRAMES, abs=1)
    for played in range(1, 11):
        raw.tick()
        assert go_ahead(stream, played) == 2
        assert stream.queued_blocks == stream.prompt_blocks + soon + played
    assert not stream.wait_for_space(0)


def test_what_may_change_by_itself_is_only_a_little_ahead(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    for _ in range(20):
        fill(stream)
        ready_s = stream.queued_blocks * BLOCK_FRAMES / stream.rate_hz
        assert ready_s == pytest.approx(BUFFER_S + SOON_S, abs=0.01)
        raw.tick()


def test_what_was_mixed_ahead_stays_until_it_is_replaced(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    prompt = stream.prompt_blocks
    for _ in range(10):
        raw.tick()
        go_ahead(stream, 1)
    count, queued, frames = stream.changeable_blocks, stream.queued_blocks, stream.frames_queued
    assert count == queued - (prompt - 1)
    assert stream.replace(count, [block(2), block(3)])
    assert stream.frames_queued == frames + (2 - count) * BLOCK_FRAMES
    again = go_ahead(stream, 4)
    assert stream.queued_blocks < queued, "it catches up anew, in small steps"
    heard = [raw.tick()[0, 0] for _ in range(stream.queued_blocks)]
    assert heard == [1] * (prompt - 1) + [2, 3] + [4] * again
    assert stream.underruns == 0


def test_what_may_be_mended_can_be_replaced_in_the_longest_queue(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    for _ in range(80):
        go_ahead(stream, 1)
        queued, count = stream.queued_blocks, stream.mendable_blocks
        assert stream.replace(count, [block(2)] * count)
        assert stream.queued_blocks == queued
        stream._replaced_at = 0  # as far ahead as it ever goes
        raw.tick()
    assert 0 < count < queued - 2


def test_nothing_is_replaced_that_the_device_has_come_to(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    for _ in range(10):
        raw.tick()
        go_ahead(stream, 1)
    count = stream.changeable_blocks
    for _ in range(stream.prompt_blocks - 1):
        raw.tick()
    for _ in range(50):  # and no buffer is lost
        queued = stream.queued_blocks
        assert not stream.replace(count, [block(2)])
        assert stream.queued_blocks == queued
    assert {raw.tick()[0, 0] for _ in range(queued)} == {1}
    assert stream.underruns == 0


def test_waiting_for_a_deep_queue_to_drain_ends_with_each_block(stream: OutputStream, raw_streams: list) -> None:
    """Its caller has commands to look after: a queue that may go no further ahead holds it up no longer."""
    (raw,) = raw_streams
    for _ in range(20):
        raw.tick()
        while stream.wait_for_space(0, ahead=True):
            stream.write(block(0))
    raw.tick()
    raw.tick()
    began_s = time.monotonic()
    assert not stream.wait_for_space(5.0)
    assert not stream.wait_for_space(5.0)
    assert time.monotonic() - began_s < 1.0


def test_waiting_ends_when_it_is_told_to(stream: OutputStream, raw_streams: list) -> None:
    """A command need not wait for the device's next block to be looked at."""
    fill(stream)
    began_s = time.monotonic()
    threading.Timer(0.05, stream.stop_waiting).start()
    assert not stream.wait_for_space(5.0)
    assert 0.04 < time.monotonic() - began_s < 2.0


def test_going_ahead_has_an_end(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    for _ in range(200):
        raw.tick()
        while stream.wait_for_space(0, ahead=True):
            stream.write(block(0))
    assert AHEAD_S <= stream.queued_blocks * BLOCK_FRAMES / stream.rate_hz < AHEAD_S + 0.04


def test_an_empty_queue_gives_zeros_and_counts(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    for _ in range(50):
        assert not raw.tick().any()
    settling = 23  # callbacks that fill 0.1 s and the device's own 20 ms, before which nothing is audible
    assert stream.underruns == 50 - settling
    assert stream.frames_written == stream.frames_queued
    assert stream.wait_for_space(0)
    stream.write(block(0.5))
    assert (raw.tick() == 0.5).all()


def test_gaps_that_the_device_notices_count_too(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    settle(stream, raw)
    raw.status = SimpleNamespace(output_underflow=True)
    raw.tick()
    raw.status = SimpleNamespace(output_underflow=False)
    raw.tick()
    assert stream.underruns == 1


def test_a_longer_buffer_keeps_more_ready(headphones: AudioDevice, open_fake: Any) -> None:
    stream = OutputStream(headphones, 0.2, open_device=open_fake)
    assert 0.19 < stream.frames_queued / stream.rate_hz <= 0.2


def test_a_device_with_a_long_buffer_gets_a_longer_queue(headphones: AudioDevice, open_fake: Any) -> None:
    def open_slow(*arguments: Any) -> Any:
        raw = open_fake(*arguments)
        raw.latency = 0.2
        return raw

    stream = OutputStream(headphones, open_device=open_slow)
    assert 0.09 < stream.frames_queued / stream.rate_hz <= 0.1


def test_a_wrong_block_size_from_the_driver_gives_zeros(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams
    settle(stream, raw)
    raw.shape = (100, 2)
    assert not raw.tick().any()
    assert stream.underruns == 1


def test_a_device_with_one_channel_gets_one(open_fake: Any, raw_streams: list) -> None:
    stream = OutputStream(AudioDevice("Speaker", "Test API", 48_000, channels=1), open_device=open_fake)
    (raw,) = raw_streams
    while stream.frames_written < stream.frames_queued:
        raw.tick()
    assert stream.wait_for_space(0)
    stream.write(block(0.5))
    assert raw.tick().shape == (BLOCK_FRAMES, 1)
    assert stream.frames_written == stream.frames_queued


@pytest.mark.parametrize("rate_hz", [8_000, 44_100, 192_000])
def test_the_queue_is_short_at_any_rate(rate_hz: int, open_fake: Any) -> None:
    stream = OutputStream(AudioDevice("Headphones", "Test API", rate_hz), open_device=open_fake)
    blocks = stream.frames_queued // stream.block_frames
    assert blocks == 2 or 0.015 < stream.frames_queued / rate_hz <= 0.025


def test_a_device_that_cannot_start_is_closed(headphones: AudioDevice, open_fake: Any) -> None:
    raws = []

    def open_refusing(*arguments: Any) -> Any:
        raws.append(open_fake(*arguments))
        raws[0].refusal = OSError("Device or resource busy")
        return raws[0]

    with pytest.raises(AudioUnavailable) as caught:
        OutputStream(headphones, open_device=open_refusing)
    assert caught.value.kind is ProblemKind.BUSY
    assert raws[0].calls == ["start", "abort", "close"]


def test_a_callback_that_stands_still_is_a_stall_and_at_last_a_lost_device(
    headphones: AudioDevice, open_fake: Any, raw_streams: list, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now_s)
    stream = OutputStream(headphones, open_device=open_fake)
    (raw,) = raw_streams

    def state_after(seconds: float, ticking: bool) -> str:
        nonlocal now_s
        stalled = lost = False
        for _ in range(round(seconds / 0.05)):
            now_s += 0.05
            if ticking:
                raw.tick()
            lost, stalled = stream.lost(), stream.stalled()
        return "lost" if lost else "stalled" if stalled else "alive"

    assert state_after(stream_module.START_GRACE_S - 0.1, ticking=False) == "alive", "slow to start"
    assert state_after(5.0, ticking=True) == "alive"
    assert state_after(0.7, ticking=False) == "alive"
    assert state_after(0.1, ticking=True) == "alive"
    now_s += 3600.0  # the computer slept
    assert not stream.lost()
    assert not stream.stalled()
    assert state_after(1.7, ticking=False) == "stalled"
    assert state_after(0.1, ticking=True) == "alive"
    assert state_after(stream_module.LOST_AFTER_S + 0.2, ticking=False) == "lost"
    assert state_after(0.1, ticking=True) == "alive"
    raw.active = False
    assert stream.lost()


def test_closing_forgives_a_device_that_cannot(stream: OutputStream, raw_streams: list) -> None:
    (raw,) = raw_streams

    def fail() -> None:
        raise OSError("gone")

    raw.abort = fail
    stream.close()
    stream.close()
    assert raw.calls == ["start", "close", "close"]
