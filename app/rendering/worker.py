"""The render worker: the thread that renders pictures and signals, always of the latest request alone.

A request that differs only in listening points, slow motion or other presets keeps the pictures of the present one.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from app.rendering.job import PluckJob
from app.rendering.note_sound import RenderRequest
from app.rendering.rendering import RenderListener
from app.rendering.subject import Loaded, Subject
from app.shared.heap import return_free_pages
from app.shared.thread_priority import Rank, lower_priority
from engine.presets import PresetError

if TYPE_CHECKING:
    from app.rendering.blow_job import BlowJob

TIDY_AFTER_S = 1.0  # without anything to render, until free memory is given back
IN_STEP_S = 0.5  # for how long after its pluck a motion may be held in step with its sound
LEAD_S = 0.08  # how far ahead of the sound it is rendered meanwhile
LOOK_AGAIN_S = 0.01
PATIENCE_S = 5.0  # for the first sound


class RenderWorker:
    """A thread with a mailbox that holds the latest request.

    Args:
        load: returns a preset's model and truth; called in the worker's thread.
        hurried: whether plucks are being played. A new motion is then rendered no faster than its sound for a while:
            plucks in quick succession leave processor time for all else.
        sounds: whether a pluck would sound. The first motion, which may load torch, waits for that, for some seconds.
    """

    def __init__(
        self,
        listener: RenderListener,
        load: Callable[[Subject], Loaded],
        hurried: Callable[[], bool] = lambda: False,
        sounds: Callable[[], bool] = lambda: True,
    ) -> None:
        self._listener = listener
        self._load = load
        self._hurried = hurried
        self._sounds = sounds
        self._mailbox = threading.Condition()
        self._request: RenderRequest | None = None
        self._closing = False
        self._helper = ThreadPoolExecutor(1, "render-helper", lower_priority, (Rank.RENDERING,))
        self._thread = threading.Thread(target=self._run, name="render-worker", daemon=True)
        self._thread.start()

    def submit(self, request: RenderRequest) -> None:
        """Replace a request that waits and abandon another motion being rendered. Any thread; return at once."""
        with self._mailbox:
            self._request = request
            self._mailbox.notify()

    def close(self) -> None:
        """End the thread; may be called again."""
        with self._mailbox:
            self._closing = True
            self._mailbox.notify()
        self._thread.join(10)
        self._helper.shutdown()  # at most a block

    # All below runs in the worker's thread.

    def _run(self) -> None:
        lower_priority(Rank.RENDERING)
        ends_s = time.monotonic() + PATIENCE_S
        while not (self._closing or self._sounds() or time.monotonic() > ends_s):
            time.sleep(LOOK_AGAIN_S)
        job: PluckJob | BlowJob | None = None
        untidy = False  # whether anything was rendered since free memory was given back
        while True:
            with self._mailbox:
                waits = job is None or job.idle
                if job is not None and not waits and self._request is None and self._in_step(job):
                    self._mailbox.wait(LOOK_AGAIN_S)
                while waits and self._request is None and not self._closing:
                    # not while keys are played: it locks the heap, which the sound server's client uses too
                    if not self._mailbox.wait(TIDY_AFTER_S if untidy else None) and untidy and not self._hurried():
                        return_free_pages()
                        untidy = False
                if self._closing:
                    return
                request, self._request = self._request, None
            if request is not None:
                if job is not None and request.same_motion(job.request):
                    job.ask_again(request)
                    job.announce()
                else:
                    job = self._job(request)
            assert job is not None
            if self._in_step(job):
                continue
            try:
                job.advance()
                untidy = True
            except PresetError as error:
                job = None
                self._listener.render_failed(str(error), "")
            except Exception as error:  # reported to the user; the worker continues
                job = None
                self._listener.render_failed(f"Rendering failed: {error}", traceback.format_exc())

    def _job(self, request: RenderRequest) -> PluckJob | BlowJob:
        if request.struck is None:
            return PluckJob(request, self._load, self._listener, self._helper)
        from app.rendering.blow_job import BlowJob  # and torch

        return BlowJob(request, self._load, self._listener, self._helper)

    def _in_step(self, job: PluckJob | BlowJob) -> bool:
        """Return True if the motion is far enough ahead of its sound for now."""
        return job.age_s < IN_STEP_S and job.rendered_s > job.age_s + LEAD_S and self._hurried()
