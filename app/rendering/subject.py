"""The subject that is plucked: a preset as it is, or a preset of many strings as a given one; in memory."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from engine.presets import Preset, load_preset
from engine.presets.of_string import of_string
from engine.sources import ModelSource, TruthSource
from engine.values.string import StringParameters
from engine.voices import Program, model_program, truth_program

# the voice of the truth takes a quarter of the default sub-steps: an error of 1e-6, for drawing alone
SUBSTEP_DIVISOR = 4


@dataclass(frozen=True)
class StringOf:
    """A preset of many strings, played as this one; rate and modes as of `of_string`."""

    path: Path
    string: StringParameters
    rate_hz: int | None = None
    modes: int | None = None


Subject = Path | StringOf


def load_subject(subject: Subject, rate_hz: int | None = None) -> Preset:
    """Load and check the preset, of many strings at a rate where the subject gives none; None: its own.

    Raises:
        PresetError: the file cannot be used, or it is not of many strings, or this string is not possible.
    """
    preset = load_preset(path_of(subject))
    if isinstance(subject, StringOf):
        return of_string(preset, subject.string, subject.rate_hz or rate_hz, subject.modes)
    return preset if preset.info.family is None else of_string(preset, None, rate_hz)


def path_of(subject: Subject) -> Path:
    """The preset's file."""
    return subject.path if isinstance(subject, StringOf) else subject


def string_of(subject: Subject) -> StringParameters | None:
    """The string that is given; None: the preset's own."""
    return subject.string if isinstance(subject, StringOf) else None


class Loaded:
    """Model and truth of a preset, and the programs of their voices at its own rate, each made when first used.

    Sources have no state, so that all plucks share them.
    """

    def __init__(self, preset: Preset) -> None:
        self.preset = preset
        self.programs: dict[tuple[str, int], Program] = {}  # by kind, model or truth, and rate of a device

    @cached_property
    def model(self) -> ModelSource:
        """Raise ValueError where the model cannot start from a displaced string at rest alone."""
        return ModelSource(self.preset)

    @cached_property
    def truth(self) -> TruthSource:
        return TruthSource(self.preset.info)

    @cached_property
    def model_program(self) -> Program:
        return model_program(self.preset, self.preset.info.rate_hz)

    @cached_property
    def truth_program(self) -> Program:
        return truth_program(self.preset.info, self.preset.info.rate_hz, SUBSTEP_DIVISOR)
