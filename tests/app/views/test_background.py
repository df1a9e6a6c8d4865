"""Work in a thread of its own: the latest job alone, nothing of an abandoned one, and nothing left at the end."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest
from pytestqt.qtbot import QtBot

from app.analysis.growing import keep_up
from app.shared import worker
from app.shared.worker import Cancelled, Job
from app.views.background import Background
from engine.presets import PresetError

NAME = "a thread of tests"


@pytest.fixture
def background(qtbot: QtBot, threads_begun: Callable[[], list[str]]) -> Iterator[Background]:
    made = Background(NAME)
    yield made
    made.close()
    made.close()
    assert threads_begun() == []


def test_a_job_reports_and_returns(qtbot: QtBot, background: Background) -> None:
    here, seen = threading.get_ident(), []
    background.progressed.connect(lambda *reported: seen.append((*reported, threading.get_ident())))

    def work(job: Job) -> str:
        assert threading.get_ident() != here
        job.report(0.5, "the first half", so_far="half")
        return "whole"

    with qtbot.waitSignal(background.finished) as finished:
        background.start(work)
        assert background.busy
    assert finished.args == ["whole"]
    assert seen == [(0.5, "the first half", "half", here)]
    assert not background.busy


def test_shares_are_reported_now_and_then_and_each_result_at_once(
    qtbot: QtBot, background: Background, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "REPORT_EVERY_S", 60.0)  # each takes a breath, which may be long
    seen: list[object] = []
    background.progressed.connect(lambda share, text, so_far: seen.append(so_far))

    def work(job: Job) -> None:
        for count in range(20):
            job.report(0.05 * count, so_far=count if count >= 18 else None)

    with qtbot.waitSignal(background.finished):
        background.start(work)
    assert seen == [None, 18, 19]


def endless(job: Job, under_way: threading.Event, gave_up: threading.Event) -> None:
    under_way.set()
    try:
        while True:
            job.report(0.1)
    except Cancelled:
        gave_up.set()
        raise


def test_the_latest_job_alone_is_heard(qtbot: QtBot, background: Background) -> None:
    under_way, gave_up, heard = threading.Event(), threading.Event(), []
    background.finished.connect(heard.append)
    background.start(lambda job: endless(job, under_way, gave_up))
    assert under_way.wait(10)
    background.start(lambda job: "skipped")
    background.start(lambda job: "last")
    qtbot.waitUntil(lambda: heard == ["last"])
    assert gave_up.is_set()


def test_what_was_said_before_a_cancel_does_not_arrive(qtbot: QtBot, background: Background) -> None:
    said, heard = threading.Event(), []
    background.finished.connect(heard.append)
    background.progressed.connect(lambda *reported: heard.append(reported))

    def work(job: Job) -> str:
        job.report(0.5, so_far="half")
        said.set()
        return "whole"

    background.start(work)
    assert said.wait(10)
    background.cancel()  # the signals wait in the window's queue
    background.start(lambda job: "another")
    qtbot.waitUntil(lambda: heard == ["another"])


def test_the_end_of_a_job_that_is_stopped_is_reported(qtbot: QtBot, background: Background) -> None:
    under_way, gave_up = threading.Event(), threading.Event()
    background.start(lambda job: endless(job, under_way, gave_up))
    assert under_way.wait(10)
    with qtbot.waitSignal(background.cancelled):
        background.stop()
    assert not background.busy


def test_a_job_can_be_finished_before_the_end(qtbot: QtBot, background: Background) -> None:
    under_way, done = threading.Event(), []

    def work(job: Job) -> None:
        under_way.set()
        for _ in range(50):
            job.report(0.1)
        done.append(True)

    background.start(work)
    assert under_way.wait(10)
    background.close(None, cancel=False)
    assert done == [True]


@pytest.mark.parametrize(
    ("error", "message", "has_details"),
    [(PresetError("x: broken"), "x: broken", False), (ZeroDivisionError("none"), "Computing failed: none", True)],
)
def test_errors_are_reported_and_the_thread_lives_on(
    qtbot: QtBot, background: Background, error: Exception, message: str, has_details: bool
) -> None:
    def fail(job: Job) -> None:
        raise error

    with qtbot.waitSignal(background.failed) as failed:
        background.start(fail)
    assert failed.args[0] == message
    assert bool(failed.args[1]) == has_details
    with qtbot.waitSignal(background.finished):
        background.start(lambda job: None)


class Counting:
    """Ten results, of which `allowed` can be computed."""

    def __init__(self, allowed: int = 10) -> None:
        self.done, self.allowed = 0, allowed

    @property
    def complete(self) -> bool:
        return self.done == 10

    def advance(self) -> bool:
        if self.done >= self.allowed:
            return False
        self.done += 1
        return True


def test_what_grows_is_kept_up_with_and_only_the_latest(qtbot: QtBot, background: Background) -> None:
    old, new = Counting(allowed=3), Counting(allowed=4)
    background.start(lambda job: keep_up(old, job))
    qtbot.waitUntil(lambda: old.done == 3)
    background.start(lambda job: keep_up(new, job))
    qtbot.waitUntil(lambda: new.done == 4)
    old.allowed = new.allowed = 10
    qtbot.waitUntil(lambda: new.complete)
    qtbot.wait(100)
    assert old.done == 3
