"""A preset in the render worker's memory, with its sources, which have no state, so that all plucks share them."""

from __future__ import annotations

from functools import cached_property

from engine.presets import Preset
from engine.sources import ModelSource, TruthSource
from engine.voices import Program, model_program, truth_program

SUBSTEP_DIVISOR = (
    4  # the voice of the truth takes a quarter of the default sub-steps: an error of 1e-6, for drawing alone
)


class Loaded:
    """Model and truth, and the programs of their voices at the preset's own rate, each made when first used."""

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
