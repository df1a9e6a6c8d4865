"""Drums of an instrument: membranes and plates, each struck by its mallet at its place."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from app.instruments.fields import Drum, Key, Name, ranged
from app.shared.value import Value
from engine.values.drum import Mallet

MOST_DRUMS = 32
HIGHEST_HZ = 6_000.0  # of a drum's modes, where the instrument does not say
Side = Annotated[float, ranged(-1, 1)]


class PlayedDrum(Value):
    """A drum and how it is struck.

    Attributes:
        note: of the MIDI key that plays it as it is.
        place: where it is struck, from the centre in half-lengths.
        softest_m_s, hardest_m_s: speeds of velocity 1 and 127; between them a step of velocity is a ratio.
    """

    note: Key
    name: Name
    drum: Drum
    mallet: Mallet = Mallet()
    place: tuple[Side, Side] = (0.3, 0.1)
    softest_m_s: Annotated[float, ranged(0.001, 30)] = 0.2
    hardest_m_s: Annotated[float, ranged(0.001, 30)] = 8.0

    @model_validator(mode="after")
    def _on_the_drum(self) -> Self:
        """Raise ValueError: the place is at the rim or beyond, or the softest blow is the harder one."""
        x, y = self.place
        if (x * x + y * y if self.drum.shape == "circle" else max(x * x, y * y)) >= 1:
            raise ValueError("place is not on the drum; choose one nearer the centre")
        if self.softest_m_s > self.hardest_m_s:
            raise ValueError("softest_m_s must not be above hardest_m_s; lower it")
        return self


class Drums(Value):
    """Drums by rising note.

    Attributes:
        keys: "pads": a drum for its own key each. "pitch": a key plays the drum at or below it (below all, the
            lowest), tuned to the key. A membrane is tuned by its tension, a plate by its size.
        highest_hz: of the modes that sound.
    """

    kind: Literal["drums"] = "drums"
    drums: Annotated[tuple[PlayedDrum, ...], Field(min_length=1, max_length=MOST_DRUMS)]
    keys: Literal["pads", "pitch"] = "pads"
    highest_hz: Annotated[float, ranged(500, 20_000)] = HIGHEST_HZ

    @model_validator(mode="after")
    def _rise(self) -> Self:
        """Raise ValueError: notes do not rise, or one is there twice."""
        notes = [drum.note for drum in self.drums]
        if notes != sorted(set(notes)):
            raise ValueError("drums must be listed by rising note, each note once; put them in order")
        return self

    def of_key(self, key: int) -> PlayedDrum | None:
        """The drum that a key plays, whatever the instrument's range; None: a key without a pad."""
        if self.keys == "pads":
            return next((drum for drum in self.drums if drum.note == key), None)
        return next((drum for drum in reversed(self.drums) if drum.note <= key), self.drums[0])
