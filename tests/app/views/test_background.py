"""Work in a thread of its own: the latest job alone, nothing of an abandoned one, and nothing left at the end."""

import threading
from collections.abc import Callable, Iterator

import pytest
from pytestqt.qtbot import QtBot

from app.shared import worker
from app.shared.worker import Cancelled, Job
from app.views.background import Background
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


def test_a_job_reports_here(qtbot, background, monkeypatch):
    monkeypatch.setattr(worker, "REPORT_EVERY_S", 60.0)  # each takes a breath, which may be long
    here, seen = threading.get_ident(), []
    background.progressed.connect(lambda *values: seen.append((*values, threading.get_ident())))

    def work(job: Job) -> str:
        assert threading.get_ident() != here
        for count in range(20):
            job.report(0.05 * count, "words", so_far=count if count >= 18 else None)
        return "whole"

    with qtbot.waitSignal(background.finished) as finished:
        background.start(work)
        assert background.busy
    assert finished.args == ["whole"] and not background.busy
    assert seen == [(0.05 * count, "words", so_far, here) for count, so_far in ((0, None), (18, 18), (19, 19))]


def test_the_latest_job_alone_is_heard_and_nothing_of_an_abandoned_one(qtbot, background):
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


def test_a_stopped_job_reports_its_end_and_one_may_be_waited_for(qtbot, background):
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


def test_errors_are_reported_and_the_thread_lives_on(qtbot, background):
    for error, message, has_details in (
        (PresetError("x: broken"), "x: broken", False),
        (ZeroDivisionError("none"), "Computing failed: none", True),
    ):

        def fail(job: Job, error: Exception = error) -> None:
            raise error

        with qtbot.waitSignal(background.failed) as failed:
            background.start(fail)
        assert (failed.args[0], bool(failed.args[1])) == (message, has_details)
    with qtbot.waitSignal(background.finished):
        background.start(lambda job: None)
