"""The sound of a pluck at the listening points: model, truth, their difference, or both side by side.

It is rendered by the same voices that a sound device plays, so that a file holds the sound; ±1 is full scale.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from app.export.recording import BLOCK_FRAMES, Recording, SoundSamples, blocks
from app.export.struck import Struck
from app.instrument.bodies import body_digest
from app.instrument.effects import channels_of, effects_from
from app.patches.patch import BodyChoice
from app.shared.value import Value
from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB, Source
from app.shared.worker import Progress
from engine import bounds
from engine.effects import Effects
from engine.pluck import Pluck
from engine.presets import Preset
from engine.sources import ModelSource, Runaway
from engine.values.ear import PICKUPS, Ear, Pickup
from engine.values.effects import Amp, Room
from engine.voices import model_program, truth_program, voice_blocks

Voice = Literal["model", "truth"]
VOICES: tuple[Voice, ...] = get_args(Voice)
SOURCES: tuple[Source, ...] = get_args(Source)
LONGEST_S = 600.0
DECAY_RANGE_DB = (10.0, 120.0)
DECAYED_FOR_SURE_DB = 30.0  # rendering continues until the whole string is so far below the wanted decay
MOST_GAIN = 1e6
LEVEL_WINDOW_S = 0.05  # several periods of a low string, so that its level does not depend on phase

Samples = NDArray[np.float64]


class Through(Value):
    """The parts that an instrument added to a string plucked by hand, in recipes of earlier versions.

    Attributes:
        instrument: its name.
        gain: the factor of the string, which makes all keys equally loud; with the instrument's level.
        level_db: of the instrument, in `gain` too: its amplifier does not count it as drive.
        body_sha256: of the file of a body of the user's own.
    """

    instrument: str
    gain: float = Field(ge=0, le=MOST_GAIN)
    body: BodyChoice = BodyChoice()
    room: Room = Room()
    amp: Amp = Amp()
    level_db: float = 0.0
    body_sha256: str = ""

    @property
    def effects(self) -> Effects | None:
        """Raise ValueError: the body is not here, or another of its name."""
        if body_digest(self.body.name) != self.body_sha256:
            raise ValueError(
                f"the body {self.body.name} is not the one of {self.instrument}; get its file and add it"
            )
        return effects_from(self.body, self.room, self.amp, self.level_db)


@dataclass(frozen=True)
class SoundRequest:
    """A request to render a sound.

    Attributes:
        listen: the listening point, as a fraction of the string's length.
        seconds: the duration; with `decay_db` the longest.
        source: "difference" is model minus truth, "both" has the model in the left channel, the truth in the right.
        listen_right: the listening point of a right channel; None for mono.
        pickup: 10 mm of "displacement" or 30 m/s of "velocity" are full scale.
        difference_gain_db: gain of the difference.
        decay_db: the sound ends where both model and truth have fallen this far below their maximum. So all
            files of a pluck have the same length. None: it lasts `seconds`.
        through: level, amplifier, body and room of an instrument; a difference has its level alone. None: the string
            alone.
        struck: a key of an instrument that `preset` plays, in place of pluck, listening points and pick-up. Its
            difference is heard without amplifier, body and room too.

    Raises:
        ValueError: a value is out of its range; the message names it and the range.
    """

    preset: Preset
    pluck: Pluck
    listen: float
    seconds: float
    source: Source = "model"
    listen_right: float | None = None
    pickup: Pickup = "displacement"
    difference_gain_db: float = 0.0
    decay_db: float | None = None
    through: Through | None = None
    struck: Struck | None = None

    def __post_init__(self) -> None:
        for name, point in (("listening point", self.listen), ("right listening point", self.listen_right)):
            if point is not None:
                bounds.check(name, point, (0, 1))
        if not 1 / self.preset.info.rate_hz <= self.seconds <= LONGEST_S:
            raise ValueError(f"seconds must be above 0 and at most {LONGEST_S:g}, not {self.seconds:g}")
        bounds.check_choice("source", self.source, SOURCES)
        bounds.check_choice("pickup", self.pickup, PICKUPS)
        stereo = self.listen_right is not None or self.effects is not None or self.struck is not None
        if self.source == "both" and stereo:
            raise ValueError("model and truth cannot share one file in stereo; choose two files, or mono")
        if self.through is not None and self.struck is not None:
            raise ValueError("an instrument plays a key, or is added to a pluck; leave out one of the two")
        bounds.check_all(self, {"decay_db": DECAY_RANGE_DB, "difference_gain_db": DIFFERENCE_GAIN_RANGE_DB})

    @property
    def effects(self) -> Effects | None:
        """Amplifier, body and room."""
        return None if self.through is None or self.source == "difference" else self.through.effects

    @property
    def points(self) -> tuple[float, ...]:
        """The listening points."""
        return (self.listen,) if self.listen_right is None else (self.listen, self.listen_right)


@dataclass(frozen=True)
class Voices:
    """Model and truth of one request, (frames, channels) each, of which those are rendered that are needed.

    Attributes:
        ended: False where the sound was to end by its decay but reached its longest duration first.
    """

    sounds: Mapping[Voice, SoundSamples]
    ended: bool = True

    def samples(self, source: Source, difference_gain_db: float = 0.0) -> Samples:
        """All samples of a source: (frames,), or (frames, 2) in stereo and for "both"."""
        mixed = Mixed(self, source, difference_gain_db)[:]
        return mixed[:, 0] if mixed.shape[1] == 1 else mixed


@dataclass(frozen=True)
class Mixed:
    """The samples of a source, (frames, channels), computed for each slice from its voices."""

    voices: Voices
    source: Source
    difference_gain_db: float = 0.0

    def __len__(self) -> int:
        return min(map(len, self._parts))

    def __getitem__(self, frames: slice) -> Samples:
        parts = [part[frames].astype(np.float64) for part in self._parts]
        if self.source == "both":
            return np.concatenate(parts, axis=1)
        if self.source == "difference":
            return 10 ** (self.difference_gain_db / 20) * (parts[0] - parts[1])
        return parts[0]

    @property
    def _parts(self) -> list[SoundSamples]:
        return [self.voices.sounds[voice] for voice in voices_of(self.source)]


def voices_of(source: Source) -> tuple[Voice, ...]:
    """The voices, of model and truth, that must be rendered for a source."""
    return ("model",) if source == "model" else ("truth",) if source == "truth" else VOICES


def render_sound(request: SoundRequest, rate_hz: int = 0, *, progress: Progress = lambda *_: None) -> Samples:
    """The samples of a request, (frames,) or (frames, 2).

    Args:
        rate_hz: 0 for the preset's own.

    Raises:
        Cancelled: `progress` raised it.
        Runaway: the model's output grew without bound or is not finite.
    """
    voices = render_voices(request, (request.source,), rate_hz, progress=progress)
    return voices.samples(request.source, request.difference_gain_db)


def render_voices(
    request: SoundRequest,
    sources: Iterable[Source],
    rate_hz: int = 0,
    *,
    all_voices: bool = False,
    progress: Progress = lambda *_: None,
) -> Voices:
    """Render model and truth once for any number of sources of one pluck.

    `request.source` counts for body and room alone, which a difference does not have.

    Args:
        rate_hz: of the samples; 0 for the preset's own.
        all_voices: render both whatever the sources; a model that runs away is left out if no source needs it.

    Raises:
        As `render_sound`.
    """
    sources, rate_hz = tuple(sources), rate_hz or request.preset.info.rate_hz
    needed = {voice for source in sources for voice in voices_of(source)}
    voices = [voice for voice in VOICES if voice in needed or all_voices or request.decay_db is not None]
    sounds: dict[Voice, Recording] = {}
    for place, voice in enumerate(voices):

        def part(share: float, place: int = place) -> None:
            progress((place + share) / len(voices))

        with suppress(*(() if voice in needed else (Runaway,))):
            sounds[voice] = _render(request, voice, rate_hz, part)
    if request.decay_db is None:
        return Voices(sounds)
    ends = [decayed_frames(sound, rate_hz, request.decay_db) for sound in sounds.values()]
    frames = max(ends)
    ended = frames < round(request.seconds * rate_hz)
    for sound in sounds.values():
        sound.cut(frames)
    return Voices(sounds, ended)


def decayed_frames(sound: SoundSamples, rate_hz: int, decay_db: float) -> int:
    """The number of frames of a sound until its level stays `decay_db` below its maximum.

    The level is the mean square over windows of 50 ms and all points. Returns all frames where it does not fall so
    far, and one window for silence.
    """
    window = max(1, round(LEVEL_WINDOW_S * rate_hz))
    powers = []
    for _, block in blocks(sound, window * max(1, BLOCK_FRAMES // window)):
        whole = np.zeros((-(-len(block) // window) * window, block.shape[1]))
        whole[: len(block)] = block
        powers.append(np.square(whole).reshape(-1, window * block.shape[1]).sum(1))
    power = np.concatenate(powers)
    loud = np.flatnonzero(power > power.max() * 10 ** (-decay_db / 10))
    last = int(loud[-1]) + 1 if len(loud) else 1
    return min(len(sound), last * window)


def _render(request: SoundRequest, voice: Voice, rate_hz: int, progress: Callable[[float], None]) -> Recording:
    """The samples (frames, channels) of the voice that a device would play."""
    preset, info = request.preset, request.preset.info
    decay_db = None if request.decay_db is None else request.decay_db + DECAYED_FOR_SURE_DB
    if request.struck is not None:
        struck_recording = Recording(channels_of(request.struck.patch))
        dry = request.source == "difference"
        for block in request.struck.sound(preset, voice, rate_hz, request.seconds, decay_db, dry, progress):
            if not np.isfinite(block).all():
                raise Runaway(len(struck_recording) / rate_hz)
            struck_recording.append(block)
        return struck_recording
    program = truth_program(info, rate_hz) if voice == "truth" else model_program(preset, rate_hz)
    ear = Ear(request.points, request.pickup)
    through, recording = request.through, None
    for block in voice_blocks(
        program,
        ModelSource(preset) if program.rendered else None,
        info,
        request.pluck,
        ear,
        request.seconds,
        progress,
        decay_db,
        1.0 if through is None else through.gain,
        request.effects,
    ):
        recording = recording or Recording(block.shape[1])
        recording.append(block)
    assert recording is not None
    return recording
