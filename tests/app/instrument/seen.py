"""Notes of a compiled player as its memory has them: what a test looks at without hearing it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.instrument.compiled import InstrumentPlayer
from engine.kernels import playing_layout as of
from engine.resonators.string import StringParameters
from engine.voices import Mixer


@dataclass(frozen=True)
class Seen:
    """A note that rings.

    Attributes:
        own: its string as its key had it.
        now: with bends, slides, dampers and knobs.
    """

    id: int
    channel: int
    key: int
    place: int
    held: bool
    kept: bool
    damped: bool
    has_place: bool
    gain: float
    own: StringParameters
    now: StringParameters


def seen(player: InstrumentPlayer) -> list[Seen]:
    """The notes that ring, the oldest first."""
    memory = player.compiled.memory
    size = of.MOST_NOTES * of.NOTE_SLOTS
    reals = memory[of.PLAYER_NOTES : of.PLAYER_NOTES + size].reshape(of.MOST_NOTES, of.NOTE_SLOTS).copy()
    found = []
    for real in reals:
        whole = real.view(np.int64)
        if whole[of.NOTE_STATE] != of.RINGS:
            continue
        own, now = (
            StringParameters(*real[first : first + of.STRING].tolist()) if real[first] else StringParameters()
            for first in (of.NOTE_OWN, of.NOTE_STRING_NOW)
        )
        flags = (bool(whole[slot]) for slot in (of.NOTE_HELD, of.NOTE_KEPT, of.NOTE_DAMPED, of.NOTE_HAS_PLACE))
        numbers = (int(whole[slot]) for slot in (of.NOTE_ID, of.NOTE_CHANNEL, of.NOTE_KEY, of.NOTE_PLACE))
        note = Seen(*numbers, *flags, float(real[of.NOTE_GAIN]), own, now)
        found.append((int(whole[of.NOTE_AGE]), note))
    return [note for _, note in sorted(found, key=lambda each: each[0])]


def sounding(player: InstrumentPlayer) -> list[Seen]:
    """Those that have their places."""
    return [note for note in seen(player) if note.has_place]


def taken_up(player: InstrumentPlayer, mixer: Mixer) -> list[Seen]:
    """What rings once the mixer's next quantum has taken up all that is due."""
    player.compiled.catch_up(mixer)
    return seen(player)
