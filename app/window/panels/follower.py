"""A thread that keeps what is computed from a take up with the take as it grows."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable

from app.analysis.growing import Growing
from app.shared.thread_priority import Rank, step_back

LOOK_AGAIN_S = 0.03  # while the take has nothing new


class Follower:
    """Holds one work at a time, the latest; it ends with `close`.

    `on_fault` hears of a work that cannot go on (a message and its details), in the follower's thread.
    """

    def __init__(self, name: str, on_fault: Callable[[str, str], None]) -> None:
        self._on_fault = on_fault
        self._mailbox = threading.Condition()
        self._work: Growing | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def follow(self, work: Growing | None) -> None:
        """Takes up another work, or rests. Returns at once."""
        with self._mailbox:
            self._work = work
            self._mailbox.notify()

    def close(self) -> None:
        """Ends the thread; may be called again."""
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
            except Exception as error:  # told to the user; the window lives on
                self._on_fault(f"A view cannot be computed: {error}", traceback.format_exc())
                moved, done = False, True
            with self._mailbox:
                if work is self._work and done:
                    self._work = None
                elif work is self._work and not moved and not self._closing:
                    self._mailbox.wait(LOOK_AGAIN_S)
            del work  # it holds a take, which nobody may want any more while this rests
