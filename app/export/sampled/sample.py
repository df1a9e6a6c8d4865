"""A note as a FLAC or WAV file: cut where it is silent, faded out and raised to full level."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

import numpy as np
import soundfile
from numpy.typing import NDArray

from app.export.sampled.plan import SampleBits, SampleFormat
from app.export.wav import faded_out, quantised

SILENT_DB = -90.0  # below the note's own peak
INAUDIBLE_DBFS = -120.0  # a note without a sample above this is silence
PEAK_DBFS = -1.0  # of every stored sample: players interpolate, and overshoot
END_FADE_S = 0.02  # the fade-out of a note that has become silent
CUT_FADE_S = 0.5  # of one that still rings, a quarter of the sample at most
LEVEL_PART_S = 0.4  # at the beginning of a note, whose level is stored: the block of a loudness meter
FEWEST_FRAMES = 64  # the shortest sample that every player accepts
_SUBTYPES: dict[SampleBits, str] = {"16": "PCM_16", "24": "PCM_24"}


@dataclass(frozen=True)
class StoredSample:
    """A note as it is stored.

    Attributes:
        gain_db: by how much it was raised above the level at which it was rendered.
        level_db: root mean square of its first 0.4 s, over all channels, as rendered.
        cut: whether it still rang at its last frame.
    """

    frames: int
    channels: int
    gain_db: float
    level_db: float
    cut: bool = False

    @property
    def peak_db(self) -> float:
        """The peak of the note as rendered, relative to full scale."""
        return PEAK_DBFS - self.gain_db if self.level_db > INAUDIBLE_DBFS else INAUDIBLE_DBFS


def sample_of(rendered: NDArray[np.floating], rate_hz: int) -> tuple[NDArray[np.float64], StoredSample]:
    """Prepare a rendered note, (frames, channels), where ±1 is full scale.

    Returns:
        The sound to be stored, (frames, channels), its peak at PEAK_DBFS, and what is to be known of it.

    Raises:
        ValueError: there are no frames, or a value is not finite.
    """
    if rendered.ndim != 2 or not 1 <= rendered.shape[1] <= 2 or len(rendered) == 0:
        raise ValueError(f"a note of shape {rendered.shape} is no sound of one or two channels")
    if not np.isfinite(rendered).all():
        raise ValueError("the note holds values that are not finite; choose another source or a softer pluck")
    sound = rendered.astype(np.float64)
    level = np.abs(sound).max(axis=1)
    peak = float(level.max())
    if peak <= 10 ** (INAUDIBLE_DBFS / 20):
        silence = np.zeros((FEWEST_FRAMES, sound.shape[1]))
        return silence, StoredSample(len(silence), sound.shape[1], 0.0, INAUDIBLE_DBFS)
    audible_frames = int(np.flatnonzero(level > peak * 10 ** (SILENT_DB / 20))[-1]) + 1
    end = audible_frames + round(END_FADE_S * rate_hz)  # frames that are kept, where there are so many
    cut = end > len(sound)
    sound = sound[:end]
    fade = min(round(CUT_FADE_S * rate_hz), len(sound) // 4) if cut else round(END_FADE_S * rate_hz)
    part = sound[: math.ceil(LEVEL_PART_S * rate_hz)]
    level_db = max(INAUDIBLE_DBFS, 10 * math.log10(float(np.mean(part**2))))
    gain_db = math.floor(100 * (PEAK_DBFS - 20 * math.log10(peak))) / 100
    sound = faded_out(sound, fade) * 10 ** (gain_db / 20)
    sound = np.pad(sound, ((0, max(0, FEWEST_FRAMES - len(sound))), (0, 0)))
    return sound, StoredSample(len(sound), sound.shape[1], gain_db, level_db, cut)


def encoded(sound: NDArray[np.float64], rate_hz: int, form: SampleFormat, bits: SampleBits) -> bytes:
    """The whole file; the same samples make the same bytes."""
    buffer = io.BytesIO()
    numbers, _ = quantised(sound, bits)
    soundfile.write(buffer, numbers, rate_hz, _SUBTYPES[bits], format=form.upper())
    return buffer.getvalue()
