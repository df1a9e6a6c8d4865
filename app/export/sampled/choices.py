"""The last settings of the dialog that exports an instrument."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict, Field

from app.export.sampled.plan import MOST_LAYERS, SECONDS_RANGE, WIDEST_STEP, SampleBits, SampledSource
from app.instruments.instrument import Key
from app.shared.value import Value

SampledKind = Literal["flac", "wav", "sf2"]  # the former two are an SFZ's samples


class SampledChoices(Value):
    """The last settings. `keys`: the lowest and the highest; None: all of the instrument's range."""

    model_config = ConfigDict(extra="ignore")  # earlier versions have more fields

    form: SampledKind = "flac"
    bits: SampleBits = "24"
    rate_hz: int = 48_000
    keys: tuple[Key, Key] | None = None
    every: int = Field(1, ge=1, le=WIDEST_STEP)
    layers: int = Field(4, ge=1, le=MOST_LAYERS)
    seconds: float = Field(8.0, ge=SECONDS_RANGE[0], le=SECONDS_RANGE[1])
    source: SampledSource = "model"
    dry: bool = False
