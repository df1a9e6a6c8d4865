"""Monitor A/B: which of model, truth, their difference and other presets is heard, and with which gain."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Literal

from pydantic import Field

from app.instruments.fields import parameter
from app.shared.value import Value
from app.shared.vocabulary import DIFFERENCE

Slot = Literal["a", "b"]
SLOT_PATTERN = r"^(model|truth|difference|preset:.+)$"


class Monitor(Value):
    """Two slots to compare.

    Attributes:
        a, b: their sources: "model", "truth", "difference" (model minus truth) or "preset:NAME".
        heard: the slot that is heard.
        difference: whether the difference is heard in place of the slot, until the key for it is pressed again.
        level_match: whether each source is brought to the level of the truth, once its gain is known.
    """

    a: str = Field("model", pattern=SLOT_PATTERN)
    b: str = Field("truth", pattern=SLOT_PATTERN)
    heard: Slot = "a"
    difference: bool = False
    level_match: bool = True
    difference_gain_db: float = parameter("difference_gain_db")

    @property
    def source_heard(self) -> str:
        """The source that is heard."""
        return self.source_of(self.heard)

    def source_of(self, slot: str) -> str:
        """The source with which slot "a" or "b" is heard."""
        if self.difference and slot == self.heard:
            return DIFFERENCE
        return self.a if slot == "a" else self.b

    @property
    def voices(self) -> tuple[str, ...]:
        """The sources that need a voice, the one that is heard first."""
        sources = (self.source_heard, self.a, self.b)
        parts = [part for source in sources for part in (("model", "truth") if source == DIFFERENCE else (source,))]
        return tuple(dict.fromkeys(parts))

    def gain(self, source: str, sources: Collection[str], match: Mapping[str, float] | None) -> float:
        """The factor of a source's voice; 0: it is not heard.

        Args:
            sources: those that the note has voices of. Where the source to be heard, or a part of the difference, is
                missing, the slot's own is heard; where that is missing too, the model.
            match: by source, the factor that brings it to the level of the truth; None: not known yet.
        """
        if self.source_heard == DIFFERENCE and {"model", "truth"} <= set(sources):
            gain = float(10 ** (self.difference_gain_db / 20))
            return {"model": gain, "truth": -gain}.get(source, 0.0)
        own = self.a if self.heard == "a" else self.b
        if source != next((each for each in (self.source_heard, own) if each in sources), "model"):
            return 0.0
        return match.get(source, 1.0) if self.level_match and match else 1.0

    def gain_db(self, slot: str, match: Mapping[str, float] | None) -> float | None:
        """The gain of the source of slot "a" or "b" as heard, in dB; None while it is not known."""
        source = self.source_of(slot)
        if source == DIFFERENCE:
            return self.difference_gain_db
        if not self.level_match:
            return 0.0
        return None if match is None else 20 * math.log10(match.get(source, 1.0))
