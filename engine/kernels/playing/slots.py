"""Times in frames; the voices of a player's notes, and whether they are over."""

from __future__ import annotations

from numba import njit

from engine.kernels import constants as of
from engine.kernels import layout as at
from engine.kernels import records
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import reals, wholes
from engine.kernels.records import PLAYER, Note, Player

VOICES_AT = PLAYER.itemsize
voice_bytes = njit(**COMPILED)(records.voice_bytes)


@njit(**COMPILED)
def frames(player: Player, seconds: float) -> int:
    return max(1, round(seconds * player.rate_hz))


@njit(**COMPILED)
def quanta(player: Player, seconds: float) -> int:
    return max(1, round(seconds * player.rate_hz / at.QUANTUM))


@njit(**COMPILED)
def voice_over(address: int) -> bool:
    state = wholes(address)[at.STATE]
    return state == at.OVER or state == at.RUNAWAY


@njit(**COMPILED)
def over(note: Note) -> bool:
    """Return True if all voices of a note are over."""
    for source in range(of.MOST_SOURCES):
        address = note.voices[source]
        if address != 0 and not voice_over(address):
            return False
    return True


@njit(**COMPILED)
def sounds(note: Note) -> bool:
    """Return True if a note has its place and rings."""
    return note.state == of.RINGS and note.has_place == 1 and not over(note)


@njit(**COMPILED)
def address_of_voice(player: Player, number: int, source: int) -> int:
    """The player's own voice for one of its notes and a source."""
    return player.here + VOICES_AT + (number * of.MOST_SOURCES + source) * voice_bytes(player.modes)


@njit(**COMPILED)
def set_gain(address: int, gain: float) -> None:
    """Sets the gain of a voice that begins."""
    voice = reals(address)
    voice[at.WANTED_GAIN] = voice[at.GAIN] = voice[at.GAIN_FROM] = voice[at.GAIN_TO] = gain
