"""The playhead as heard lags behind the playhead as rendered."""

import pytest
from app.audio.timeline import Timeline


def test_the_heard_position_is_found_within_queued_blocks() -> None:
    timeline = Timeline(7)
    assert timeline.position_at(-50) == 7
    timeline.note(100, 1000, moving=False)
    timeline.note(200, 1100, moving=True)
    timeline.note(300, 5100, moving=True)  # a jump to 5000 at its beginning
    timeline.note(400, 5100, moving=False)
    heard = [timeline.position_at(frame) for frame in (50, 100, 101, 200, 201, 300, 350, 999)]
    assert heard == [1000, 1000, 1001, 1100, 5001, 5100, 5100, 5100]


@pytest.mark.parametrize("frame", [0, 30])
def test_the_position_is_never_negative(frame: int) -> None:
    timeline = Timeline(0)
    timeline.note(64, 20, moving=True)
    assert timeline.position_at(frame) == 0


def test_blocks_that_are_taken_back_were_never_heard() -> None:
    timeline = Timeline(0)
    timeline.note(100, 100, moving=True)
    timeline.note(200, 200, moving=True)
    timeline.note(300, 300, moving=True)
    timeline.take_back(100)
    timeline.note(200, 5100, moving=True)  # a jump to 5000 instead
    assert [timeline.position_at(frame) for frame in (50, 101, 200, 300)] == [50, 5001, 5100, 5100]
