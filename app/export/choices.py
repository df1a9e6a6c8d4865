"""The last settings of the export dialog."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from app.shared.vocabulary import Bits, Source


class BatchChoices(BaseModel):
    """The last settings of the batch page; lists as they were typed. One of a single value is not used again."""

    model_config = ConfigDict(extra="forbid")

    presets: tuple[str, ...] = ()
    positions: str = ""
    amplitudes: str = ""
    sources: tuple[Source, ...] = ("model",)
    folder: str = ""


class ExportChoices(BaseModel):
    """The last settings. `rate_hz`: 0 for the model's own; `source`: "files" for model and truth in a file each."""

    model_config = ConfigDict(extra="forbid")

    folder: str = ""
    source: Literal["model", "truth", "difference", "both", "files"] = "model"
    rate_hz: int = 48_000
    bits: Bits = "24"
    until_decayed: bool = True
    decay_db: float = 60.0
    longest_s: float = 30.0
    seconds: float = 4.0
    normalise: bool = False
    difference_gain_db: float = 20.0
    batch: BatchChoices = BatchChoices()
