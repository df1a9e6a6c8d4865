"""The panels' own threads: the latest job alone, nothing of an abandoned one, and nothing left at the end."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest
import torch
from pytestqt.qtbot import QtBot

from app.analysis.job import Cancelled, Job
from app.window.panels import _background
from app.window.panels._background import Background
from engine.presets import PresetError

NAME = "a thread of tests"


@pytest.fixture
def background(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> Iterator[Background]:
    monkeypatch.setattr(_background, "UNSEEN_S", 60.0)  # nobody looks here, however late a job begins
    made = Background(NAME)
    yield made
    made.close()
    assert NAME not in [thread.name for thread in threading.enumerate()]


def test_a_job_reports_and_returns(qtbot: QtBot, background: Background) -> None:
    here, seen = threading.get_ident(), []
    background.progressed.connect(lambda share, so_far: seen.append((share, so_far, threading.get_ident())))

    def work(job: Job) -> str:
        assert threading.get_ident() != here
        job.report(0.5, "half")
        return "whole"

    with qtbot.waitSignal(background.finished) as finished:
        background.start(work)
        assert background.busy
    assert finished.args == ["whole"]
    assert seen == [(0.5, "half", here)]
    assert not background.busy


def test_the_latest_job_alone_is_heard(qtbot: QtBot, background: Background) -> None:
    under_way, gave_up, heard = threading.Event(), threading.Event(), []
    background.finished.connect(heard.append)

    def endless(job: Job) -> None:
        under_way.set()
        try:
            while True:
                job.report(0.1)
        except Cancelled:
            gave_up.set()
            raise

    background.start(endless)
    assert under_way.wait(10)
    background.start(lambda job: "skipped")
    background.start(lambda job: "last")
    qtbot.waitUntil(lambda: heard == ["last"])
    assert gave_up.is_set()


def test_what_was_said_before_a_cancel_does_not_arrive(qtbot: QtBot, background: Background) -> None:
    said, heard = threading.Event(), []
    background.finished.connect(heard.append)
    background.progressed.connect(lambda *told: heard.append(told))

    def work(job: Job) -> str:
        job.report(0.5, "half")
        said.set()
        return "whole"

    background.start(work)
    assert said.wait(10)
    background.cancel()  # the signals wait in the window's queue
    background.start(lambda job: "another")
    qtbot.waitUntil(lambda: heard == ["another"])


def test_a_job_rests_while_a_pluck_is_rendered(qtbot: QtBot, background: Background) -> None:
    class Growing:
        complete = False
        looked = 0

        @property
        def ready_frames(self) -> int:
            self.looked += 1
            self.complete = self.looked >= 5
            return self.looked

    take, done = Growing(), []
    background.give_way_to(take)  # type: ignore[arg-type]

    def work(job: Job) -> None:
        job.report(0.5)
        done.append(take.complete)

    with qtbot.waitSignal(background.finished):
        background.start(work)
    assert done == [True]


def test_a_take_that_no_longer_grows_is_not_waited_for(qtbot: QtBot, background: Background) -> None:
    class Abandoned:
        complete = False
        ready_frames = 100

    background.give_way_to(Abandoned())  # type: ignore[arg-type]
    with qtbot.waitSignal(background.finished):
        background.start(lambda job: job.report(0.5))


def test_a_job_rests_while_nobody_looks(
    qtbot: QtBot, background: Background, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_background, "UNSEEN_S", 0.3)
    shares: list[float] = []
    ended: list[object] = []
    background.finished.connect(ended.append)
    background.progressed.connect(lambda share, _: shares.append(share))
    resting = threading.Event()

    def work(job: Job) -> None:
        time.sleep(_background.UNSEEN_S + 0.1)
        resting.set()
        job.report(0.5, "half")

    background.start(work)
    assert resting.wait(10)
    qtbot.wait(200)
    assert shares == []

    def seen() -> bool:
        background.look()  # again and again: each look holds for UNSEEN_S
        return bool(ended)

    qtbot.waitUntil(seen)
    assert shares == [0.5]


@pytest.mark.parametrize(
    ("error", "message", "has_details"),
    [(PresetError("x: broken"), "x: broken", False), (ZeroDivisionError("none"), "Computing failed: none", True)],
)
def test_errors_are_told_and_the_thread_lives_on(
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


def test_a_job_has_one_core_and_gives_the_others_back(qtbot: QtBot, background: Background) -> None:
    usual = torch.get_num_threads()
    with qtbot.waitSignal(background.finished) as finished:
        background.start(lambda job: torch.get_num_threads())
    assert finished.args == [1]
    assert torch.get_num_threads() == usual
