"""What the export dialog was last set to."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from app.shared.vocabulary import Bits, Source


class BatchChoices(BaseModel):
    """The batch page's last state; lists as they were typed."""

    model_config = ConfigDict(extra="forbid")

    presets: tuple[str, ...] = ()
    positions: str = ""
    amplitudes: str = ""
    sources: tuple[Source, ...] = ("model",)
    folder: str = ""


class ExportChoices(BaseModel):
    """The export dialog's last state. rate_hz 0: the model's own rate; source "files": both, a file each."""

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
