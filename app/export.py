"""Export: a pluck of a preset, heard at a point of the string, as a WAV file that carries its recipe.

The window and the command line write the same files through this module.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from app.version import PROGRAM, program_version
from app.wav import BITS, RATE_RANGE_HZ, Bits, EncodedWav, WavSettings, encode_wav
from app.whole_file import WriteError, whole_file
from engine.pluck import Pluck
from engine.preset import Preset
from engine.sine_transform import listening_weights
from engine.sources import FULL_SCALE_M, ModelSource, Runaway, StringSource, TruthSource, project

Source = Literal["model", "truth", "difference"]
SOURCES: tuple[Source, ...] = get_args(Source)
LONGEST_S = 600.0
BLOCK_FRAMES = 4096  # between two looks at `cancelled`

Progress = Callable[[float], None]  # is told the share that is done, 0 … 1
Cancelled = Callable[[], bool]


class ExportError(Exception):
    """An export that failed. The message names the path, what happened and the remedy. No file is left."""


class ExportCancelled(Exception):
    """The user stopped the export. No file is left."""


@dataclass(frozen=True)
class SoundRequest:
    """What is to be heard.

    Attributes:
        listen: the listening point, 0 … 1 in lengths of the string.
        source: "difference" is model minus truth.

    Raises:
        ValueError: a value is out of its range; the message names it and the range.
    """

    preset: Preset
    pluck: Pluck
    listen: float
    seconds: float
    source: Source = "model"

    def __post_init__(self) -> None:
        if not 0 <= self.listen <= 1:
            raise ValueError(f"listening point must lie in 0 … 1, not {self.listen:g}")
        if not 1 / self.preset.info.rate_hz <= self.seconds <= LONGEST_S:
            raise ValueError(f"seconds must be above 0 and at most {LONGEST_S:g}, not {self.seconds:g}")
        if self.source not in SOURCES:
            raise ValueError(f"source {self.source!r} is not one of {', '.join(SOURCES)}")


@dataclass(frozen=True)
class WavReport:
    """What was written.

    Attributes:
        peak_db: the largest sample in dBFS before any clipping; -inf for silence.
        clipped: samples beyond full scale that were cut; always 0 in floating point.
    """

    path: Path
    frames: int
    rate_hz: int
    size_bytes: int
    peak_db: float
    clipped: int
    gain_db: float


def export_sound(
    request: SoundRequest,
    path: Path,
    settings: WavSettings | None = None,
    *,
    progress: Progress = lambda share: None,
    cancelled: Cancelled = lambda: False,
) -> WavReport:
    """Renders and writes a WAV file, whole or not at all.

    Raises:
        ExportError: the file cannot be written.
        ExportCancelled: `cancelled` said so.
        Runaway: the model's output stopped being a string's.
    """
    settings = settings or WavSettings()
    info = request.preset.info
    tags = _tags(info.title, recipe(request, settings))
    with _written_whole(path) as write:  # opened first, so that a folder that refuses is told before the work
        samples = render_sound(request, progress=progress, cancelled=cancelled)
        beside = _sounds_of_one_gain(request, cancelled) if settings.normalise else []
        return write(encode_wav(samples, info.rate_hz, settings, tags, beside))


def write_wav(
    path: Path,
    samples: NDArray[np.floating],
    rate_hz: int,
    settings: WavSettings | None = None,
    *,
    title: str = "",
    recipe: Mapping[str, Any] | None = None,
) -> WavReport:
    """Writes samples (frames,) or (frames, channels), ±1 being full scale, whole or not at all.

    Raises:
        ExportError: the file cannot be written, or a sample is not finite.
    """
    with _written_whole(path) as write:
        return write(encode_wav(samples, rate_hz, settings or WavSettings(), _tags(title, recipe)))


def render_sound(
    request: SoundRequest, *, progress: Progress = lambda share: None, cancelled: Cancelled = lambda: False
) -> NDArray[np.float64]:
    """The samples of a request at the preset's rate, ±1 being full scale."""
    if request.source != "difference":
        return _render(request, request.source, progress, cancelled)
    model = _render(request, "model", lambda share: progress(share / 2), cancelled)
    return model - _render(request, "truth", lambda share: progress(0.5 + share / 2), cancelled)


def render_signal(
    source: StringSource,
    displacement_m: Tensor,
    seconds: float,
    listen: float,
    *,
    progress: Progress = lambda share: None,
    cancelled: Cancelled = lambda: False,
) -> NDArray[np.float64]:
    """Samples (frames,) of one source at a listening point, ±1 being full scale; the first is frame 0.

    Args:
        displacement_m: frame 0, (grid_points,), already projected on the modes in use.

    Raises:
        ExportCancelled: `cancelled` said so between two blocks.
    """
    frames = max(1, round(seconds * source.rate_hz))
    weights = listening_weights(torch.tensor([listen], dtype=torch.float64), source.grid_points)
    signal = torch.zeros(frames, dtype=torch.float64)
    signal[0] = displacement_m.double() @ weights[:, 0]
    state = source.start(displacement_m[None])
    for first in range(1, frames, BLOCK_FRAMES):
        if cancelled():
            raise ExportCancelled
        steps = min(BLOCK_FRAMES, frames - first)
        block, state = source.advance(state, steps, weights)
        signal[first : first + steps] = block[0, :, 0]
        progress((first + steps) / frames)
    return (signal / FULL_SCALE_M).numpy()


def _render(
    request: SoundRequest, name: Literal["model", "truth"], progress: Progress, cancelled: Cancelled
) -> NDArray[np.float64]:
    info = request.preset.info
    source = ModelSource(request.preset) if name == "model" else TruthSource(info)
    displacement_m = project(request.pluck.displacement(info.grid_points), info.modes)
    return render_signal(
        source, displacement_m, request.seconds, request.listen, progress=progress, cancelled=cancelled
    )


def _sounds_of_one_gain(request: SoundRequest, cancelled: Cancelled) -> list[NDArray[np.float64]]:
    """Model and truth, so that normalising keeps the ratio of their levels; no model that runs away."""
    sounds = [_render(request, "truth", lambda share: None, cancelled)]
    with suppress(Runaway):
        sounds.append(_render(request, "model", lambda share: None, cancelled))
    return sounds


def recipe(request: SoundRequest, settings: WavSettings) -> dict[str, Any]:
    """All that repeats the file, as plain data: the comment of the file is this in JSON."""
    info = request.preset.info
    try:
        digest = hashlib.sha256(request.preset.path.read_bytes()).hexdigest()
    except OSError as error:
        raise ExportError(
            f"{request.preset.path}: the preset cannot be read any more ({error.strerror}); put it back"
        ) from error
    return {
        "program": PROGRAM,
        "version": program_version(),
        "preset": request.preset.name,
        "preset_sha256": digest,
        "pluck": asdict(request.pluck),
        "listen": request.listen,
        "seconds": request.seconds,
        "source": request.source,
        "preset_rate_hz": info.rate_hz,
        "horizon_s": info.horizon_s,
        "full_scale_m": FULL_SCALE_M,
        "rate_hz": settings.rate_hz or info.rate_hz,
        "bits": settings.bits,
        "normalise": settings.normalise,
    }


def default_file_name(preset: str, pluck: Pluck, rate_hz: int, source: Source) -> str:
    """`{preset}_x{position}_a{amplitude in mm}_{rate}_{source}.wav`."""
    return f"{preset}_x{pluck.position:.2f}_a{pluck.amplitude_mm:.1f}_{rate_hz}_{source}.wav"


def _tags(title: str, recipe: Mapping[str, Any] | None) -> dict[str, str]:
    tags = {"title": title, "software": f"{PROGRAM} {program_version()}"}
    if recipe is not None:
        tags["comment"] = json.dumps(recipe, separators=(",", ":"), allow_nan=False)
    return {name: text for name, text in tags.items() if text}


@contextmanager
def _written_whole(path: Path) -> Iterator[Callable[[EncodedWav], WavReport]]:
    """A function that writes the file at `path`, which appears when the block ends well."""
    try:
        with whole_file(path) as file:

            def write(wav: EncodedWav) -> WavReport:
                file.write(wav.data)
                level = wav.level
                return WavReport(
                    path, wav.frames, wav.rate_hz, len(wav.data), level.peak_db, level.clipped, level.gain_db
                )

            yield write
    except WriteError as error:
        raise ExportError(str(error)) from error
    except ValueError as error:
        raise ExportError(f"{path}: {error}") from error
    except MemoryError as error:
        raise ExportError(f"{path}: the sound does not fit in memory; choose a shorter duration") from error


__all__ = [
    "BITS",
    "LONGEST_S",
    "RATE_RANGE_HZ",
    "SOURCES",
    "Bits",
    "ExportCancelled",
    "ExportError",
    "SoundRequest",
    "Source",
    "WavReport",
    "WavSettings",
    "default_file_name",
    "export_sound",
    "recipe",
    "render_signal",
    "render_sound",
    "write_wav",
]
