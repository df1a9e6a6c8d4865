"""A note as WAV files: a string that is plucked by itself, or a key as its instrument plays it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from app.export.choices import Chosen, ExportChoices
from app.export.files import WavReport, export_sounds
from app.rendering.note_sound import NoteSound, Struck
from app.shared.key_names import note_name
from app.shared.vocabulary import PlayedSource, Source
from app.shared.worker import Progress
from engine.plain_text import duration
from engine.presets import Preset

LONGEST_NAME = 80  # characters of an instrument's name
LEAST_MM = 0.05  # softer plucks count as this soft


def musical_name(title: str, first_hz: float, softest_mm: float, hardest_mm: float, amplitude_mm: float) -> str:
    """A name such as "Steel acoustic E3 soft", safe as a file's name.

    Args:
        title: of the instrument; words after a comma or a dash are left out.
        first_hz: frequency of the first partial, which gives the note.
        softest_mm, hardest_mm: the range of plucks, of which soft and hard are the outer thirds of its logarithm.
    """
    key = round(69 + 12 * math.log2(first_hz / 440))
    note = note_name(key) if 0 <= key <= 127 else f"{first_hz:.0f} Hz"
    softest_mm, amplitude_mm = max(softest_mm, LEAST_MM), max(amplitude_mm, LEAST_MM)
    share = math.log(amplitude_mm / softest_mm) / math.log(max(hardest_mm / softest_mm, 1.001))
    return _file_stem(title, note, share)


def struck_name(struck: Struck) -> str:
    """A name as `musical_name`, of a key; soft and hard are the outer thirds of velocities."""
    return _file_stem(struck.patch.name, note_name(struck.event.key), struck.event.velocity / 127)


def _file_stem(title: str, note: str, share: float) -> str:
    """The name of a file without its ending: short title, note and loudness."""
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

    def file_name(self, source: Source) -> str:
        """The name of its file, with the source where that is not the model."""
        kind = "" if source == "model" else f" {source}"
        return f"{self.name}{kind}.wav"


@dataclass(frozen=True)
class NoteExport:
    """The export of a note, rendered once, with a file for each source. See `ExportJob`.

    Attributes:
        paths: the files to write, by source.
    """

    sound: NoteSound
    paths: Mapping[Source, Path]
    choices: ExportChoices

    @property
    def folder(self) -> Path:
        return next(iter(self.paths.values())).parent

    def run(self, progress: Progress) -> str:
        choices, settings = self.choices, self.choices.wav
        sound = self.sound.alone if choices.alone else self.sound
        sound = replace(sound, seconds=choices.longest_s if choices.until_decayed else choices.seconds)
        preset = sound.load(settings.rate_hz)
        return "\n".join(_words(export_sounds(sound, preset, self.paths, settings, progress), preset))

    def cancelled(self) -> str:
        return "no file was written."


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
