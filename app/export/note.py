"""A note as WAV files: a string that is plucked by itself, or a key as its instrument plays it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.export.choices import Chosen, ExportChoices
from app.export.files import WavReport, export_sounds
from app.export.sound import VOICES, SoundRequest, render_voices
from app.export.struck import Struck
from app.shared.key_names import note_name
from app.shared.vocabulary import PlayedSource, Source
from app.shared.worker import Progress
from engine.plain_text import duration
from engine.pluck import Pluck
from engine.presets import load_preset, of_string
from engine.values.ear import Pickup
from engine.values.string import StringParameters

LONGEST_NAME = 80  # characters of an instrument's name
LEAST_MM = 0.05  # softer plucks count as this soft


@dataclass(frozen=True)
class ExportedPluck:
    """A pluck and where it is heard, or a key of an instrument.

    Attributes:
        preset: its file; preset_rate_hz: the rate of its model.
        string: the one that a preset of many plays; None: the preset's own.
        struck: a key of an instrument; pluck and listening points are then those of its string alone. None: no
            instrument has any part in the sound.
        name: for its file, see `musical_name`; empty: that of the preset.
    """

    preset: Path
    preset_rate_hz: int
    pluck: Pluck
    listen: float
    listen_right: float | None = None
    pickup: Pickup = "displacement"
    string: StringParameters | None = None
    struck: Struck | None = None
    name: str = ""

    @property
    def can_be_alone(self) -> bool:
        """Return True if an instrument plays it, and its string can be heard without that instrument."""
        return self.struck is not None and not self.struck.of_drum

    def request(self, source: Source, seconds: float, rate_hz: int, alone: bool = False, **more: Any) -> SoundRequest:
        """The request to render it.

        Args:
            rate_hz: of the sound; 0: the preset's own.
            alone: the string without its instrument.
            more: further fields of `SoundRequest`.

        Raises:
            PresetError: the preset cannot be used.
        """
        preset, struck = load_preset(self.preset), None if alone and self.can_be_alone else self.struck
        if preset.info.family is not None and struck is None:  # it plays any string at any rate
            preset = of_string(preset, self.string, rate_hz or None)
        return SoundRequest(
            preset, self.pluck, self.listen, seconds, source, self.listen_right, self.pickup, struck=struck, **more
        )

    def compared(self, seconds: float, rate_hz: int) -> Mapping[str, NDArray[np.float32]]:
        """Model and truth by source, (frames, channels), without amplifier, body and room.

        Raises:
            PresetError, Runaway: the preset cannot be used, or its output grew without bound.
        """
        voices = render_voices(self.request("difference", seconds, rate_hz), VOICES, rate_hz)
        return {source: sound[:].astype(np.float32) for source, sound in voices.sounds.items()}

    def file_name(self, source: Source) -> str:
        """The name of its file, with the source where that is not the model."""
        kind = "" if source == "model" else f" {source}"
        return f"{self.name or self.preset.stem}{kind}.wav"


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
    """A note, and what of it is heard.

    Attributes:
        source: "model", "truth" or "difference".
        another: whether the model of another preset than the chosen one is heard.
        words: for people.
    """

    note: ExportedPluck
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
    """The export of a note, rendered once, with a file for each source. See `ExportJob`.

    Attributes:
        paths: the files to write, by source.
    """

    note: ExportedPluck
    paths: Mapping[Source, Path]
    choices: ExportChoices

    @property
    def folder(self) -> Path:
        return next(iter(self.paths.values())).parent

    def run(self, progress: Progress) -> str:
        choices, decays = self.choices, self.choices.until_decayed
        request = self.note.request(
            next(iter(self.paths)),
            choices.longest_s if decays else choices.seconds,
            choices.rate_hz,
            choices.alone,
            difference_gain_db=choices.difference_gain_db if "difference" in self.paths else 0.0,
            decay_db=choices.decay_db if decays else None,
        )
        of_family = self.note.string is not None or self.note.struck is not None
        return "\n".join(_words(export_sounds(request, self.paths, choices.wav, progress=progress), of_family))

    def cancelled(self) -> str:
        return "no file was written."


def _words(reports: list[WavReport], of_family: bool) -> list[str]:
    """The warnings of reports; `of_family`: the model is of many strings, whose error does not grow past training."""
    lines = []
    for report in reports:
        level = f"peak {report.peak_db:.1f} dBFS, {report.clipped} clipped"
        lines.append(f"Saved {report.path} ({duration(report.seconds)}, {level}).")
    if (past_s := max(report.past_training_s for report in reports)) and not of_family:
        trained_s = max(report.seconds for report in reports) - past_s
        lines.append(f"The model was trained on the first {duration(trained_s)}.")
    if not reports[0].decayed:
        lines.append("Not decayed at the maximum length: faded out there.")
    if any(report.clipped for report in reports):
        lines.append("Clipped: lower the amplitude, normalise, or choose floating point.")
    return lines
