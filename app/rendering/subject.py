"""The subject that is plucked: a preset as it is, or a preset of many strings as a given one; in memory."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

from app.rendering.motion import ModelMotion
from engine.pluck import Pluck
from engine.presets import Preset, load_preset
from engine.presets.of_string import of_string
from engine.resonators.base import Array
from engine.resonators.sine_transform import project
from engine.sources import ModelSource, StringSource, TruthSource
from engine.values.ear import Ear
from engine.values.string import StringParameters
from engine.voices import Program, Voice, model_program, truth_program

PICTURE_HZ = 6_000  # of a motion, at most: 24 pictures in a period of a B at 247 Hz
KEPT_MOTIONS = 2  # of a preset, the latest: 19 MB each for 3 s at 16 kHz


@dataclass(frozen=True)
class StringOf:
    """A preset of many strings, played as this one.

    Attributes:
        path: the preset's file.
        rate_hz: None: the preset's own.
        modes: their number; None: all below 20 kHz and half the rate, as many as the grid holds.
    """

    path: Path
    string: StringParameters
    rate_hz: int | None = None
    modes: int | None = None


Subject = Path | StringOf


def load_subject(subject: Subject, rate_hz: int | None = None) -> Preset:
    """Load and check the preset of a subject, with its string.

    Args:
        rate_hz: of a preset of many strings, where the subject gives none; None: the preset's own.

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
    """The string that a subject gives; None: it is a file alone, and the string is the preset's own."""
    return subject.string if isinstance(subject, StringOf) else None


class Loaded:
    """Model and truth of a preset with the programs of their voices, each made when first used; for any thread.

    Sounds and pictures are both made from these voices. Sources and programs have no state: all plucks share them.
    """

    def __init__(self, preset: Preset) -> None:
        self.preset = preset
        self.motion = lru_cache(maxsize=KEPT_MOTIONS)(self._motion)  # of the model, where that steps
        self._lock = threading.Lock()
        self._programs: dict[tuple[bool, int], Program] = {}  # by whether it is the truth's, and rate

    @cached_property
    def model(self) -> ModelSource:
        """Raise ValueError where the model cannot start from a displaced string at rest alone."""
        return ModelSource(self.preset)

    @cached_property
    def truth(self) -> TruthSource:
        return TruthSource(self.preset.info)

    @property
    def steps(self) -> bool:
        """Return True if the model steps through every frame; those of one without a compiled voice are its sound."""
        return not self.model.any_frame or self.program("model", self.preset.info.rate_hz).rendered

    @property
    def stride(self) -> int:
        """Samples between two pictures of a motion; 1 for a model that steps, all of whose frames are kept."""
        return 1 if self.steps else math.ceil(self.preset.info.rate_hz / PICTURE_HZ)

    def source(self, name: str) -> StringSource:
        """The truth, or for any other name the model."""
        return self.truth if name == "truth" else self.model

    def program(self, source: str, rate_hz: int) -> Program:
        """The program of the voices of a source at a rate."""
        key = source == "truth", rate_hz
        if (program := self._programs.get(key)) is None:
            with self._lock:
                if (program := self._programs.get(key)) is None:
                    preset = self.preset
                    program = truth_program(preset.info, rate_hz) if key[0] else model_program(preset, rate_hz)
                    self._programs[key] = program
        return program

    def _motion(self, pluck: Pluck, seconds: float) -> ModelMotion:
        return ModelMotion(self.model, self.initial_m(pluck), seconds)

    def sounds_at(self, rate_hz: int) -> bool:
        """Return True if the programs of both sources are there."""
        return all((truth, rate_hz) in self._programs for truth in (True, False))

    def initial_m(self, pluck: Pluck) -> Array:
        """The string at its release, (grid_points,)."""
        info = self.preset.info
        return project(pluck.displacement(info.grid_points), info.modes)

    def voice(
        self, source: str, pluck: Pluck, ear: Ear, rate_hz: int, seconds: float = 0.0, gain: float = 1.0
    ) -> Voice:
        """The voice of a pluck at a rate; `seconds`: the length of its samples, without a compiled voice."""
        program = self.program(source, rate_hz)
        return Voice(program, self.initial_m(pluck), ear, gain, seconds, self.preset.info.rate_hz)
