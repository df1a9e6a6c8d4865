"""The last settings of the export dialog, of notes and performances."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.export.wav import WavSettings
from app.shared.vocabulary import Bits

Chosen = Literal["model", "truth", "difference", "files"]


class ExportChoices(BaseModel):
    """The last settings.

    Attributes:
        source: "files" for model and truth in a file each.
        rate_hz: 0 for the model's own.
        alone: the string without its instrument; not remembered, so that each dialog offers the audible sound first.
    """

    model_config = ConfigDict(extra="ignore")  # versions with a page for batches have more fields

    folder: str = ""
    source: Chosen = "model"
    rate_hz: int = 48_000
    bits: Bits = "24"
    until_decayed: bool = True
    decay_db: float = 60.0
    longest_s: float = 30.0
    seconds: float = 4.0
    normalise: bool = True
    difference_gain_db: float = 20.0
    level_match: bool = False
    alone: bool = Field(False, exclude=True)

    @property
    def wav(self) -> WavSettings:
        return WavSettings(
            bits=self.bits,
            rate_hz=self.rate_hz or None,
            normalise=self.normalise,
            decay_db=self.decay_db if self.until_decayed else None,
            difference_gain_db=self.difference_gain_db,
        )
