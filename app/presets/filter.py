"""Which presets a browser lists: by words of its search, by string, model and rate, by favour."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from app.presets.library import PresetEntry
from app.presets.words import initial_word, model_word, rate_word, string_word


@dataclass(frozen=True)
class PresetFilter:
    """What is looked for; empty or None is anything.

    Attributes:
        words: parts of words, in any order, between blanks or commas; all of them must be found.
        string: as `PresetInfo.string_kind`.
    """

    words: str = ""
    string: str = ""
    model: str = ""
    rate_hz: int = 0
    favourites_only: bool = False

    def applied(self, entries: Iterable[PresetEntry], favourites: Collection[str]) -> list[PresetEntry]:
        """Favourites first, else in their order."""
        found = [entry for entry in entries if self.matches(entry, favourites)]
        return sorted(found, key=lambda entry: entry.name not in favourites)

    def matches(self, entry: PresetEntry, favourites: Collection[str]) -> bool:
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
    """All that a search can find of a preset, in lower case."""
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
    )
    return " ".join(parts).casefold()
