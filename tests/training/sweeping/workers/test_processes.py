from __future__ import annotations

import pytest

from training.sweeping.workers import Workers, fitted
from training.sweeping.workers import processes as module
from training.sweeping.workers.base import Ended, Noted, Task, given_up
from training.sweeping.workers.processes import process_workers


def test_a_plain_process_that_dies_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = Task("a", "ours", {}, "a", threads="two")  # type: ignore[arg-type]

    def until_it_ends(workers: Workers) -> Ended:
        while True:
            event = workers.next(60)
            if isinstance(event, Ended):
                return event
            assert isinstance(event, Noted) and event.text.endswith("died")

    with process_workers(fitted(2, device="cpu", workers=2)) as workers:
        assert isinstance(workers, module._ProcessWorkers)
        workers.start(wrong)
        workers._places[0].process.kill()
        event = workers.next(60)
        assert isinstance(event, Noted) and event.name == "a"
        ended = until_it_ends(workers)
        assert (ended.row, ended.final) == (None, False)
        assert "task.threads: must be a valid integer" in ended.error
        # one that kills process after process is given up, and the next task has a new one
        monkeypatch.setattr(module, "DEATHS", 0)
        workers._places[0].process.kill()  # before the task, which it would end at once
        workers._places[0].process.join()
        workers.start(wrong)
        assert until_it_ends(workers) == Ended("a", None, given_up(1), final=True)
        workers.start(wrong)
        assert "task.threads" in until_it_ends(workers).error
