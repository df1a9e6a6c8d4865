"""Notes of a compiled player as its memory has them: what a test looks at without hearing it."""

from dataclasses import dataclass

from app.player.compiled import InstrumentPlayer
from engine.kernels import constants as of
from engine.values.string import StringParameters
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
    found = []
    for note in player.compiled.record["notes"].copy():
        if note["state"] != of.RINGS:
            continue
        own, now = (
            StringParameters(*string.tolist()) if string[0] else StringParameters()
            for string in (note["own"], note["string_now"])
        )
        flags = (bool(note[name]) for name in ("held", "kept", "damped", "has_place"))
        numbers = (int(note[name]) for name in ("id", "channel", "key", "place"))
        found.append((int(note["age"]), Seen(*numbers, *flags, float(note["gain"]), own, now)))
    return [note for _, note in sorted(found, key=lambda each: each[0])]


def sounding(player: InstrumentPlayer) -> list[Seen]:
    """Those that have their places."""
    return [note for note in seen(player) if note.has_place]


def taken_up(player: InstrumentPlayer, mixer: Mixer) -> list[Seen]:
    """What rings once the mixer's next quantum has taken up all that is due."""
    player.compiled.catch_up(mixer.address)
    return seen(player)
