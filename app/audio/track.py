"""A growing recording: one render worker appends to its end while the player already reads its beginning."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Track:
    """The same seconds of sound from several sources ("model", "truth", …), sample-aligned, mono or stereo.

    One thread appends, any thread reads. No lock is needed: the samples are written first and `ready_frames`
    is published afterwards, so what lies below `ready_frames` is complete and never changes again.

    Args:
        rate_hz: Sample rate of all sources.
        length_frames: Room that is set aside for each source, 4 bytes a frame and channel.
        sources: Their names, in the order in which they are offered.
        channels: 1, with samples of shape (frames,), or 2, (frames, 2).
    """

    def __init__(self, rate_hz: int, length_frames: int, sources: tuple[str, ...], channels: int = 1) -> None:
        if rate_hz <= 0:
            raise ValueError(f"A track needs a positive sample rate, not {rate_hz} Hz.")
        if length_frames < 0:
            raise ValueError(f"A track cannot be {length_frames} frames long.")
        if not sources or len(set(sources)) != len(sources):
            raise ValueError(f"A track needs one or more different source names, not {sources}.")
        if channels not in (1, 2):
            raise ValueError(f"A track has 1 or 2 channels, not {channels}.")
        self.rate_hz = rate_hz
        self.length_frames = length_frames
        self.sources = sources
        self.channels = channels
        self._frame_shape = () if channels == 1 else (channels,)
        self._samples = {source: np.zeros((length_frames, *self._frame_shape), np.float32) for source in sources}
        self._match_gains: Mapping[str, float] | None = None
        self._ready_frames = 0
        self._complete = length_frames == 0

    @property
    def ready_frames(self) -> int:
        """How many frames, from the start, can be read."""
        return self._ready_frames

    @property
    def complete(self) -> bool:
        """Whether `ready_frames` is final; to be sure of the end, read this first and `ready_frames` next."""
        return self._complete

    @property
    def match_gains(self) -> Mapping[str, float] | None:
        """By source, what brings its level to that of the others; None until enough is there to know."""
        return self._match_gains

    def set_match_gains(self, gains: Mapping[str, float]) -> None:
        """Publishes them, once; a source that is not named stays as it is."""
        self._match_gains = dict(gains)

    def append(self, blocks: Mapping[str, ArrayLike]) -> None:
        """Adds one block to every source, or, when anything is wrong with it, nothing to any.

        Args:
            blocks: Samples, shape (frames,) or (frames, 2), for exactly the sources of this track.

        Raises:
            ValueError: For missing or unknown sources, unequal lengths, no room, a finished track, or a
                sample that is not a finite float32 (the message names its source and its time).
        """
        if self._complete:
            raise ValueError("The track is finished; nothing can be appended.")
        if set(blocks) != set(self.sources):
            raise ValueError(f"A block needs the sources {self.sources}, not {tuple(blocks)}.")
        with np.errstate(over="ignore"):  # a float64 too large for float32 becomes infinite and is refused below
            arrays = {source: np.asarray(blocks[source]).astype(np.float32) for source in self.sources}
        shapes = {source: array.shape for source, array in arrays.items()}
        if len(set(shapes.values())) != 1 or any(a.shape[1:] != self._frame_shape for a in arrays.values()):
            frames = "(frames,)" if self.channels == 1 else f"(frames, {self.channels})"
            raise ValueError(f"All sources need blocks of one shape {frames}, not {shapes}.")
        start = self._ready_frames
        stop = start + len(next(iter(arrays.values())))
        if stop > self.length_frames:
            raise ValueError(
                f"{stop - start} more frames do not fit: {start} of {self.length_frames} are already used."
            )
        for source, array in arrays.items():
            self._require_finite(source, array, start)
        for source, array in arrays.items():
            self._samples[source][start:stop] = array
        self._ready_frames = stop
        if stop == self.length_frames:
            self._complete = True

    def finish(self) -> None:
        """Says that nothing more comes: the track ends at `ready_frames`, even if room is left."""
        self._complete = True

    def read(self, source: str, start: int, stop: int) -> NDArray[np.float32]:
        """The ready part of `start` … `stop` (frames) of a source: read-only, (≤ stop − start frames …)."""
        if source not in self._samples:
            raise ValueError(f"The track has no source {source!r}, only {self.sources}.")
        ready = self._ready_frames
        view = self._samples[source][min(max(start, 0), ready) : min(max(stop, 0), ready)]
        view.flags.writeable = False
        return view

    def _require_finite(self, source: str, array: NDArray[np.float32], start: int) -> None:
        finite = np.isfinite(array)
        if not finite.all():
            first = start + int(np.argmin(finite.reshape(len(array), -1).all(axis=1)))
            raise ValueError(f"The source {source!r} is not finite at {first / self.rate_hz:.6f} s.")
