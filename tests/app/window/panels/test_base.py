"""When the long jobs of a panel rest, and on how many cores they compute."""

from __future__ import annotations

import time
from collections.abc import Iterator
from threading import Event

import pytest
import torch
from pytestqt.qtbot import QtBot

from app.presets.library import Library
from app.session.choices import Session
from app.shared.worker import Job
from app.window.panels import Panel, base


class AnyPanel(Panel):
    key = "any"


@pytest.fixture
def panel(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> Iterator[Panel]:
    monkeypatch.setattr(base, "UNSEEN_S", 60.0)  # nobody looks here, however late a job begins
    made = AnyPanel(Session(), Library([]))
    yield made
    made.end()


def test_a_job_rests_while_a_pluck_is_rendered(qtbot: QtBot, panel: Panel) -> None:
    class Growing:
        complete = False
        looked = 0

        @property
        def ready_frames(self) -> int:
            self.looked += 1
            self.complete = self.looked >= 5
            return self.looked

    take, done = Growing(), []
    panel.take_started(take)  # type: ignore[arg-type]

    def work(job: Job) -> None:
        job.report(0.5)
        done.append(take.complete)

    with qtbot.waitSignal(panel.background.finished):
        panel.compute(work)
    assert done == [True]


def test_a_take_that_no_longer_grows_is_not_waited_for(qtbot: QtBot, panel: Panel) -> None:
    class Abandoned:
        complete = False
        ready_frames = 100

    panel.take_started(Abandoned())  # type: ignore[arg-type]
    with qtbot.waitSignal(panel.background.finished):
        panel.compute(lambda job: job.report(0.5))


def test_a_job_rests_while_nobody_looks(qtbot: QtBot, panel: Panel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base, "UNSEEN_S", 0.3)
    shares: list[float] = []
    ended: list[object] = []
    panel.background.finished.connect(ended.append)
    panel.background.progressed.connect(lambda share: shares.append(share))
    resting = Event()

    def work(job: Job) -> None:
        time.sleep(base.UNSEEN_S + 0.1)
        resting.set()
        job.report(0.5, so_far="half")

    panel.compute(work)
    assert resting.wait(10)
    qtbot.wait(200)
    assert shares == []

    def seen() -> bool:
        panel.look()  # again and again: each look holds for UNSEEN_S
        return bool(ended)

    qtbot.waitUntil(seen)
    assert shares == [0.5]


def test_a_job_has_one_core_and_gives_the_others_back(qtbot: QtBot, panel: Panel) -> None:
    usual = torch.get_num_threads()
    with qtbot.waitSignal(panel.background.finished) as finished:
        panel.compute(lambda job: torch.get_num_threads())
    assert finished.args == [1]
    assert torch.get_num_threads() == usual
