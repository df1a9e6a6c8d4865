"""The render worker: the one thread that owns models and states while plucks are rendered.

It takes the latest request: a newer one abandons the older, unless that was struck; then it sounds to its end,
and the worker goes on with its sound beside the new one, as far as the computer keeps up. A request that differs only
in how the motion is listened to keeps the motion and makes its sound anew.
"""

from __future__ import annotations

import threading
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from app.memory import return_free_pages
from app.precedence import Rank, step_back
from app.rendering.job import Job
from app.rendering.loaded import Loaded
from app.rendering.request import RenderListener, RenderRequest
from engine.preset import PresetError, load_preset

KEPT_PRESETS = 4  # loaded ones, the latest used
TIDY_AFTER_S = 1.0  # without anything to render
LOST_S = 0.5  # an earlier pluck that is rendered so much too late ends, so that the latest is heard whole


class RenderWorker:
    """A thread with a mailbox that holds the latest request, and before it those that were struck."""

    def __init__(self, listener: RenderListener) -> None:
        self._listener = listener
        self._mailbox = threading.Condition()
        self._waiting: list[RenderRequest] = []
        self._closing = False
        self._stage: Job | None = None  # the latest; keeps its motion when it is done
        self._tails: list[Job] = []  # struck earlier, and not rendered to their ends
        self._presets: dict[Path, Loaded] = {}
        self._untidy = False  # something was rendered since free memory was given back
        self._helper = ThreadPoolExecutor(1, "render-helper", step_back, (Rank.RENDERING,))
        self._thread = threading.Thread(target=self._run, name="render-worker", daemon=True)
        self._thread.start()

    def submit(self, request: RenderRequest) -> None:
        """Replaces what waits, unless that was struck. Returns at once; any thread."""
        with self._mailbox:
            if self._waiting and not self._waiting[-1].struck:
                self._waiting.pop()
            self._waiting.append(request)
            self._mailbox.notify()

    def strike(self) -> None:
        """The latest request is one that shall sound to its end, whatever is asked for later. Any thread."""
        with self._mailbox:
            if self._waiting:
                self._waiting[-1] = replace(self._waiting[-1], struck=True)
            elif self._stage is not None:
                self._stage.struck = True

    def close(self) -> None:
        """Ends the thread; may be called again."""
        with self._mailbox:
            self._closing = True
            self._mailbox.notify()
        self._thread.join(10)
        self._helper.shutdown(wait=False)

    # All below runs in the worker's thread.

    def _run(self) -> None:
        step_back(Rank.RENDERING)
        while True:
            with self._mailbox:
                called = self._mailbox.wait_for(
                    lambda: bool(self._waiting) or self._closing or self._most_urgent() is not None,
                    TIDY_AFTER_S if self._untidy else None,
                )
                if self._closing:
                    self._stage, self._tails = None, []
                    return
                self._take_request()
            job = self._most_urgent()
            if job is not None:
                self._advance(job)
            if not called:
                return_free_pages()
            self._untidy = called

    def _take_request(self) -> None:
        stage = self._stage
        if not self._waiting or (stage is not None and stage.struck and not stage.started):
            return  # a struck pluck is heard of before the next one is begun
        request = self._waiting.pop(0)
        if stage is not None and request.same_motion(stage.request):
            stage.ask_again(request)
            return
        if stage is not None and stage.started and stage.struck:
            stage.leave_stage()
            self._tails.append(stage)
        elif stage is not None:
            stage.give_up()
        self._stage = Job(request, self._loaded, self._listener, self._helper)

    def _most_urgent(self) -> Job | None:
        """The job whose rendering is least ahead of its sound."""
        now_s = time.monotonic()
        tails, self._tails = self._tails, []
        for job in tails:
            if job.ahead_s(now_s) < -LOST_S:
                job.give_up()
            elif not job.idle:
                self._tails.append(job)
        jobs = [*self._tails, self._stage] if self._stage is not None and not self._stage.idle else self._tails
        return min(jobs, key=lambda job: job.ahead_s(now_s), default=None)

    def _advance(self, job: Job) -> None:
        try:
            job.advance()
        except PresetError as error:
            self._drop(job)
            self._listener.render_failed(str(error), "")
        except Exception as error:  # told to the user; the worker lives on
            self._drop(job)
            self._listener.render_failed(f"Rendering failed: {error}", traceback.format_exc())

    def _drop(self, job: Job) -> None:
        job.give_up()
        with self._mailbox:
            if job is self._stage:
                self._stage = None
            else:
                self._tails.remove(job)

    def _loaded(self, path: Path) -> Loaded:
        loaded = self._presets.pop(path, None) or Loaded(load_preset(path))
        self._presets[path] = loaded
        while len(self._presets) > KEPT_PRESETS:
            self._presets.pop(next(iter(self._presets)))
        return loaded
