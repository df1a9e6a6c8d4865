"""A note that a key began: the compiled player has its voices, and reports what becomes of it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from app.instruments.drums import Drums
from app.player.compiled import InstrumentPlayer
from app.player.events import NoteOn
from app.playing.note import PluckVoices
from app.rendering import NoteSound
from app.rendering.subject import StringOf
from app.shared.log import log_fault
from engine.kernels import constants as of
from engine.pluck import Pluck
from engine.values.string import StringParameters
from engine.voices import Mixer
from engine.voices.player import NoteReport, Playing

SOURCES = ("model", "truth")
DROPPED = "A note was dropped because of an internal error. All others play on; please report the details."
DROPPED_S = 0.03  # of its fade
AS_THEY_ARE: Mapping[str, float] = dict.fromkeys(SOURCES, 1.0)


@dataclass(eq=False)
class KeyNote:
    """The state of a key's note, as known from the latest `take` and `look`.

    Attributes:
        player: whose voices it has, in `mixer`.
        id: of its event, which reports carry.
        path: the preset's file.
        begin_frame: the frame of the mixer at which it begins; 0: at once.
        instrument: with which it was struck.
        ear: where it was heard then.
        request: the string and how it was plucked, once the player has reported them; None before, and of a drum.
        string: on which of a set it is played, as of `Strings.of_key`; None: the key chooses it.
        gain: the factor of its voices.
        match: by source, the factor of the level match: both sources are the same string, and stay as they are.
        released, cut, timed: as of `PluckVoices`.
    """

    player: InstrumentPlayer
    mixer: Mixer
    id: int
    event: NoteOn
    path: Path
    begin_frame: int = 0
    request: NoteSound | None = None
    string: int | None = None
    gain: float = 1.0
    match: Mapping[str, float] = field(default_factory=lambda: AS_THEY_ARE)
    released: bool = False
    cut: bool = False
    timed: bool = False
    _ended: bool = False  # the player has reported its end, or refused it
    _begun: NoteReport | None = None  # the report of its beginning; None before it
    from_s = 0.0  # where in its motion it begins, as in `PluckVoices`

    def __post_init__(self) -> None:
        self.instrument, self.ear = self.player.instrument, self.player.ear
        self._playing = Playing(0.0, 0, None)  # how far it was at the latest `look`

    def take(self, report: NoteReport) -> None:
        """Take over what the player reports of it: that it began, with string and pluck, or that it ended."""
        if report.kind == of.BEGAN:
            self._begun, self.gain = report, report.gain
            self.string = report.string if report.string >= 0 else None
            if report.parameters is not None:
                pluck = self.event.pluck or self.instrument.pluck.pluck(self.event.velocity)
                width = pluck.width if pluck.shape == "triangular" else report.width
                pluck = pluck.nearest(position=report.position, amplitude_mm=report.amplitude_mm, width=width)
                self.request = NoteSound(StringOf(self.path, report.parameters), pluck, 0.0, self.ear)
            self.look()
        else:
            self._ended = True
            self.cut = self.cut or report.kind == of.REFUSED

    def look(self) -> None:
        """Read from the player how far it has sounded. Any thread."""
        if self._begun is not None and not self.over:
            self._playing = self.player.compiled.playing(self._begun) or self._playing

    @property
    def parameters(self) -> StringParameters | None:
        """The parameters of its string as its key had it; None before it began, and of a drum."""
        return None if self._begun is None else self._begun.parameters

    @property
    def pluck(self) -> Pluck | None:
        """The pluck of its string; None as for `parameters`."""
        return None if self.request is None else self.request.pluck

    @property
    def of_drum(self) -> bool:
        """Return True if it is a drum's."""
        return isinstance(self.instrument.strings, Drums)

    @property
    def known(self) -> bool:
        """Return True if the player has reported it."""
        return self._begun is not None or self.over

    @property
    def over(self) -> bool:
        """Return True if it has ended: nothing of it will be heard any more."""
        return self._ended or self.cut

    @property
    def seconds(self) -> float:
        """The time since it began up to which the device has its samples."""
        self.look()
        return self._playing.seconds

    @property
    def began(self) -> bool:
        """Return True if the device has any of its samples, or it was cut."""
        return self.cut or self.seconds > 0

    @property
    def began_frame(self) -> int:
        """The frame of the mixer at which it began; 0 before that."""
        self.look()
        return self._playing.began_frame

    @property
    def latency_s(self) -> float | None:
        """The seconds from the gesture to the callback that gave the device its first samples; None: not known."""
        self.look()
        return self._playing.struck_to_began_s

    def frame_at(self, seconds: float) -> int:
        """The frame of its mixer at which its motion reaches a time; only once it has begun."""
        return self.began_frame + round(seconds * self.mixer.rate_hz)

    def release_at(self, frame: int) -> None:
        """Let the note fade out from a frame of the mixer on; 0: not any more."""
        self.player.cancel(self.id)
        if frame > 0:
            self.player.release(self.id, frame=frame)

    def release(self, seconds: float) -> None:
        """Let the note fade out within so many seconds, from now on; one that waits for its frame never begins."""
        self.released = True
        self.player.cancel(self.id)
        self.player.release(self.id, max(seconds, 1e-3))

    def end(self) -> None:
        """Mark the note as cut, where no device plays its voices any more."""
        self.cut = True


def drop(note: PluckVoices | KeyNote | None, error: Exception, report: Callable[[str, str], None]) -> None:
    """End a note whose handling failed, and report the error.

    A ValueError is reported in its own words; any other fault as DROPPED, always the same, to be shown once.

    Args:
        note: as far as it was made; None: not at all.
        report: is called with a message and its details.
    """
    if isinstance(error, ValueError):
        report(str(error), "")
    else:
        report(DROPPED, log_fault(error, "while a note was played"))
    if note is not None:
        note.cut = True
        with contextlib.suppress(Exception):  # what has failed may be this
            note.release(DROPPED_S)
