"""What is heard, sample by sample: pure NumPy, without a thread and without a device.

Commands take effect at the next frame that is rendered, each as a short cross-fade: none of them clicks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.audio.limiter import Limiter
from app.audio.track import Track
from app.audio.voice import Voice

# Cross-fades are linear: the two gains add up to one. The sources are nearly the same signal,
# so their amplitudes add: the equal-power law, made for unrelated sounds, would swell by 3 dB half-way.
CROSS_FADE_S = 0.020  # another source, another listening point, another position
DECLICK_S = 0.008  # stopping, resuming, running dry, the end of the track, the old sound under a new pluck
ATTACK_S = 0.002  # the very start of a track: a pluck has an attack, which a longer fade would swallow

RESUME_RESERVE_S = 0.05  # so much must be rendered ahead before a waiting playhead moves on
VOLUME_SMOOTHING_S = 0.015  # time constant
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

    @property
    def limiting(self) -> bool:
        return self.gain_reduction_db > 0


class Mixer:
    """Plays one track at a time; any splitting into blocks gives the same samples."""

    def __init__(self, rate_hz: int) -> None:
        self.rate_hz = rate_hz
        self._track: Track | None = None
        self._incoming: Track | None = None  # takes over once it is rendered as far as the playhead
        self._source: str | None = None  # as wished; see _source_in
        self._loop = False
        self._playing = False
        self._position_frames = 0  # while no voice sounds; otherwise the voice knows
        self._voice: Voice | None = None
        self._leaving: list[Voice] = []  # former voices in their fade-out
        self._fade_in_s = ATTACK_S  # of the next voice
        self._volume_db = 0.0
        self._gain = 1.0
        self._limiter = Limiter(rate_hz)
        self._peak_db = METER_FLOOR_DB
        self._non_finite = False

    # Commands

    def load(self, track: Track, keep_position: bool = False) -> None:
        """Takes another track; a mixer that plays goes on playing, one that is stopped stays stopped.

        Args:
            track: Its rate must be the mixer's. The chosen source stays, or becomes the track's first if it
                has none of that name.
            keep_position: False starts at the beginning (a new pluck). True cross-fades at the playhead (the
                listening point moved); the old track sounds on until the new one is rendered that far.
        """
        if track.rate_hz != self.rate_hz:
            raise ValueError(f"The track has {track.rate_hz} Hz, not the mixer's {self.rate_hz}: resample it.")
        if keep_position and self._voice is not None:
            self._incoming = track
            return
        position = self.position_frames if keep_position else 0
        self._retire_voice(DECLICK_S)
        self._adopt(track)
        self._place(position, DECLICK_S)

    def play(self) -> None:
        """Plays on from the playhead, after the end from the beginning; without a track it does nothing."""
        if self._track is None or self._playing:
            return
        self._playing = True
        self._place(0 if self._at_end(self._track) else self._position_frames, DECLICK_S)

    def stop(self) -> None:
        """Fades out; the playhead stays where the fade began."""
        self._position_frames = self.position_frames
        self._retire_voice(DECLICK_S)
        self._playing = False

    def seek(self, position_s: float) -> None:
        """Moves the playhead, with a cross-fade if something sounds."""
        if not math.isfinite(position_s):
            raise ValueError(f"The playhead cannot go to {position_s} s.")
        self._retire_voice(CROSS_FADE_S)
        self._place(round(position_s * self.rate_hz), CROSS_FADE_S)

    def select(self, source: str) -> None:
        """Cross-fades to another source at the same playhead position."""
        known = self._incoming or self._track
        if known is not None and source not in known.sources:
            raise ValueError(f"The track has no source {source!r}, only {known.sources}.")
        self._source = source
        old = self._voice
        if old is not None and self._source_in(old.track) != old.source:
            self._retire_voice(CROSS_FADE_S)
            self._voice = self._voice_at(old.track, old.position_frames, CROSS_FADE_S)

    def set_loop(self, on: bool) -> None:
        """Whether the end is followed by the beginning; the period is exactly the length of the track."""
        self._loop = on

    def set_volume_db(self, volume_db: float) -> None:
        """Sets the volume; 0 dB leaves the samples as they are, minus infinity is silence."""
        if math.isnan(volume_db) or volume_db == math.inf:
            raise ValueError(f"The volume cannot be {volume_db} dB.")
        self._volume_db = volume_db

    def emptied(self, rate_hz: int) -> Mixer:
        """A stopped mixer without a track, for another rate, with this one's source, loop and volume."""
        mixer = Mixer(rate_hz)
        mixer._source, mixer._loop, mixer._volume_db = self._source, self._loop, self._volume_db
        return mixer

    # Sound

    def next_block(self, frames: int) -> NDArray[np.float32]:
        """Renders the next samples, shape (frames, 2), both columns alike, below the limiter's ceiling."""
        self._let_incoming_take_over()
        mono = np.zeros(frames)
        start = 0
        while start < frames:
            stop = start + self._frames_until_event(frames - start)
            for voice in self._sounding():
                voice.add_to(mono[start:stop])
            self._leaving = [voice for voice in self._leaving if voice.frames_left > 0]
            start = stop
        finite = np.isfinite(mono)
        if not finite.all():  # a Track refuses such samples; this is the last line of defence
            mono[~finite] = 0.0
            self._non_finite = True
        mono *= self._smooth_gains(frames)
        mono = self._limiter.process(mono)
        self._measure(mono)
        return np.repeat(mono.astype(np.float32)[:, np.newaxis], 2, axis=1)

    @property
    def position_frames(self) -> int:
        return self._position_frames if self._voice is None else self._voice.position_frames

    def status(self) -> MixerStatus:
        return MixerStatus(
            position_frames=self.position_frames,
            playing=self._playing,
            waiting=self._playing and self._voice is None,
            source=self._source if self._track is None else self._source_in(self._track),
            peak_db=self._peak_db,
            gain_reduction_db=self._limiter.gain_reduction_db,
            non_finite=self._non_finite,
        )

    def _frames_until_event(self, most: int) -> int:
        """Settles what happens at this frame; returns for how many frames (1 … most) nothing else does."""
        while self._playing:
            track = self._track
            assert track is not None  # play() sees to it
            voice = self._voice
            if voice is None:
                if self._at_end(track):
                    self._turn_back_or_stop(track)
                elif self._reaches(track, self._position_frames + self._frames(RESUME_RESERVE_S)):
                    self._voice = self._voice_at(track, self._position_frames, self._fade_in_s)
                else:
                    return most  # waiting for the render worker
            elif not voice.fading_out:
                # The last ready samples are kept for the fade-out, whether they are the end of the track or
                # only of what has been rendered so far.
                before_fade = track.ready_frames - self._frames(DECLICK_S) - voice.position_frames
                if before_fade > 0:
                    return min(most, before_fade)
                voice.fade_out(self._frames(DECLICK_S))
            elif voice.frames_left > 0:
                return min(most, voice.frames_left)
            else:
                self._voice = None
                self._place(voice.position_frames, DECLICK_S)
        return most

    def _sounding(self) -> list[Voice]:
        return self._leaving if self._voice is None else [*self._leaving, self._voice]

    def _turn_back_or_stop(self, track: Track) -> None:
        if self._loop and track.ready_frames > 0:
            self._place(0, ATTACK_S)
        else:
            self._playing = False

    def _let_incoming_take_over(self) -> None:
        track, voice = self._incoming, self._voice
        if track is None:
            return
        if voice is None or self._at_end(track):
            position = self.position_frames
            self._retire_voice(DECLICK_S)
            self._adopt(track)
            self._place(position, DECLICK_S)
        elif self._reaches(track, voice.position_frames + self._frames(RESUME_RESERVE_S)):
            self._retire_voice(CROSS_FADE_S)
            self._adopt(track)
            self._voice = self._voice_at(track, voice.position_frames, CROSS_FADE_S)

    def _adopt(self, track: Track) -> None:
        self._track = track
        self._incoming = None
        self._non_finite = False

    def _retire_voice(self, fade_s: float) -> None:
        """Lets the voice fade out beside what comes next."""
        voice, self._voice = self._voice, None
        if voice is not None and not voice.silent:
            voice.fade_out(self._frames(fade_s))
            self._leaving.append(voice)

    def _place(self, position_frames: int, fade_in_s: float) -> None:
        """Puts the playhead down where the next voice is to begin."""
        longest = 0 if self._track is None else self._track.length_frames
        self._position_frames = min(max(position_frames, 0), longest)
        self._fade_in_s = ATTACK_S if self._position_frames == 0 else fade_in_s

    def _voice_at(self, track: Track, position_frames: int, fade_in_s: float) -> Voice:
        return Voice(track, self._source_in(track), position_frames, self._frames(fade_in_s))

    def _source_in(self, track: Track) -> str:
        return self._source if self._source in track.sources else track.sources[0]

    def _at_end(self, track: Track) -> bool:
        return track.complete and self.position_frames >= track.ready_frames

    def _reaches(self, track: Track, frames: int) -> bool:
        return track.complete or track.ready_frames >= frames

    def _frames(self, duration_s: float) -> int:
        return max(1, round(duration_s * self.rate_hz))

    def _smooth_gains(self, frames: int) -> NDArray[np.float64]:
        """The volume as a gain per sample, shape (frames,), approaching its target exponentially."""
        target = 10 ** (self._volume_db / 20)
        if self._gain == target or frames == 0:
            return np.full(frames, target)
        per_frame = math.exp(-1 / (VOLUME_SMOOTHING_S * self.rate_hz))
        decay = per_frame ** np.arange(1, frames + 1, dtype=np.float64)
        gains = target + (self._gain - target) * decay
        self._gain = float(gains[-1])
        if math.isclose(self._gain, target, rel_tol=1e-9, abs_tol=1e-9):
            self._gain = target
        return gains

    def _measure(self, mono: NDArray[np.float64]) -> None:
        peak = float(np.abs(mono).max(initial=0.0))
        fallen_db = self._peak_db - METER_FALL_DB_PER_S * mono.size / self.rate_hz
        self._peak_db = max(20 * math.log10(peak) if peak > 0 else METER_FLOOR_DB, fallen_db, METER_FLOOR_DB)
