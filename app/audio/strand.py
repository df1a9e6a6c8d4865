"""One pluck as it sounds: a playhead on a track, the voice that reads there, and its former voices as they fade."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import NDArray

from app.audio.levels import Levels
from app.audio.track import Track
from app.audio.voice import Voice

# Cross-fades are linear: the two gains add up to one. The sources are nearly the same signal,
# so their amplitudes add: the equal-power law, made for unrelated sounds, would swell by 3 dB half-way.
CROSS_FADE_S = 0.020  # another source, another listening point, another position
DECLICK_S = 0.008  # stopping, resuming, running dry, the end of the track, the old sound under what replaces it
ATTACK_S = 0.002  # the very start of a track: a pluck has an attack, which a longer fade would swallow

START_RESERVE_S = 0.008  # so much must be rendered before a pluck begins to sound
RESUME_RESERVE_S = 0.05  # and so much ahead before a playhead that ran dry moves on


class Strand:
    """Plays a track from a position to its end, or stands still; any splitting into blocks gives the same samples.

    Attributes:
        running: whether the playhead moves, or waits for rendering; at the end it stops running by itself.
        loop: whether the end is followed by the beginning; the period is exactly the length of the track.
        incoming: takes the track's place once it is rendered as far as the playhead.
        source: as wished; a track that has none of this name plays its first.
    """

    def __init__(self, track: Track, source: str | None, *, loop: bool = False) -> None:
        self.track = track
        self.source = source
        self.loop = loop
        self.running = False
        self.incoming: Track | None = None
        self._position_frames = 0  # while no voice sounds; otherwise the voice knows
        self._voice: Voice | None = None
        self._leaving: list[Voice] = []  # former voices in their fade-out
        self._fade_in_s = ATTACK_S  # of the next voice

    @property
    def position_frames(self) -> int:
        return self._position_frames if self._voice is None else self._voice.position_frames

    @property
    def sounding(self) -> bool:
        """Whether a voice is at the playhead."""
        return self._voice is not None

    @property
    def waiting(self) -> bool:
        return self.running and self._voice is None

    @property
    def over(self) -> bool:
        """Whether nothing more will be heard of it unless it is told to run."""
        return not self.running and not self._leaving

    @property
    def at_end(self) -> bool:
        return self.track.complete and self.position_frames >= self.track.ready_frames

    @property
    def source_heard(self) -> str:
        return self.source if self.source in self.track.sources else self.track.sources[0]

    def copied(self) -> Strand:
        """The same state again, on the same track."""
        strand = copy.copy(self)
        strand._voice = None if self._voice is None else self._voice.copied()
        strand._leaving = [voice.copied() for voice in self._leaving]
        return strand

    def steady(self, frames: int) -> bool:
        """Whether the next frames will be the same whatever is rendered meanwhile."""
        if not self.running:
            return True
        track, voice = self.incoming or self.track, self._voice
        if voice is not None and voice.fading_out and not track.complete:
            return False  # it runs dry: who knows for how long
        ahead = frames + self._frames(DECLICK_S)
        if self.incoming is not None or voice is None:
            ahead = max(ahead, self._reserve_frames)
        return _reaches(track, self.position_frames + ahead)

    def place(self, position_frames: int, fade_in_s: float) -> None:
        """Puts the playhead down where the next voice is to begin; a present voice must have been retired."""
        self._position_frames = min(max(position_frames, 0), self.track.length_frames)
        self._fade_in_s = ATTACK_S if self._position_frames == 0 else fade_in_s

    def run(self) -> None:
        """Plays on from the playhead, after the end from the beginning."""
        if not self.running:
            self.running = True
            self.place(0 if self.at_end else self._position_frames, DECLICK_S)

    def stop(self, fade_s: float = DECLICK_S) -> None:
        """Fades out; the playhead stays where the fade began."""
        self._position_frames = self.position_frames
        self._retire_voice(fade_s)
        self.running = False

    def seek(self, position_frames: int) -> None:
        self._retire_voice(CROSS_FADE_S)
        self.place(position_frames, CROSS_FADE_S)

    def select(self, source: str) -> None:
        """Cross-fades to another source, if the track has it, at the same position."""
        self.source = source
        old = self._voice
        if old is not None and source in old.track.sources and source != old.source:
            self._retire_voice(CROSS_FADE_S)
            self._voice = self._voice_at(old.position_frames, CROSS_FADE_S)

    def let_incoming_take_over(self) -> bool:
        """At the beginning of a block; True where the track is another from here on."""
        track, voice = self.incoming, self._voice
        if track is None:
            return False
        if voice is None or (track.complete and voice.position_frames >= track.ready_frames):
            position = self.position_frames
            self._retire_voice(DECLICK_S)
            self.track, self.incoming = track, None
            self.place(position, DECLICK_S)
            return True
        if _reaches(track, voice.position_frames + self._frames(RESUME_RESERVE_S)):
            self._retire_voice(CROSS_FADE_S)
            self.track, self.incoming = track, None
            self._voice = self._voice_at(voice.position_frames, CROSS_FADE_S)
            return True
        return False

    def frames_until_event(self, most: int) -> int:
        """Settles what happens at this frame; returns for how many frames (1 … most) nothing else does."""
        while self.running:
            track, voice = self.track, self._voice
            if voice is None:
                if self.at_end:
                    self._turn_back_or_stop()
                elif _reaches(track, self._position_frames + self._reserve_frames):
                    self._voice = self._voice_at(self._position_frames, self._fade_in_s)
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
                self.place(voice.position_frames, DECLICK_S)
        return most

    @property
    def channels(self) -> int:
        """How many it needs now."""
        return max([self.track.channels, *(voice.track.channels for voice in self._leaving)])

    def add_to(self, out: NDArray[np.float64], levels: Levels) -> None:
        """Adds the next samples to `out`, shape (frames, channels)."""
        for voice in self._leaving if self._voice is None else [*self._leaving, self._voice]:
            voice.add_to(out, levels)
        self._leaving = [voice for voice in self._leaving if voice.frames_left > 0]

    @property
    def _reserve_frames(self) -> int:
        """So many must be ready from the playhead on before a voice begins there."""
        return self._frames(START_RESERVE_S if self.position_frames == 0 else RESUME_RESERVE_S)

    def _turn_back_or_stop(self) -> None:
        if self.loop and self.track.ready_frames > 0:
            self.place(0, ATTACK_S)
        else:
            self.running = False

    def _retire_voice(self, fade_s: float) -> None:
        """Lets the voice fade out beside what comes next."""
        voice, self._voice = self._voice, None
        if voice is not None and not voice.silent:
            voice.fade_out(self._frames(fade_s))
            if voice.frames_left > 0:  # none are left where it has just come to the end of its track
                self._leaving.append(voice)

    def _voice_at(self, position_frames: int, fade_in_s: float) -> Voice:
        return Voice(self.track, self.source_heard, position_frames, self._frames(fade_in_s))

    def _frames(self, duration_s: float) -> int:
        return max(1, round(duration_s * self.track.rate_hz))


def _reaches(track: Track, frames: int) -> bool:
    return track.complete or track.ready_frames >= frames
