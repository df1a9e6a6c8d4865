"""The last settings of the export dialog, of notes and performances."""

from __future__ import annotations

from typing import Any, Literal, cast

from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.export.wav import WavSettings
from app.shared.vocabulary import FORMATS, Bits, Format

Chosen = Literal["model", "truth", "difference", "files"]


class ExportChoices(BaseModel):
    """The last settings.

    Attributes:
        source: "files" for model and truth in a file each.
        rate_hz: 0 for the model's own.
        alone: the string without its instrument; not remembered, so that each dialog offers the audible sound first.
    """

    model_config = ConfigDict(extra="ignore")  # earlier versions have more fields

    source: Chosen = "model"
    rate_hz: int = 48_000
    format: Format = "wav 24"
    until_decayed: bool = True
    decay_db: float = 60.0
    longest_s: float = 30.0
    seconds: float = 4.0
    normalise: bool = True
    difference_gain_db: float = 20.0
    level_match: bool = False
    alone: bool = Field(False, exclude=True)

    @model_validator(mode="before")
    @classmethod
    def _take_old(cls, data: Any) -> Any:
        """Take the `bits` alone that versions without FLAC had."""
        if isinstance(data, dict) and (old := f"wav {data.get('bits')}") in FORMATS:
            return {"format": old, **data}
        return data

    @property
    def ending(self) -> str:
        """The ending of a file's name."""
        return f".{self.format.split()[0]}"

    @property
    def wav(self) -> WavSettings:
        """The settings of the files that these choices ask for."""
        return WavSettings(
            bits=cast(Bits, self.format.split()[1]),
            rate_hz=self.rate_hz or None,
            normalise=self.normalise,
            decay_db=self.decay_db if self.until_decayed else None,
            difference_gain_db=self.difference_gain_db,
        )
