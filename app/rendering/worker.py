"""The render worker: the thread that renders pictures and signals, always of the latest request alone.

A request that differs only in listening points, slow motion or other presets keeps the pictures of the present one.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from app.rendering.job import RenderJob
from app.rendering.note_sound import NoteSound
from app.rendering.subject import Loaded, Subject
from app.shared.heap import return_free_pages
from app.shared.thread_priority import Rank, lower_priority
from app.shared.worker import Job, Worker
from engine.presets import PresetError

TIDY_AFTER_S = 1.0  # without anything to render, until free memory is given back
IN_STEP_S = 0.5  # after its pluck, for which a motion may be held in step with its sound
LEAD_S = 0.08  # how far ahead of the sound it is rendered meanwhile
LOOK_AGAIN_S = 0.01  # between two looks while it waits
PATIENCE_S = 5.0  # for which the first motion waits, at most, until a pluck would sound


class RenderWorker:
    """A worker that renders the latest request.

    Args:
        say: is called in the worker's thread, as by `RenderJob`, and with "failed" (message, details) where nothing
            can be rendered.
        load: returns a preset's model and truth; called in the worker's thread.
        hurried: whether plucks are being played. A new motion is then rendered no faster than its sound for a while:
            plucks in quick succession leave processor time for all else.
        sounds: whether a pluck would sound. The first motion, which may load torch, waits for that, for some seconds.
    """

    def __init__(
        self,
        say: Callable[..., None],
        load: Callable[[Subject], Loaded],
        hurried: Callable[[], bool] = lambda: False,
        sounds: Callable[[], bool] = lambda: True,
    ) -> None:
        self._say = say
        self._load = load
        self._hurried = hurried
        self._sounds = sounds
        self._patient_until_s = time.monotonic() + PATIENCE_S
        self._rendering: RenderJob | None = None  # the latest; the worker's thread alone has it
        self._helper = ThreadPoolExecutor(1, "render-helper", lower_priority, (Rank.RENDERING,))
        self._worker = Worker("render-worker", self._hear, (PresetError,), rank=Rank.RENDERING, doing="Rendering")

    def submit(self, request: NoteSound) -> None:
        """Replace a request that waits and abandon another motion being rendered; return at once."""
        self._worker.start(partial(self._render, request))

    def close(self) -> None:
        """End the thread; may be called again."""
        self._worker.close()
        self._helper.shutdown()  # at most a block

    # All below runs in the worker's thread.

    def _hear(self, _: Job, signal_name: str, *values: str) -> None:
        """Report the failure of a rendering, and forget it."""
        if signal_name == "failed":
            self._rendering = None
            self._say(signal_name, *values)

    def _render(self, request: NoteSound, job: Job) -> None:
        """Render a request block by block until nothing is left to do; `job.wait` raises where a newer one waits."""
        while not self._sounds() and time.monotonic() < self._patient_until_s:
            job.wait(LOOK_AGAIN_S)
        rendering = self._rendering
        if rendering is not None and request.same_motion(rendering.request):
            rendering.ask_again(request)
            rendering.announce()
        else:
            rendering = self._rendering = RenderJob(request, self._load, self._say, self._helper)
        while not rendering.idle:
            if self._is_in_step(rendering):
                job.wait(LOOK_AGAIN_S)
            else:
                rendering.advance()
                job.wait()
        job.wait(TIDY_AFTER_S)
        while self._hurried():  # it locks the heap, which the sound server's client uses too
            job.wait(TIDY_AFTER_S)
        return_free_pages()

    def _is_in_step(self, rendering: RenderJob) -> bool:
        """Return True if the motion is far enough ahead of its sound for now."""
        age_s = rendering.age_s
        return age_s < IN_STEP_S and rendering.rendered_s > age_s + LEAD_S and self._hurried()
