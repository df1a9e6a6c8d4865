"""A preset in the render worker's memory, with the sources that it gives: they keep nothing, so plucks share them."""

from __future__ import annotations

from functools import cached_property

from engine.presets import Preset
from engine.sources import ModelSource, TruthSource


class Loaded:
    """Sources are made when they are first wanted."""

    def __init__(self, preset: Preset) -> None:
        self.preset = preset

    @cached_property
    def model(self) -> ModelSource:
        """Raises ValueError where the model cannot start from rest."""
        return ModelSource(self.preset)

    @cached_property
    def truth(self) -> TruthSource:
        return TruthSource(self.preset.info)
