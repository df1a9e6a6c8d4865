"""Work in a thread of its own: the latest job alone, nothing of an abandoned one, and nothing left at the end."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest
from pytestqt.qtbot import QtBot

from app.shared import worker
from app.shared.worker import Cancelled, Job
from app.views.background import Background
from app.window.panels.time_panel import keep_up
from engine.presets import PresetError
from tests.app.gestures import reported


class Endless:
    """A job that ends when it is cancelled."""

    def __init__(self) -> None:
        self.under_way, self.gave_up = threading.Event(), threading.Event()

    def __call__(self, job: Job) -> None:
        self.under_way.set()
        try:
            while True:
                job.report(0.1)
        except Cancelled:
            self.gave_up.set()
            raise


@pytest.fixture
def background(qtbot: QtBot, threads_begun: Callable[[], list[str]]) -> Iterator[Background]:
    made = Background("a thread of tests")
    yield made
    made.close()
    made.close()
    assert threads_begun() == []


def test_a_job_reports_and_returns_here(qtbot: QtBot, background: Background) -> None:
    here, seen = threading.get_ident(), []
    background.progressed.connect(lambda *values: seen.append((*values, threading.get_ident())))

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
    progress = reported(background.progressed)

    def work(job: Job) -> None:
        for count in range(20):
            job.report(0.05 * count, so_far=count if count >= 18 else None)

    with qtbot.waitSignal(background.finished):
        background.start(work)
    assert [so_far for _, _, so_far in progress] == [None, 18, 19]


def test_the_latest_job_alone_is_heard_and_nothing_of_an_abandoned_one(qtbot: QtBot, background: Background) -> None:
    endless, said, results = Endless(), threading.Event(), reported(background.finished)
    background.start(endless)
    assert endless.under_way.wait(10)
    background.start(lambda job: "skipped")
    background.start(lambda job: "last")
    qtbot.waitUntil(lambda: results == ["last"])
    assert endless.gave_up.is_set()
    progress = reported(background.progressed)

    def work(job: Job) -> str:
        job.report(0.5, so_far="half")
        said.set()
        return "whole"

    background.start(work)
    assert said.wait(10)
    background.cancel()  # the signals wait in the window's queue
    background.start(lambda job: "another")
    qtbot.waitUntil(lambda: results == ["last", "another"])
    assert progress == []


def test_a_job_that_is_stopped_reports_its_end_and_one_may_be_waited_for(
    qtbot: QtBot, background: Background
) -> None:
    endless, under_way, done = Endless(), threading.Event(), []
    background.start(endless)
    assert endless.under_way.wait(10)
    with qtbot.waitSignal(background.cancelled):
        background.stop()
    assert not background.busy

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
    assert (failed.args[0], bool(failed.args[1])) == (message, has_details)
    with qtbot.waitSignal(background.finished):
        background.start(lambda job: None)


class Counting:
    """Ten results, of which `allowed` can be computed."""

    def __init__(self, allowed: int) -> None:
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
    for growing in (old, new):
        background.start(lambda job, growing=growing: keep_up(growing, job))
        qtbot.waitUntil(lambda growing=growing: growing.done == growing.allowed)
    old.allowed = new.allowed = 10
    with qtbot.waitSignal(background.finished):  # of `new`: `old` was given up before it began
        pass
    assert (old.done, new.done) == (3, 10)
