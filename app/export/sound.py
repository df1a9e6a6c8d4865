"""The sound of a note at the listening points: model, truth, their difference, or both side by side.

It is rendered by the same voices that a sound device plays, so that a file holds the sound; ±1 is full scale.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.export.recording import BLOCK_FRAMES, Recording, SoundSamples, blocks
from app.export.wav import LONGEST_S, WavSettings
from app.player.effects import channels_of
from app.player.events import TimedEvent
from app.player.offline import render_events
from app.rendering.note_sound import NoteSound
from app.shared.vocabulary import Source
from app.shared.worker import Progress
from engine import bounds
from engine.levels import MATCHED_S, match_gain
from engine.presets import Preset
from engine.sources import ModelSource, Runaway
from engine.voices import model_program, truth_program, voice_blocks

Voice = Literal["model", "truth"]
VOICES: tuple[Voice, ...] = get_args(Voice)
SOURCES: tuple[Source, ...] = get_args(Source)
DECAYED_FOR_SURE_DB = 30.0  # rendering continues until the whole string is so far below the wanted decay
LEVEL_WINDOW_S = 0.05  # several periods of a low string, so that its level does not depend on phase
QUIET_FOR_S = 1.0  # for which a key is to be quiet until it has decayed: longer than strings beat
IN_ONE_FILE = "model and truth cannot share one file in stereo; choose two files, or mono"

Samples = NDArray[np.float64]
Part = Callable[[float], None]  # receives the share of a voice that is done


@dataclass(frozen=True)
class Voices:
    """Model and truth of one sound, (frames, channels) each, of which those are rendered that are needed.

    Attributes:
        ended: False where the sound was to end by its decay but reached its longest duration first.
        match: the factor of the model's samples that brings it to the level of the truth. 1 where levels are not to
            be matched, where they differ by more than 40 dB, and where one of the two is silent.
    """

    sounds: Mapping[Voice, SoundSamples]
    ended: bool = True
    match: float = 1.0


@dataclass(frozen=True)
class Mixed:
    """The samples of a source, (frames, channels), computed for each slice from its voices."""

    voices: Voices
    source: Source
    difference_gain_db: float = 0.0

    def __len__(self) -> int:
        return min(len(self.voices.sounds[name]) for name in voices_of(self.source))

    def __getitem__(self, frames: slice) -> Samples:
        """The samples of a slice, (frames, channels); of "both" the model's channels come first."""
        names = voices_of(self.source)
        parts = [self._gain(name) * self.voices.sounds[name][frames].astype(np.float64) for name in names]
        if self.source == "both":
            return np.concatenate(parts, axis=1)
        if self.source == "difference":
            return 10 ** (self.difference_gain_db / 20) * (parts[0] - parts[1])
        return parts[0]

    def _gain(self, voice: Voice) -> float:
        """The factor of a voice's samples: see `Voices.match`."""
        return self.voices.match if voice == "model" else 1.0


def voices_of(source: Source) -> tuple[Voice, ...]:
    """The voices, of model and truth, that must be rendered for a source."""
    return ("model",) if source == "model" else ("truth",) if source == "truth" else VOICES


def check_sources(sound: NoteSound, sources: Collection[Source], rate_hz: int) -> None:
    """Raise ValueError: these sources cannot be rendered; the message names the value and its range.

    Args:
        rate_hz: of the preset: a sound has a sample at least.
    """
    for source in sources:
        bounds.check_choice("source", source, SOURCES)
    if not 1 / rate_hz <= sound.seconds <= LONGEST_S:
        raise ValueError(f"seconds must be above 0 and at most {LONGEST_S:g}, not {sound.seconds:g}")
    if "both" in sources and (len(sound.ear.points) > 1 or sound.struck is not None):
        raise ValueError(IN_ONE_FILE)
    if sound.struck is not None and "difference" in sources and len(sources) > 1:  # it has no body and room
        raise ValueError("through an instrument, export the difference by itself")


def render_voices(
    sound: NoteSound,
    preset: Preset,
    sources: Collection[Source],
    settings: WavSettings,
    progress: Progress = lambda *_: None,
) -> Voices:
    """Render model and truth once for any number of sources of one note.

    A key's difference is rendered without amplifier, body and room.

    Args:
        preset: as `sound.load` gives it.
        settings: where normalised or matched, both are rendered whatever the sources, for the gain; a model that runs
            away is left out if no source needs it.

    Raises:
        ValueError: see `check_sources`.
        Cancelled: `progress` raised it.
        Runaway: the model's output grew without bound or is not finite.
    """
    check_sources(sound, sources, preset.info.rate_hz)
    needed = {voice for source in sources for voice in voices_of(source)}
    decay_db, rate_hz = settings.decay_db, settings.rate_hz or preset.info.rate_hz
    both = settings.normalise or settings.level_match or decay_db is not None
    voices = [voice for voice in VOICES if voice in needed or both]
    until_db = None if decay_db is None else decay_db + DECAYED_FOR_SURE_DB  # None: to the longest duration
    sounds: dict[Voice, Recording] = {}
    for place, voice in enumerate(voices):

        def part(share: float, place: int = place) -> None:
            progress((place + share) / len(voices))

        if sound.struck is None:
            channels, rendered = len(sound.ear.points), _plucked_blocks(sound, preset, voice, rate_hz, part, until_db)
        else:
            channels, dry = channels_of(sound.struck.instrument), "difference" in sources
            rendered = _struck_blocks(sound, preset, voice, rate_hz, part, until_db, dry)
        recording = Recording(channels)
        with suppress(*(() if voice in needed else (Runaway,))):
            for block in rendered:
                recording.append(block)
            sounds[voice] = recording
    match = 1.0  # where no level is to be matched, or the model ran away
    if settings.level_match and len(sounds) == len(VOICES):
        match = match_gain(*(_level(sounds[voice], rate_hz) for voice in VOICES))
    if decay_db is None:
        return Voices(sounds, match=match)
    frames = max(decayed_frames(recording, rate_hz, decay_db) for recording in sounds.values())
    for recording in sounds.values():
        recording.cut(frames)
    return Voices(sounds, frames < round(sound.seconds * rate_hz), match)


def _level(sound: SoundSamples, rate_hz: int) -> float:
    """Root mean square of the part whose levels are matched."""
    return math.sqrt(float(np.square(sound[: round(MATCHED_S * rate_hz)], dtype=np.float64).mean()))


def compared_sounds(sound: NoteSound, rate_hz: int) -> Mapping[str, NDArray[np.float32]]:
    """Model and truth by source, (frames, channels), without amplifier, body and room: of a listening test.

    Raises:
        PresetError, Runaway: the preset cannot be used, or its output grew without bound.
    """
    sources: tuple[Source, ...] = ("difference",)
    voices = render_voices(sound, sound.load(rate_hz), sources, WavSettings(rate_hz=rate_hz))
    return {voice: samples[:].astype(np.float32) for voice, samples in voices.sounds.items()}


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


def _plucked_blocks(
    sound: NoteSound,
    preset: Preset,
    voice: Voice,
    rate_hz: int,
    part: Part,
    until_db: float | None,
) -> Iterator[NDArray[np.float32]]:
    """Blocks (frames, points) of the voice that a device would play, with all modes.

    Args:
        part: is called with the share of the voice that is done.
        until_db: the voice ends when the whole string is so far below its loudest; None: after the note's seconds.
    """
    info, ear = preset.info, replace(sound.ear, solo=0)
    program = truth_program(info, rate_hz) if voice == "truth" else model_program(preset, rate_hz)
    source = ModelSource(preset) if program.rendered else None
    return voice_blocks(program, source, info, sound.pluck, ear, sound.seconds, part, until_db)


def _struck_blocks(
    sound: NoteSound,
    preset: Preset,
    voice: Voice,
    rate_hz: int,
    part: Part,
    until_db: float | None,
    dry: bool,
) -> Iterator[NDArray[np.float32]]:
    """Blocks (frames, channels) of a key.

    Args:
        part: is called with the share of the sound that is done.
        until_db: it ends when it has been so far below its peak for QUIET_FOR_S; None: after the note's seconds.
        dry: without amplifier, body and room.

    Raises:
        Runaway: a sample is not finite.
    """
    struck, seconds = sound.struck, sound.seconds
    assert struck is not None
    peak, quiet, done = 0.0, 0, 0  # the largest sample so far; frames that it has been quiet for; frames in all
    for block in render_events(
        struck.instrument,
        preset,
        [TimedEvent(0.0, struck.event)],
        rate_hz,
        voice,
        seconds,
        limited=False,
        varied=False,
        dry=dry,
    ):
        if not np.isfinite(block).all():
            raise Runaway(done / rate_hz)
        yield block
        done += len(block)
        part(min(done / rate_hz / seconds, 1.0))
        loudest = float(np.abs(block).max(initial=0.0))
        peak = max(peak, loudest)
        quiet = quiet + len(block) if loudest < peak * 10 ** (-(until_db or np.inf) / 20) else 0
        if until_db is not None and quiet > QUIET_FOR_S * rate_hz:
            return
