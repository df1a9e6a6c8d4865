"""The render worker: the one thread that owns model and state while a pluck is rendered.

It takes the latest request only: a newer pluck abandons the older one at the next block; a request that differs
by its listening point or output rate alone keeps the motion and makes its sound anew.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import soxr
import torch
from numpy.typing import NDArray

from app.audio import Track
from app.rendering.take import SOURCES, Take
from engine.metrics import ErrorSums
from engine.pluck import Pluck
from engine.preset import Preset, PresetError, load_preset
from engine.sources import FULL_SCALE_M, ModelSource, Runaway, StringSource, TruthSource, project

FIRST_BLOCK_FRAMES = 256  # small, so that a pluck sounds at once
BLOCK_FRAMES = 2048


@dataclass(frozen=True)
class RenderRequest:
    """What to render; `sound_rate_hz` is the output device's."""

    preset: Path
    pluck: Pluck
    seconds: float
    listen: float
    sound_rate_hz: int

    def same_motion(self, other: RenderRequest | None) -> bool:
        """Whether only the sound made from the motion differs."""
        return other is not None and (self.preset, self.pluck, self.seconds) == (
            other.preset,
            other.pluck,
            other.seconds,
        )


class RenderListener(Protocol):
    """Hears of the worker's results, in the worker's thread."""

    def take_started(self, take: Take, track: Track) -> None:
        """A new pluck has its first block."""

    def track_replaced(self, take: Take, track: Track) -> None:
        """The same pluck is heard from another point, or at another rate."""

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        """All of it is there, and measured."""

    def render_failed(self, message: str, detail: str) -> None: ...


class RenderWorker:
    """A thread with a mailbox that holds one request, the latest."""

    def __init__(self, listener: RenderListener) -> None:
        self._listener = listener
        self._mailbox = threading.Condition()
        self._request: RenderRequest | None = None
        self._closing = False
        self._done: RenderRequest | None = None  # what `_take` was rendered from
        self._take: Take | None = None
        self._preset: Preset | None = None
        self._thread = threading.Thread(target=self._run, name="render-worker", daemon=True)
        self._thread.start()

    def submit(self, request: RenderRequest) -> None:
        """Replaces whatever waits. Returns at once; any thread."""
        with self._mailbox:
            self._request = request
            self._mailbox.notify()

    def close(self) -> None:
        """Ends the thread; may be called again."""
        with self._mailbox:
            self._closing = True
            self._mailbox.notify()
        self._thread.join(10)

    # All below runs in the worker's thread.

    def _run(self) -> None:
        while True:
            with self._mailbox:
                self._mailbox.wait_for(lambda: self._request is not None or self._closing)
                if self._closing:
                    return
                request, self._request = self._request, None
            assert request is not None
            try:
                self._render(request)
            except PresetError as error:
                self._done = None
                self._listener.render_failed(str(error), "")
            except Exception as error:  # told to the user; the worker lives on
                self._done = None
                self._listener.render_failed(f"Rendering failed: {error}", traceback.format_exc())

    def _interrupted(self) -> bool:
        with self._mailbox:
            return self._request is not None or self._closing

    def _render(self, request: RenderRequest) -> None:
        if self._take is not None and self._take.complete and request.same_motion(self._done):
            self._done = request
            sound = _Sound(self._take, request)
            sound.catch_up()
            self._listener.track_replaced(self._take, sound.track)
            return
        preset = self._loaded(request.preset)
        take = Take(preset.name, preset.info, request.pluck, request.seconds)
        self._take, self._done = take, request
        sound = _Sound(take, request)
        started = False
        for model_m, truth_m in _motion(preset, take):
            take.append(model_m, truth_m)
            sound.catch_up()
            if not started:
                self._listener.take_started(take, sound.track)
                started = True
            newer = self._newer_listening(request)
            if newer is not None:
                request = self._done = newer
                sound = _Sound(take, request)
                sound.catch_up()
                self._listener.track_replaced(take, sound.track)
            elif self._interrupted():
                sound.track.finish()
                return
        self._listener.take_finished(take, take.error_sums())

    def _newer_listening(self, request: RenderRequest) -> RenderRequest | None:
        """Takes a waiting request out of the mailbox if it wants the same motion."""
        with self._mailbox:
            if self._request is None or not self._request.same_motion(request):
                return None
            newer, self._request = self._request, None
            return newer

    def _loaded(self, path: Path) -> Preset:
        if self._preset is None or self._preset.path != path:
            self._preset = load_preset(path)
        return self._preset


def _motion(preset: Preset, take: Take) -> Iterator[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Blocks of frames (frames, grid_points) in m of model and truth, the initial displacement first."""
    info = preset.info
    initial = project(take.pluck.displacement(info.grid_points), info.modes)[None]
    sources: tuple[StringSource, StringSource] = ModelSource(preset), TruthSource(info)
    model, truth = sources
    model_state, truth_state = (source.start(initial) for source in sources)
    first = initial.float().numpy()
    yield first, first
    done, block = 1, FIRST_BLOCK_FRAMES
    while done < take.frames:
        steps = min(block, take.frames - done)
        truth_m, truth_state = truth.advance(truth_state, steps)
        model_m = torch.zeros_like(truth_m)
        if take.model_ends_s is None:
            try:
                model_m, model_state = model.advance(model_state, steps)
            except Runaway:  # at rest from here on: it must never reach a loudspeaker
                take.model_ends_s = (done - 1) / info.rate_hz
        yield model_m[0].float().numpy(), truth_m[0].float().numpy()
        done, block = done + steps, BLOCK_FRAMES


class _Sound:
    """The sound of a take at one listening point, converted to the output's rate block by block."""

    def __init__(self, take: Take, request: RenderRequest) -> None:
        self._take = take
        self._listen = request.listen
        self._frames = 0
        rate_hz = take.info.rate_hz
        self._converters = {
            name: soxr.ResampleStream(rate_hz, request.sound_rate_hz, 1, dtype="float32", quality="HQ")
            for name in SOURCES
        }
        length = int(np.ceil(take.frames * request.sound_rate_hz / rate_hz)) + 1
        self.track = Track(request.sound_rate_hz, length, SOURCES)

    def catch_up(self) -> None:
        """Appends to the track what the take has gained."""
        ready, last = self._take.ready_frames, self._take.complete
        blocks = {}
        for name, converter in self._converters.items():
            signal = self._take.signal_m(name, self._listen, self._frames, ready) / FULL_SCALE_M
            blocks[name] = converter.resample_chunk(signal.astype(np.float32), last=last)
        self._frames = ready
        room = self.track.length_frames - self.track.ready_frames
        self.track.append({name: block[:room] for name, block in blocks.items()})
        if last:
            self.track.finish()
