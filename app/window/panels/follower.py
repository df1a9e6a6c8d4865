"""A thread that computes what is made from a take, as the take grows."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable

from app.analysis.growing import Growing
from app.shared.thread_priority import Rank, step_back

LOOK_AGAIN_S = 0.03  # while the take has nothing new


class Follower:
    """Does one work at a time, the latest. The thread starts at once and ends with `close`.

    Args:
        on_fault: is called with a message and its details where a work fails, in the follower's thread.
    """

    def __init__(self, name: str, on_fault: Callable[[str, str], None]) -> None:
        self._on_fault = on_fault
        self._mailbox = threading.Condition()
        self._work: Growing | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def follow(self, work: Growing | None) -> None:
        """Does this work instead of the last; None: none. Returns at once."""
        with self._mailbox:
            self._work = work
            self._mailbox.notify()

    def close(self) -> None:
        """Ends the thread, waiting 10 s at most; may be called again."""
        with self._mailbox:
            self._closing = True
            self._mailbox.notify()
        self._thread.join(10)

    def _run(self) -> None:
        step_back(Rank.BACKGROUND)
        while True:
            with self._mailbox:
                self._mailbox.wait_for(lambda: self._work is not None or self._closing)
                if self._closing:
                    return
                work = self._work
            assert work is not None
            try:
                moved = work.advance()
                done = work.complete
            except Exception as error:  # shown to the user; the thread goes on
                self._on_fault(f"A view cannot be computed: {error}", traceback.format_exc())
                moved, done = False, True
            with self._mailbox:
                if work is self._work and done:
                    self._work = None
                elif work is self._work and not moved and not self._closing:
                    self._mailbox.wait(LOOK_AGAIN_S)
            del work  # it holds a take, which may not be needed any more
