"""A note: what rings since a pluck at a place, as voices of several sources."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.playing.ahead_samples import AheadSamples
from app.rendering import NoteSound
from app.rendering.subject import Subject
from app.shared.vocabulary import OTHER
from engine.kernels.constants import QUANTUM
from engine.voices import Mixer, Voice


@dataclass(eq=False)
class PluckVoices:
    """A note whose voices begin with the same frame, so that a switch between them stays in time.

    Attributes:
        request: the string, how it is plucked, where it is heard, and other presets for the same pluck.
        sources: those that get a voice: "model", "truth", and `OTHER` + the name of another preset.
        from_s: where in its motion it begins.
        begin_frame: the frame of the mixer at which it begins; 0: at once.
        struck_s: the time of its gesture by the sound's clock; 0: it is none.
        voices: by source.
        ahead: the samples of those of its voices that are rendered ahead.
        match: by source, the factor that brings it to the level of the truth; None until it is known.
        pending: it was not handed to a mixer yet.
        released: whether it was asked to fade out.
        mixer: to which it was handed, or whose frame it waits for.
        cut: it is not heard any more: its mixer was replaced, or it could not be played.
        timed: its latency has been noted.
        ahead_of_event: it was handed over before its event is due, and may be cancelled until then.
    """

    request: NoteSound
    sources: tuple[str, ...]
    from_s: float = 0.0
    begin_frame: int = 0
    struck_s: float = 0.0
    voices: dict[str, Voice] = field(default_factory=dict)
    ahead: list[AheadSamples] = field(default_factory=list)
    match: Mapping[str, float] | None = None
    mixer: Mixer | None = None
    pending: bool = True
    released: bool = False
    cut: bool = False
    timed: bool = False
    ahead_of_event: bool = False

    def subject(self, source: str) -> Subject:
        """The preset that plays a source: the other one that it names, else the note's own, or a string of it."""
        others = (path for path in self.request.others if source == f"{OTHER}{path.stem}")
        return next(others, self.request.preset)

    @property
    def matching_key(self) -> tuple[object, ...]:
        """The values that the levels of its sources depend on."""
        request = self.request
        return request.preset, request.pluck, request.ear, request.others, self.sources

    @property
    def over(self) -> bool:
        """Return True if it has ended: nothing of it will be heard any more."""
        if self.cut or self.pending:
            return self.cut or self.released
        return all(voice.over for voice in self.voices.values())

    @property
    def seconds(self) -> float:
        """The time in its motion up to which the device has its samples."""
        if self.pending:
            return self.from_s
        return max((voice.seconds for voice in self.voices.values()), default=0.0)

    @property
    def began(self) -> bool:
        """Return True if the device has any of its samples, or it was cut after it was handed over."""
        return not self.pending and (self.cut or any(voice.sounding or voice.over for voice in self.voices.values()))

    @property
    def waits_s(self) -> float:
        """The estimated seconds until enough is rendered for it to begin; 0: it does not wait, or not known."""
        waits = self.pending and not self.over
        return max((samples.waits_s for samples in self.ahead), default=0.0) if waits else 0.0

    @property
    def unfinished(self) -> list[AheadSamples]:
        """The samples of which more are wanted."""
        return [samples for samples in self.ahead if not (samples.finished or samples.voice.over)]

    @property
    def began_frame(self) -> int:
        """The frame of the mixer at which it began; 0 before that."""
        return max((voice.began_frame for voice in self.voices.values()), default=0)

    @property
    def latency_s(self) -> float | None:
        """The seconds from the gesture to the callback that gave the device its first samples.

        None: not known, or not begun.
        """
        return next(iter(self.voices.values())).struck_to_began_s if self.voices else None

    def frame_at(self, seconds: float) -> int:
        """The frame of its mixer at which its motion reaches a time; only once it has begun."""
        assert self.mixer is not None
        rate_hz = self.mixer.rate_hz
        skipped = (round(self.from_s * rate_hz) + QUANTUM // 2) // QUANTUM * QUANTUM  # frames before it began
        starved_s = min(voice.starved_s for voice in self.voices.values())  # it waited for samples so long
        return self.began_frame + round((seconds + starved_s) * rate_hz) - skipped

    def release_at(self, frame: int) -> None:
        """Let the note fade out from a frame of the mixer on; 0: not any more."""
        for voice in self.voices.values():
            voice.release_at(frame)

    def end(self) -> None:
        """Cut the note, where no device plays its voices any more; they are over."""
        self.cut = True
        for voice in self.voices.values():
            voice.refuse()

    def release(self, seconds: float) -> None:
        """Let the note fade out within so many seconds, from now on."""
        self.released = True
        for voice in self.voices.values():
            voice.release(seconds)
