"""A note as sound files with their recipes: a string plucked by itself, or a key as its instrument plays it.

The window and the command line both write through this module; each file is written whole or not at all.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import BinaryIO

from app.export.choices import Chosen, ExportChoices
from app.export.recipe import SoundRecipe
from app.export.recording import SoundSamples
from app.export.sound import VOICES, Mixed, check_sources, render_voices
from app.export.wav import WavSettings, WrittenSound, form_of, write_wav
from app.rendering.note_sound import NoteSound, Struck
from app.shared.key_names import note_name
from app.shared.version import PROGRAM, program_version
from app.shared.vocabulary import PlayedSource, Source
from app.shared.worker import Progress
from engine.plain_text import duration
from engine.pluck import Pluck
from engine.presets import Preset
from engine.whole_file import WriteError, explain, result_file

LONGEST_PRESET = 150  # characters of a preset's name in a file's name
LONGEST_NAME = 80  # characters of an instrument's name
LEAST_MM = 0.05  # softer plucks count as this soft
DECAY_FADE_S = 0.05  # the fade-out where a sound ends by its decay


@dataclass(frozen=True)
class WavReport(WrittenSound):
    """The report of a sound file that was written.

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
        ValueError: see `check_sources` and `form_of`.
        WriteError: a file cannot be written; none is left.
        PresetError: the preset's file cannot be read any more.
        Cancelled: `progress` raised it; no file is left.
        Runaway: the model's output grew without bound or is not finite.
    """
    if settings.decay_db is not None:  # it ends by its decay, behind a longer fade-out
        settings = replace(settings, fade_out_s=max(settings.fade_out_s, DECAY_FADE_S))
    info = preset.info
    rate_hz = settings.rate_hz or info.rate_hz
    check_sources(sound, paths, info.rate_hz)
    forms = {source: form_of(path, settings.bits, rate_hz) for source, path in paths.items()}
    with ExitStack() as files:
        recipes = {source: SoundRecipe.of(sound, preset, source, settings) for source in paths}
        # opened first, so that a folder that cannot be written to fails before the work
        opened = {source: files.enter_context(_open_whole(path)) for source, path in paths.items()}
        try:
            voices = render_voices(sound, preset, paths, settings, progress)
        except OSError as error:  # the recordings lie in temporary files
            raise WriteError(explain(Path(tempfile.gettempdir()), error)) from error
        # of each file the gain follows from its own recipe, whatever else is written beside it
        beside: list[SoundSamples] = [Mixed(voices, voice) for voice in voices.sounds] if settings.normalise else []
        reports = []
        for source, file in opened.items():
            path, samples = paths[source], Mixed(voices, source, settings.difference_gain_db)
            with _explain_errors(path):
                tags = _tags(info.title, recipes[source])
                written = write_wav(file, samples, rate_hz, settings, tags, beside, forms[source])
            past_s = 0.0 if source == "truth" else max(0.0, written.seconds - info.horizon_s)
            reports.append(WavReport(**asdict(written), path=path, past_training_s=past_s, decayed=voices.ended))
    return reports


def default_file_name(preset: str, pluck: Pluck, rate_hz: int, source: Source, ending: str) -> str:
    """The name `{preset}_x{position}_a{amplitude in mm}_{rate}_{source}{ending}`; never a path for any `preset`."""
    preset = re.sub(r"[^\w .+-]", "_", preset[:LONGEST_PRESET]).lstrip(". -") or "preset"
    place, height = _digits(pluck.position, 2), _digits(pluck.amplitude_mm, 1)
    return f"{preset}_x{place}_a{height}_{rate_hz}_{source}{ending}"


def _digits(value: float, least: int) -> str:
    """Write a value with at least so many decimals; up to six where its exact value needs them."""
    return next((text for places in range(least, 6) if float(text := f"{value:.{places}f}") == value), f"{value:.6f}")


def _tags(title: str, recipe: SoundRecipe) -> dict[str, str]:
    """The tags of a file by soundfile's names, with the recipe as JSON; an empty one is left out."""
    tags = {"title": title, "software": f"{PROGRAM} {program_version()}", "comment": recipe.model_dump_json()}
    return {name: text for name, text in tags.items() if text}


@contextmanager
def _open_whole(path: Path) -> Iterator[BinaryIO]:
    with _explain_errors(path), result_file(path) as file:
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


def musical_name(title: str, first_hz: float, softest_mm: float, hardest_mm: float, amplitude_mm: float) -> str:
    """A name such as "Steel acoustic E3 soft", safe as a file's name.

    Args:
        title: of the instrument; words after a comma or a dash are left out.
        first_hz: frequency of the first partial, which gives the note.
        softest_mm, hardest_mm: the range of plucks, of which soft and hard are the outer thirds of its logarithm.
        amplitude_mm: of the pluck that is named.
    """
    key = round(69 + 12 * math.log2(first_hz / 440))
    note = note_name(key) if 0 <= key <= 127 else f"{first_hz:.0f} Hz"
    softest_mm, amplitude_mm = max(softest_mm, LEAST_MM), max(amplitude_mm, LEAST_MM)
    share = math.log(amplitude_mm / softest_mm) / math.log(max(hardest_mm / softest_mm, 1.001))
    return _file_stem(title, note, share)


def struck_name(struck: Struck) -> str:
    """A name as `musical_name`, of a key; soft and hard are the outer thirds of velocities."""
    return _file_stem(struck.instrument.name, note_name(struck.event.key), struck.event.velocity / 127)


def _file_stem(title: str, note: str, share: float) -> str:
    """The name of a file without its ending: short title, note and loudness.

    `share`: of the way from the softest pluck, 0, to the hardest, 1.
    """
    short = re.split(r"[,—]| - ", title)[0]
    plain = " ".join(re.sub(r"[^\w .+-]", " ", short[:LONGEST_NAME]).split()).lstrip(". -") or "Note"
    note = note.replace("♯", "#")
    loudness = "soft" if share < 1 / 3 else "hard" if share > 2 / 3 else "medium"
    return " ".join((plain, *([] if note in plain.split() else [note]), loudness))


@dataclass(frozen=True)
class HeardNote:
    """The sound of a note, and what of it is heard.

    Attributes:
        source: "model", "truth" or "difference".
        another: whether the model of another preset than the chosen one is heard.
        words: for people.
        name: for its files, see `musical_name`.
        preset_rate_hz: the rate of its model.
    """

    sound: NoteSound
    source: PlayedSource
    another: bool
    difference_gain_db: float
    words: str
    name: str
    preset_rate_hz: int

    def chosen(self, last: Chosen) -> Chosen:
        """The sources to save: the audible one, or both where both were saved last and one of them is audible."""
        both = last == "files" and self.source != "difference" and not self.another
        return "files" if both else self.source

    def file_name(self, source: Chosen, ending: str) -> str:
        """The name of its file, with the source where that is neither the model nor both."""
        kind = "" if source in ("model", "files") else f" {source}"
        return f"{self.name}{kind}{ending}"

    def export(self, choices: ExportChoices, folder: Path) -> NoteExport:
        """The export of the sound with these choices; the difference has the gain with which it is heard."""
        if choices.source == self.source == "difference":
            choices = choices.model_copy(update={"difference_gain_db": self.difference_gain_db})
        path = folder / self.file_name(choices.source, choices.ending)
        return NoteExport(self.sound, paths_of(path, choices.source), choices)


def paths_of(path: Path, source: Chosen) -> dict[Source, Path]:
    """The files to write, by source; of both the names have the source."""
    if source != "files":
        return {source: path}
    stem = path.stem.removesuffix(" model").removesuffix(" truth")
    return {name: path.with_name(f"{stem} {name}{path.suffix}") for name in VOICES}


@dataclass(frozen=True)
class NoteExport:
    """The export of a note, rendered once, with a file for each source. See `ExportJob`.

    Attributes:
        paths: the files to write, by source.
    """

    sound: NoteSound
    paths: Mapping[Source, Path]
    choices: ExportChoices
    cancelled = "no file was written."

    @property
    def file(self) -> Path:
        return next(iter(self.paths.values()))

    def run(self, progress: Progress) -> str:
        """Render the note and write its files; see `ExportJob`."""
        choices, settings = self.choices, self.choices.wav
        sound = self.sound.alone if choices.alone else self.sound
        sound = replace(sound, seconds=choices.longest_s if choices.until_decayed else choices.seconds)
        preset = sound.load(settings.rate_hz)
        return "\n".join(_words(export_sounds(sound, preset, self.paths, settings, progress), preset))


def _words(reports: list[WavReport], preset: Preset) -> list[str]:
    """The results in words; a model of many strings has no error that grows past training."""
    lines = []
    for report in reports:
        level = f"peak {report.peak_db:.1f} dBFS, {report.clipped} clipped"
        lines.append(f"Saved {report.path} ({duration(report.seconds)}, {level}).")
    if (past_s := max(report.past_training_s for report in reports)) and preset.info.family is None:
        trained_s = max(report.seconds for report in reports) - past_s
        lines.append(f"The model was trained on the first {duration(trained_s)}.")
    if not reports[0].decayed:
        lines.append("Not decayed at the maximum length: faded out there.")
    if any(report.clipped for report in reports):
        lines.append("Clipped: lower the amplitude, normalise, or choose floating point.")
    return lines
