"""Export: the sound of a note as WAV files with their recipes, each written whole or not at all.

The window and the command line both write through this module.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import BinaryIO

from app.export.recipe import SoundRecipe
from app.export.recording import SoundSamples
from app.export.sound import Mixed, check_sources, render_voices
from app.export.wav import WavSettings, WrittenSound, write_wav
from app.rendering.note_sound import NoteSound
from app.shared.version import PROGRAM, program_version
from app.shared.vocabulary import Source
from app.shared.worker import Progress
from engine.pluck import Pluck
from engine.presets import Preset
from engine.result_file import WriteError, explain, whole_file

LONGEST_NAME = 150  # characters of a preset's name in a file's name
DECAY_FADE_S = 0.05  # the fade-out where a sound ends by its decay


@dataclass(frozen=True)
class WavReport(WrittenSound):
    """The report of a WAV file that was written.

    Attributes:
        past_training_s: how much of the sound lies past the model's training horizon; 0 for the truth.
        decayed: False where the sound was to end by its decay but reached its longest duration first.
    """

    path: Path
    past_training_s: float
    decayed: bool


def export_sounds(
    sound: NoteSound,
    preset: Preset,
    paths: Mapping[Source, Path],
    settings: WavSettings,
    progress: Progress = lambda *_: None,
) -> list[WavReport]:
    """Render a note once and write a file for each source, model and truth with one gain.

    Args:
        preset: plays it, as `sound.load` gives it.
        paths: the file of each source; a difference, which is heard without body and room, has none beside it where
            an instrument is heard.

    Returns:
        The reports in the order of `paths`.

    Raises:
        ValueError: see `check_sources`.
        WriteError: a file cannot be written; none is left.
        PresetError: the preset's file cannot be read any more.
        Cancelled: `progress` raised it; no file is left.
        Runaway: the model's output grew without bound or is not finite.
    """
    if settings.decay_db is not None:  # it ends by its decay, behind a longer fade-out
        settings = replace(settings, fade_out_s=max(settings.fade_out_s, DECAY_FADE_S))
    info = preset.info
    check_sources(sound, paths, info.rate_hz)
    with ExitStack() as files:
        recipes = {source: SoundRecipe.of(sound, preset, source, settings) for source in paths}
        # opened first, so that a folder that cannot be written to fails before the work
        opened = {source: files.enter_context(_open_whole(path)) for source, path in paths.items()}
        rate_hz = settings.rate_hz or info.rate_hz
        try:
            voices = render_voices(sound, preset, paths, settings, progress)
        except OSError as error:  # the recordings lie in temporary files
            raise WriteError(explain(Path(tempfile.gettempdir()), error)) from error
        # of each file the gain follows from its own recipe, whatever else is written beside it
        beside: list[SoundSamples] = list(voices.sounds.values()) if settings.normalise else []
        reports = []
        for source, file in opened.items():
            path, samples = paths[source], Mixed(voices, source, settings.difference_gain_db)
            with _explain_errors(path):
                tags = _tags(info.title, recipes[source])
                written = write_wav(file, samples, rate_hz, settings, tags, beside)
            past_s = 0.0 if source == "truth" else max(0.0, written.seconds - info.horizon_s)
            reports.append(WavReport(**asdict(written), path=path, past_training_s=past_s, decayed=voices.ended))
    return reports


def default_file_name(preset: str, pluck: Pluck, rate_hz: int, source: Source) -> str:
    """The name `{preset}_x{position}_a{amplitude in mm}_{rate}_{source}.wav`; never a path, whatever `preset` is."""
    preset = re.sub(r"[^\w .+-]", "_", preset[:LONGEST_NAME]).lstrip(". -") or "preset"
    place, height = _digits(pluck.position, 2), _digits(pluck.amplitude_mm, 1)
    return f"{preset}_x{place}_a{height}_{rate_hz}_{source}.wav"


def _digits(value: float, least: int) -> str:
    """Write a value with at least so many decimals; up to six where its exact value needs them."""
    return next((text for places in range(least, 6) if float(text := f"{value:.{places}f}") == value), f"{value:.6f}")


def _tags(title: str, recipe: SoundRecipe) -> dict[str, str]:
    tags = {"title": title, "software": f"{PROGRAM} {program_version()}", "comment": recipe.model_dump_json()}
    return {name: text for name, text in tags.items() if text}


@contextmanager
def _open_whole(path: Path) -> Iterator[BinaryIO]:
    with _explain_errors(path), whole_file(path) as file:
        yield file


@contextmanager
def _explain_errors(path: Path) -> Iterator[None]:
    """Raise errors of the context as a WriteError that names file and remedy."""
    try:
        yield
    except OSError as error:
        raise WriteError(explain(path, error)) from error
    except ValueError as error:
        raise WriteError(f"{path}: {error}") from error
    except MemoryError as error:
        raise WriteError(f"{path}: the sound does not fit in memory; choose a shorter duration") from error
