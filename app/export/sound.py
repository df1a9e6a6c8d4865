"""The sound of a pluck at the listening points: model, truth, their difference, or both side by side.

It is rendered by the same voices that a sound device plays, so that a file holds the sound; ±1 is full scale.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.export.recording import BLOCK_FRAMES, Recording, SoundSamples, blocks
from app.export.struck import Struck
from app.instrument.effects import channels_of
from app.instrument.events import TimedEvent
from app.instrument.offline import render_events
from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB, Source
from app.shared.worker import Progress
from engine import bounds
from engine.pluck import Pluck
from engine.presets import Preset
from engine.sources import ModelSource, Runaway
from engine.values.ear import PICKUPS, Ear, Pickup
from engine.voices import model_program, truth_program, voice_blocks

Voice = Literal["model", "truth"]
VOICES: tuple[Voice, ...] = get_args(Voice)
SOURCES: tuple[Source, ...] = get_args(Source)
LONGEST_S = 600.0
DECAY_RANGE_DB = (10.0, 120.0)
DECAYED_FOR_SURE_DB = 30.0  # rendering continues until the whole string is so far below the wanted decay
LEVEL_WINDOW_S = 0.05  # several periods of a low string, so that its level does not depend on phase
QUIET_FOR_S = 1.0  # for which a key is to be quiet until it has decayed: longer than strings beat

Samples = NDArray[np.float64]


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
        struck: a key of an instrument that `preset` plays, in place of pluck, listening points and pick-up; without
            variation. Its difference is heard without amplifier, body and room.

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
    struck: Struck | None = None

    def __post_init__(self) -> None:
        for name, point in (("listening point", self.listen), ("right listening point", self.listen_right)):
            if point is not None:
                bounds.check(name, point, (0, 1))
        if not 1 / self.preset.info.rate_hz <= self.seconds <= LONGEST_S:
            raise ValueError(f"seconds must be above 0 and at most {LONGEST_S:g}, not {self.seconds:g}")
        bounds.check_choice("source", self.source, SOURCES)
        bounds.check_choice("pickup", self.pickup, PICKUPS)
        if self.source == "both" and (self.listen_right is not None or self.struck is not None):
            raise ValueError("model and truth cannot share one file in stereo; choose two files, or mono")
        bounds.check_all(self, {"decay_db": DECAY_RANGE_DB, "difference_gain_db": DIFFERENCE_GAIN_RANGE_DB})

    @property
    def ear(self) -> Ear:
        """The listening points with their pick-up."""
        points = (self.listen,) if self.listen_right is None else (self.listen, self.listen_right)
        return Ear(points, self.pickup)


@dataclass(frozen=True)
class Voices:
    """Model and truth of one request, (frames, channels) each, of which those are rendered that are needed.

    Attributes:
        ended: False where the sound was to end by its decay but reached its longest duration first.
    """

    sounds: Mapping[Voice, SoundSamples]
    ended: bool = True


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


def render_voices(
    request: SoundRequest,
    sources: Iterable[Source],
    rate_hz: int = 0,
    *,
    all_voices: bool = False,
    progress: Progress = lambda *_: None,
) -> Voices:
    """Render model and truth once for any number of sources of one pluck.

    `request.source` counts for amplifier, body and room of a key alone, which a difference does not have.

    Args:
        rate_hz: of the samples; 0 for the preset's own.
        all_voices: render both whatever the sources; a model that runs away is left out if no source needs it.

    Raises:
        Cancelled: `progress` raised it.
        Runaway: the model's output grew without bound or is not finite.
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
    decay_db = None if request.decay_db is None else request.decay_db + DECAYED_FOR_SURE_DB
    if request.struck is not None:
        recording = Recording(channels_of(request.struck.patch))
        for block in _struck_blocks(request, request.struck, voice, rate_hz, decay_db, progress):
            if not np.isfinite(block).all():
                raise Runaway(len(recording) / rate_hz)
            recording.append(block)
        return recording
    preset, ear = request.preset, request.ear
    program = truth_program(preset.info, rate_hz) if voice == "truth" else model_program(preset, rate_hz)
    source = ModelSource(preset) if program.rendered else None
    recording = Recording(len(ear.points))
    for block in voice_blocks(program, source, preset.info, request.pluck, ear, request.seconds, progress, decay_db):
        recording.append(block)
    return recording


def _struck_blocks(
    request: SoundRequest,
    struck: Struck,
    voice: Voice,
    rate_hz: int,
    decay_db: float | None,
    progress: Callable[[float], None],
) -> Iterator[NDArray[np.float32]]:
    """Blocks (frames, channels) of a key, until it has been quiet for QUIET_FOR_S where it may end by its decay."""
    seconds = request.seconds
    peak, quiet = 0.0, 0
    for block in render_events(
        struck.patch,
        request.preset,
        [TimedEvent(0.0, struck.event)],
        rate_hz,
        voice,
        seconds,
        limited=False,
        advanced=lambda done_s: progress(min(done_s / seconds, 1.0)),
        varied=False,
        dry=request.source == "difference",
    ):
        yield block
        loudest = float(np.abs(block).max(initial=0.0))
        peak = max(peak, loudest)
        quiet = quiet + len(block) if loudest < peak * 10 ** (-(decay_db or np.inf) / 20) else 0
        if decay_db is not None and quiet > QUIET_FOR_S * rate_hz:
            return
