"""An export in a thread of its own, with progress, time left and cancelling."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from app.export.files import ExportCancelled, ExportError
from app.export.recipe import RecipeError
from app.shared.thread_priority import Rank, step_back
from engine.presets import PresetError
from engine.sources import Runaway

Tell = Callable[..., None]  # share, what is done, seconds left (None: not known; left out: by share)
Work = Callable[[Tell, Callable[[], bool]], object]  # is given `Tell`, and what says whether it is cancelled
TELL_EVERY_S = 0.05
BY_SHARE = -1.0  # seconds left: estimated from the share done and the time spent


class ExportJob(QObject):
    """Does `work` once. Its signals arrive in the window's thread; exactly one of the last three ends it."""

    progressed = Signal(float, str, object)  # share 0 … 1, what is being done, seconds left or None
    finished = Signal(object)  # what the work returned
    failed = Signal(str)  # why, for the user
    cancelled = Signal()

    def __init__(self, work: Work) -> None:
        super().__init__()
        self._work = work
        self._stop = threading.Event()
        self._told_s = 0.0
        self._thread = threading.Thread(target=self._run, name="export")

    def start(self) -> None:
        self._started_s = time.monotonic()
        self._thread.start()

    def cancel(self) -> None:
        """Asks the work to stop; returns at once."""
        self._stop.set()

    def wait(self) -> None:
        """Returns when the thread has ended."""
        self._thread.join()

    def _tell(self, share: float, text: str = "", left_s: float | None = BY_SHARE) -> None:
        now_s = time.monotonic()
        if now_s - self._told_s < TELL_EVERY_S:
            return  # the window draws no faster
        self._told_s = now_s
        if left_s == BY_SHARE:
            left_s = (now_s - self._started_s) * (1 - share) / share if share > 0 else None
        self.progressed.emit(share, text, left_s)

    def _run(self) -> None:
        step_back(Rank.BACKGROUND)
        try:
            result = self._work(self._tell, self._stop.is_set)
        except ExportCancelled:
            self.cancelled.emit()
        except (ExportError, PresetError, RecipeError, Runaway, ValueError) as error:
            self.failed.emit(str(error))
        except Exception as error:  # unforeseen, but the dialog must never wait for ever
            self.failed.emit(f"The export failed: {error!r}. Please report this.")
        else:
            self.finished.emit(result)
