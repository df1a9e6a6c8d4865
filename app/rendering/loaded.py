"""A preset in the render worker's memory, with the sources that it gives: they keep nothing, so plucks share them."""

from __future__ import annotations

from functools import cached_property

from engine.presets import Preset
from engine.sources import ModelSource, TruthSource
from engine.voices import Program, model_program, truth_program

COARSER = 4  # sub-steps of the truth that is drawn against its default's: 1e-6 off


class Loaded:
    """Sources are made when they are first wanted, and the programs of their voices at the preset's own rate."""

    def __init__(self, preset: Preset) -> None:
        self.preset = preset

    @cached_property
    def model(self) -> ModelSource:
        """Raises ValueError where the model cannot start from rest."""
        return ModelSource(self.preset)

    @cached_property
    def truth(self) -> TruthSource:
        return TruthSource(self.preset.info)

    @cached_property
    def model_program(self) -> Program:
        return model_program(self.preset.model, self.preset.info, self.preset.info.rate_hz)

    @cached_property
    def truth_program(self) -> Program:
        return truth_program(self.preset.info, self.preset.info.rate_hz, COARSER)
