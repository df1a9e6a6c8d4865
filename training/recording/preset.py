"""The preset of a learned note: the one module that knows how models and presets are written."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import fft

from engine.presets import Preset, PresetInfo, find_preset, load_preset, save_preset
from engine.presets.file import arrays_of
from engine.resonators.base import Array
from engine.resonators.recorded import RecordedNote, RecordedString
from training.recording.fit import LearnedNote
from training.recording.glide import TIMES_S
from training.recording.note import FIT_BEGINS_S, Note
from training.recording.physics import COMB_FLOOR, LearnedPhysics, Strung, corrections

BASE = "studio_any_string"  # whose curves play every string
LEAST_GRID = 101
BODY_S = 0.25  # length of a body's response
BODY_RANGE_DB = 70.0  # from the loudest partial down to the softest in it


@dataclass(frozen=True)
class Source:
    """The source of a note.

    Attributes:
        name: of the file; `digest`: its SHA-256.
        rate_hz, frames: of the file, before any conversion.
    """

    name: str
    digest: str
    rate_hz: int
    frames: int


def recorded_note(note: Note, learned: LearnedNote, source: Source) -> RecordedNote:
    """The note for rendering as it was recorded."""
    scale = source.rate_hz / note.rate_hz
    begins = note.onset + round(FIT_BEGINS_S * note.rate_hz)
    poles = learned.poles
    return RecordedNote(
        rate_hz=source.rate_hz,
        frames=source.frames,
        onset=min(source.frames, round(note.onset * scale)),
        begins=min(source.frames, round(begins * scale)),
        glide_s=tuple(TIMES_S.tolist()),
        glide=tuple(learned.glide.shares.tolist()),
        hz=tuple(float(pole.hz) for pole in poles),
        decay=tuple(float(pole.decay) for pole in poles),
        real=tuple(float(pole.a.real) for pole in poles),
        imaginary=tuple(float(pole.a.imag) for pole in poles),
        partial=tuple(pole.partial for pole in poles),
    )


def recorded_string(
    note: RecordedNote,
    physics: LearnedPhysics,
    strung: Strung,
    source: Source,
    settings: dict[str, Any],
    errors: dict[str, float],
) -> RecordedString:
    """The additions of the recording to the law of its string; `settings`: of the fit, `errors`: of the report."""
    figures_of_string: dict[str, Any] = corrections(physics, strung.string)
    return RecordedString(
        pitch_hz=float(strung.string.undamped_frequency(1) / (2 * math.pi)),
        note=note,
        file=source.name,
        digest=source.digest,
        assumed=strung.assumed,
        settings=settings,
        errors={name: float(value) for name, value in errors.items() if math.isfinite(value)},
        **figures_of_string,
    )


def write_preset(path: Path, title: str, strung: Strung, recorded: RecordedString) -> PresetInfo:
    """Write the preset's file: the curves of the shipped model of many strings, with this string.

    Raises:
        PresetError: the shipped preset is missing, or the string cannot be played.
        OSError: the file cannot be written.
    """
    base: Preset = load_preset(find_preset(BASE))
    partials = len(recorded.cents)
    grid = max(LEAST_GRID, 2 * partials + 3)
    info = replace(
        base.info,
        title=title,
        description=f"Learned from {recorded.file}: {partials} partials of two modes each.",
        string=strung.string,
        recorded=recorded,
        modes=2 * partials,
        grid_points=grid,
        model_configuration={**base.info.model_configuration, "modes": 2 * partials, "grid_points": grid},
        knows="the curves of the shipped model of many strings; the string from the recording",
        rel_mse=None,
        rel_mae=None,
        test_rel_mse=None,
        test_rel_mae=None,
    )
    save_preset(path, info, replace(base, info=info, weights={**base.weights, **arrays_of(info)}).model)
    return info


def listening_point(partials: int) -> float:
    """A place so near to an end that no partial has a node there: the force on a bridge, nearly."""
    return 0.5 / (partials + 1)


def body_response(physics: LearnedPhysics, strung: Strung, partials: int, rate_hz: int) -> Array:
    """A minimum-phase impulse response, (frames,): what the instrument makes of the string's partials.

    Its magnitude is that of the recorded partials over those of the same pluck of the bare string, at their
    frequencies, and interpolated between them; it is one note's, and a guess away from its partials.
    """
    k = np.array([partial.number for partial in physics.partials], float)
    hz = np.array([partial.hz for partial in physics.partials])
    comb = np.abs(np.sin(math.pi * k * strung.position))
    bare = np.maximum(comb, COMB_FLOOR) / k**2 * np.abs(np.sin(math.pi * k * listening_point(partials)))
    level = np.log([partial.amplitude for partial in physics.partials]) - np.log(bare)
    used = comb > COMB_FLOOR
    if used.sum() < 3:
        used = np.ones_like(used)
    hz, level = hz[used], level[used]
    level = level - level.max()
    level = np.maximum(level, -BODY_RANGE_DB * math.log(10) / 20)
    size = 1 << 16
    bins = np.arange(size // 2 + 1) * rate_hz / size
    log_gain = np.interp(np.log(np.maximum(bins, 1.0)), np.log(hz), level)
    log_gain = log_gain + np.minimum(0.0, -np.log(np.maximum(bins, 1.0) / hz[-1]))  # falls above the last partial
    cepstrum = fft.irfft(log_gain, size)
    folded = np.zeros(size)
    folded[0] = cepstrum[0]
    folded[1 : size // 2] = 2 * cepstrum[1 : size // 2]
    folded[size // 2] = cepstrum[size // 2]
    response = fft.irfft(np.exp(fft.rfft(folded)), size)[: round(BODY_S * rate_hz)]
    response = response * np.cos(0.5 * math.pi * np.arange(len(response)) / len(response)) ** 2
    return np.asarray(response / np.abs(response).max())
