"""The thread that keeps up with a take: takes the latest work, tells of faults, ends."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from pytestqt.qtbot import QtBot

from app.window.panels.follower import Follower


class Counting:
    """A work of ten steps, of which `allowed` may be done."""

    def __init__(self, allowed: int = 10, broken: bool = False) -> None:
        self.done, self.allowed, self.broken = 0, allowed, broken

    @property
    def complete(self) -> bool:
        return self.done == 10

    def advance(self) -> bool:
        if self.broken:
            raise ValueError("of no use")
        if self.done >= self.allowed:
            return False
        self.done += 1
        return True


@pytest.fixture
def faults() -> list[tuple[str, str]]:
    return []


@pytest.fixture
def follower(faults: list[tuple[str, str]]) -> Iterator[Follower]:
    made = Follower("test-follower", lambda *fault: faults.append(fault))
    yield made
    made.close()
    made.close()
    assert "test-follower" not in [thread.name for thread in threading.enumerate()]


def test_it_goes_on_when_there_is_more(qtbot: QtBot, follower: Follower) -> None:
    work = Counting(allowed=4)
    follower.follow(work)
    qtbot.waitUntil(lambda: work.done == 4)
    work.allowed = 10
    qtbot.waitUntil(lambda: work.complete)


def test_only_the_latest_work_is_done(qtbot: QtBot, follower: Follower) -> None:
    old, new = Counting(allowed=3), Counting()
    follower.follow(old)
    qtbot.waitUntil(lambda: old.done == 3)
    follower.follow(new)
    qtbot.waitUntil(lambda: new.complete)
    old.allowed = 10
    qtbot.wait(100)
    assert old.done == 3


def test_a_fault_is_told_once_and_the_next_work_is_done(
    qtbot: QtBot, follower: Follower, faults: list[tuple[str, str]]
) -> None:
    follower.follow(Counting(broken=True))
    qtbot.waitUntil(lambda: bool(faults))
    work = Counting()
    follower.follow(work)
    qtbot.waitUntil(lambda: work.complete)
    assert len(faults) == 1
    assert "of no use" in faults[0][0]
    assert "Traceback" in faults[0][1]
