"""What is heard, sample by sample: pure NumPy, without a thread and without a device.

Commands take effect at the next frame that is rendered, each as a short cross-fade: none of them clicks.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.audio.levels import Levels, SmoothGain
from app.audio.limiter import Limiter
from app.audio.pieces import pieces
from app.audio.strand import CROSS_FADE_S, DECLICK_S, Strand
from app.audio.track import Track

MOST_PLUCKS = 8  # that sound at once, the latest among them
METER_FALL_DB_PER_S = 20.0
METER_FLOOR_DB = -120.0


@dataclass(frozen=True)
class MixerStatus:
    """The state after the last block."""

    position_frames: int  # of the next frame to be rendered
    playing: bool
    waiting: bool  # playing, but the playhead stands where rendering has not arrived
    source: str | None
    peak_db: float  # dBFS, falls by METER_FALL_DB_PER_S, never below METER_FLOOR_DB
    gain_reduction_db: float  # of the safety limiter, ≥ 0
    non_finite: bool  # samples of the loaded track had to be replaced by silence
    ringing: int = 0  # earlier plucks that still sound

    @property
    def limiting(self) -> bool:
        return self.gain_reduction_db > 0


class Mixer:
    """Plays one track with a playhead, and beside it earlier plucks that ring on to their ends.

    Any splitting into blocks gives the same samples.
    """

    def __init__(self, rate_hz: int) -> None:
        self.rate_hz = rate_hz
        self._main: Strand | None = None  # the one with the playhead
        self._ringing: list[Strand] = []  # earlier plucks, the oldest first
        self._leaving: list[Strand] = []  # what was replaced or stopped, in its fade-out
        self._source: str | None = None
        self._loop = False
        self._volume_db = 0.0
        self._volume = SmoothGain(1.0, rate_hz)
        self._levels = Levels()
        self._limiter = Limiter(rate_hz)
        self._gain_reduction_db = 0.0  # the most within the last block
        self._peak_db = METER_FLOOR_DB
        self._non_finite = False

    # Commands

    def load(self, track: Track, keep_position: bool = False, ring: bool = False) -> None:
        """Takes another track; a mixer that plays goes on playing, one that is stopped stays stopped.

        Args:
            track: Its rate must be the mixer's. The chosen source stays, or becomes the track's first if it
                has none of that name.
            keep_position: False starts at the beginning. True cross-fades at the playhead (the listening
                point moved); the old track sounds on until the new one is rendered that far.
            ring: The new track is another pluck, which does not end the last one: that rings on to its end
                beside it, with at most `MOST_PLUCKS` in all. It may be the same track again.
        """
        if track.rate_hz != self.rate_hz:
            raise ValueError(f"The track has {track.rate_hz} Hz, not the mixer's {self.rate_hz}: resample it.")
        old = self._main
        if keep_position and old is not None and old.sounding:
            old.incoming = track
            return
        self._non_finite = False
        self._main = Strand(track, self._source, loop=self._loop)
        if old is None:
            return
        self._main.running = old.running
        self._main.place(old.position_frames if keep_position else 0, DECLICK_S)
        if ring and old.running:
            self._let_ring(old)
        else:
            self._let_leave(old, DECLICK_S)

    def play(self) -> None:
        """Plays on from the playhead, after the end from the beginning; without a track it does nothing."""
        if self._main is not None:
            self._main.run()

    def stop(self) -> None:
        """Fades out everything; the playhead stays where the fade began."""
        if self._main is not None:
            self._main.stop()
        self._silence_ringing(DECLICK_S)

    def seek(self, position_s: float) -> None:
        """Moves the playhead, with a cross-fade if something sounds; earlier plucks end."""
        if not math.isfinite(position_s):
            raise ValueError(f"The playhead cannot go to {position_s} s.")
        if self._main is not None:
            self._main.seek(round(position_s * self.rate_hz))
        self._silence_ringing(CROSS_FADE_S)

    def select(self, source: str) -> None:
        """Cross-fades everything that sounds to another source at the same position."""
        main = self._main
        known = None if main is None else main.incoming or main.track
        if known is not None and source not in known.sources:
            raise ValueError(f"The track has no source {source!r}, only {known.sources}.")
        self._source = source
        for strand in self._ringing if main is None else [*self._ringing, main]:
            strand.select(source)

    def set_loop(self, on: bool) -> None:
        """Whether the end is followed by the beginning; earlier plucks ring to their ends once."""
        self._loop = on
        if self._main is not None:
            self._main.loop = on

    def set_volume_db(self, volume_db: float) -> None:
        """Sets the volume; 0 dB leaves the samples as they are, minus infinity is silence."""
        if math.isnan(volume_db) or volume_db == math.inf:
            raise ValueError(f"The volume cannot be {volume_db} dB.")
        self._volume_db = volume_db

    def set_levels(self, levels: Levels) -> None:
        """How loud each source is, of everything that sounds."""
        self._levels = levels

    def emptied(self, rate_hz: int) -> Mixer:
        """A stopped mixer without a track, for another rate, with this one's source, loop, volume and levels."""
        mixer = Mixer(rate_hz)
        mixer._levels = self._levels
        mixer._source, mixer._loop, mixer._volume_db = self._source, self._loop, self._volume_db
        return mixer

    def copied(self) -> Mixer:
        """The same state again, on the same tracks: what is done to one does nothing to the other."""
        mixer = copy.copy(self)
        mixer._main = None if self._main is None else self._main.copied()
        mixer._ringing = [strand.copied() for strand in self._ringing]
        mixer._leaving = [strand.copied() for strand in self._leaving]
        mixer._volume, mixer._limiter = copy.copy(self._volume), copy.copy(self._limiter)
        return mixer

    # Sound

    def steady(self, frames: int) -> bool:
        """Whether the next frames will be the same whatever is rendered meanwhile."""
        return all(strand.steady(frames) for strand in self._strands())

    def next_block(self, frames: int) -> NDArray[np.float32]:
        """Renders the next samples, shape (frames, 2), below the limiter's ceiling; mono is the same in both."""
        block = np.empty((frames, 2), np.float32)
        self._gain_reduction_db = 0.0
        for piece in pieces(frames):
            block[piece] = self._next_piece(piece.stop - piece.start)
        return block

    def _next_piece(self, frames: int) -> NDArray[np.float64]:
        """Shape (frames, 1 or 2)."""
        if self._main is not None and self._main.let_incoming_take_over():
            self._non_finite = False
        for strand in self._ringing:
            strand.let_incoming_take_over()
        strands = self._strands()
        mix = np.zeros((frames, max((strand.channels for strand in strands), default=1)))
        for strand in strands:
            start = 0
            while start < frames:
                stop = start + strand.frames_until_event(frames - start)
                strand.add_to(mix[start:stop], self._levels)
                start = stop
        self._ringing = [strand for strand in self._ringing if not strand.over]
        self._leaving = [strand for strand in self._leaving if not strand.over]
        finite = np.isfinite(mix)
        if not finite.all():  # a Track refuses such samples; this is the last line of defence
            mix[~finite] = 0.0
            self._non_finite = True
        self._volume.apply(mix, 10 ** (self._volume_db / 20))
        mix = self._limiter.process(mix)
        self._gain_reduction_db = max(self._gain_reduction_db, self._limiter.gain_reduction_db)
        self._measure(mix)
        return mix

    @property
    def position_frames(self) -> int:
        return 0 if self._main is None else self._main.position_frames

    def status(self) -> MixerStatus:
        main = self._main
        return MixerStatus(
            position_frames=self.position_frames,
            playing=main is not None and main.running,
            waiting=main is not None and main.waiting,
            source=self._source if main is None else main.source_heard,
            peak_db=self._peak_db,
            gain_reduction_db=self._gain_reduction_db,
            non_finite=self._non_finite,
            ringing=len(self._ringing),
        )

    def _strands(self) -> list[Strand]:
        main = [] if self._main is None else [self._main]
        return [*self._leaving, *self._ringing, *main]

    def _let_ring(self, strand: Strand) -> None:
        strand.loop = False
        self._ringing.append(strand)
        while len(self._ringing) >= MOST_PLUCKS:
            self._let_leave(self._ringing.pop(0), CROSS_FADE_S)

    def _let_leave(self, strand: Strand, fade_s: float) -> None:
        strand.stop(fade_s)
        if not strand.over:
            self._leaving.append(strand)

    def _silence_ringing(self, fade_s: float) -> None:
        ringing, self._ringing = self._ringing, []
        for strand in ringing:
            self._let_leave(strand, fade_s)

    def _measure(self, mix: NDArray[np.float64]) -> None:
        peak = float(np.abs(mix).max(initial=0.0))
        fallen_db = self._peak_db - METER_FALL_DB_PER_S * len(mix) / self.rate_hz
        self._peak_db = max(20 * math.log10(peak) if peak > 0 else METER_FLOOR_DB, fallen_db, METER_FLOOR_DB)
