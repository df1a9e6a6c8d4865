"""What is plucked, and with which gain each of its sources is heard: values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from app.rendering.subject import Subject
from app.shared.vocabulary import DIFFERENCE
from engine.pluck import Pluck
from engine.voices.ear import Ear


@dataclass(frozen=True)
class Stroke:
    """A pluck of a preset's string.

    Attributes:
        preset: a preset, or a string of a preset of many.
        ear: where and how it is heard.
        seconds: how long a model that is rendered ahead lasts at most; all others ring until they are silent.
        sources: the sources that get a voice: "model", "truth", and keys of `others`.
        others: source -> path of another preset; such a source is "preset:NAME".
        gain: a factor for all its sources, beside that of the mix.
    """

    preset: Subject
    pluck: Pluck
    ear: Ear
    seconds: float
    sources: tuple[str, ...]
    others: Mapping[str, Path] = field(default_factory=dict)
    gain: float = 1.0

    def subject(self, source: str) -> Subject:
        """The preset or string whose sound a source is."""
        return self.others.get(source, self.preset)

    @property
    def matching_key(self) -> tuple[object, ...]:
        """What the levels of its sources depend on."""
        return (self.preset, self.pluck, self.ear, self.sources, tuple(self.others.values()))


@dataclass(frozen=True)
class Mix:
    """The sound of notes.

    Attributes:
        heard: a source, or `DIFFERENCE`.
        matched: whether each source is brought to the level of the truth, once its gain is known.
        difference_gain_db: the gain of the difference.
    """

    heard: str = "model"
    matched: bool = False
    difference_gain_db: float = 0.0

    def of(self, sources: Iterable[str]) -> Mix:
        """This mix, with the model heard where `heard` is none of these sources."""
        return self if self.heard in (DIFFERENCE, *sources) else replace(self, heard="model")

    def gain(self, source: str, match: Mapping[str, float] | None) -> float:
        """The factor of a source's voice; 0: it is not heard.

        `match`: by source, the factor that brings it to the level of the truth; None: not known yet.
        """
        if self.heard == DIFFERENCE:
            gain = float(10 ** (self.difference_gain_db / 20))
            return {"model": gain, "truth": -gain}.get(source, 0.0)
        if source != self.heard:
            return 0.0
        return match.get(source, 1.0) if self.matched and match else 1.0

    def gain_db(self, source: str, match: Mapping[str, float] | None) -> float | None:
        """The gain with which a slot's content is heard, in dB; None while it is not known."""
        if source == DIFFERENCE:
            return self.difference_gain_db
        if not self.matched:
            return 0.0
        return None if match is None else 20 * math.log10(match.get(source, 1.0))
