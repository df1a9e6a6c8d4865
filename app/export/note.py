"""A note as WAV files: a pluck with body, room and level, or its string alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from app.export.choices import Chosen, ExportChoices
from app.export.files import SoundRequest, WavReport, default_file_name, export_sounds
from app.export.sound import Through
from app.shared.vocabulary import Pickup, PlayedSource, Source
from app.shared.worker import Progress
from engine.pluck import Pluck
from engine.presets import load_preset, of_string
from engine.resonators.string import StringParameters


@dataclass(frozen=True)
class Note:
    """A pluck, where and through what it is heard.

    Attributes:
        preset: its file; preset_rate_hz: the rate of its model.
        string: the one that a preset of many plays; None: the preset's own.
        through: the instrument's level, body and room; None: there is no instrument.
    """

    preset: Path
    preset_rate_hz: int
    pluck: Pluck
    listen: float
    listen_right: float | None = None
    pickup: Pickup = "displacement"
    string: StringParameters | None = None
    through: Through | None = None

    def file_name(self, rate_hz: int, source: Source) -> str:
        """A name with preset, string, pluck, rate (0: the model's) and source."""
        first_hz = "" if self.string is None else f"_{self.string.undamped_frequency(1) / math.tau:.1f}Hz"
        return default_file_name(self.preset.stem + first_hz, self.pluck, rate_hz or self.preset_rate_hz, source)


@dataclass(frozen=True)
class HeardNote:
    """A note, and what of it is heard.

    Attributes:
        source: "model", "truth" or "difference".
        another: whether the model of another preset than the chosen one is heard.
        words: for people.
    """

    note: Note
    source: PlayedSource
    another: bool
    difference_gain_db: float
    words: str

    def chosen(self, last: Chosen) -> Chosen:
        """The sources to save: the audible one, or both where both were saved last and one of them is audible."""
        both = last == "files" and self.source != "difference" and not self.another
        return "files" if both else self.source


@dataclass(frozen=True)
class NoteExport:
    """Renders a note once, and writes a file for each source. See `ExportJob`.

    Attributes:
        paths: the files to write, by source.
    """

    note: Note
    paths: Mapping[Source, Path]
    choices: ExportChoices

    @property
    def folder(self) -> Path:
        return next(iter(self.paths.values())).parent

    def run(self, progress: Progress) -> str:
        return "\n".join(_words(self.written(progress)))

    def written(self, progress: Progress) -> list[WavReport]:
        """As `run`, with reports in place of words."""
        note, choices = self.note, self.choices
        preset = load_preset(note.preset)
        if preset.info.family is not None:  # it plays any string at any rate
            preset = of_string(preset, note.string, choices.rate_hz or None)
        request = SoundRequest(
            preset,
            note.pluck,
            note.listen,
            choices.longest_s if choices.until_decayed else choices.seconds,
            next(iter(self.paths)),
            note.listen_right,
            note.pickup,
            choices.difference_gain_db if "difference" in self.paths else 0.0,
            choices.decay_db if choices.until_decayed else None,
            None if choices.alone else note.through,
        )
        return export_sounds(request, self.paths, choices.wav, progress=progress)[0]

    def cancelled(self) -> str:
        return "no file was written."


def _words(reports: list[WavReport]) -> list[str]:
    lines = []
    for report in reports:
        level = f"peak {report.peak_db:.1f} dBFS, {report.clipped} clipped"
        lines.append(f"Saved {report.path} ({report.seconds:.2f} s, {level}).")
    if past_s := max(report.past_training_s for report in reports):
        lines.append(f"The last {past_s:.2f} s lie past the model's training; a marker says where it ends.")
    if not reports[0].decayed:
        lines.append("Not decayed at the maximum length: faded out there.")
    if any(report.clipped for report in reports):
        lines.append("Clipped: lower the amplitude, normalise, or choose floating point.")
    return lines
