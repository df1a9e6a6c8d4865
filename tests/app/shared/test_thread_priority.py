"""The window goes first; threads that step back do so alone."""

import os
import sys
import threading

import pytest

from app.shared.thread_priority import NICEST, Rank, lower_priority

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a niceness by thread")


def niceness() -> int:
    return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())


def test_a_thread_and_what_it_starts_step_back_and_no_other() -> None:
    found: dict[str, int] = {}

    def work() -> None:
        lower_priority(Rank.RENDERING)
        found["itself"] = niceness()
        helper = threading.Thread(target=lambda: found.update(helper=niceness()))
        helper.start()
        helper.join()

    before = niceness()
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    expected = min(before + Rank.RENDERING, NICEST)
    assert found == {"itself": expected, "helper": expected}
    assert niceness() == before


def test_where_the_system_refuses_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: int) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "setpriority", refuse)
    lower_priority(Rank.BACKGROUND)
