"""Which presets a browser lists, and in which order."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Literal

from app.presets.library import PresetEntry
from app.presets.words import initial_word, model_word, rate_word, string_word
from training.heard_words import heard_word

Order = Literal["truest", "name", "error"]


@dataclass(frozen=True)
class PresetFilter:
    """What is searched for; empty or 0 matches anything.

    Attributes:
        words: parts of words, in any order, separated by blanks or commas; all of them must occur.
        string: as `PresetInfo.string_kind`.
        model: as `PresetInfo.model`.
        order: by distance of the sound from the truth, by name, or by validation error; unknown values come last.
    """

    words: str = ""
    string: str = ""
    model: str = ""
    rate_hz: int = 0
    favourites_only: bool = False
    order: Order = "truest"

    def applied(self, entries: Iterable[PresetEntry], favourites: Collection[str]) -> list[PresetEntry]:
        """Studio presets before research ones; in each group favourites first, then by `order` (a stable sort)."""
        found = [entry for entry in entries if self.matches(entry, favourites)]
        return sorted(found, key=lambda entry: (not entry.studio, entry.name not in favourites, *self._rank(entry)))

    def _rank(self, entry: PresetEntry) -> tuple[bool, float]:
        if self.order == "name":
            return False, 0.0
        known = entry.info.rel_mae
        if self.order == "truest":
            known = None if entry.heard is None else entry.heard.distance_db
        return known is None, known or 0.0

    def matches(self, entry: PresetEntry, favourites: Collection[str]) -> bool:
        """Whether `entry` is listed. `favourites`: names of presets."""
        info = entry.info
        if self.favourites_only and entry.name not in favourites:
            return False
        for wanted, found in (
            (self.string, info.string_kind),
            (self.model, info.model),
            (self.rate_hz, info.rate_hz),
        ):
            if wanted and wanted != found:
                return False
        text = searched_text(entry)
        return all(word in text for word in re.split(r"[\s,]+", self.words.casefold()) if word)


def searched_text(entry: PresetEntry) -> str:
    """The text of a preset that is searched for words, in lower case."""
    info = entry.info
    parts = (
        info.title,
        entry.name,
        info.description,
        info.model,
        model_word(info.model),
        string_word(info.tension_modulated),
        initial_word(info.initial),
        rate_word(info.rate_hz),
        f"{info.rate_hz}",
        heard_word(entry.heard),
    )
    return " ".join(parts).casefold()
