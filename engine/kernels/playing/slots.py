"""Where notes and channels lie in a player's memory, and what their slots say.

Memory is passed twice, as real numbers and as whole ones (`players`, `tables`, `mixers`), and notes, channels and
events by their first slot: views of slices would take the compiler five times as long.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import wholes


@njit(**COMPILED)
def note(number: int) -> int:
    """First slot of a note."""
    return of.PLAYER_NOTES + number * of.NOTE_SLOTS


@njit(**COMPILED)
def channel(number: int) -> int:
    """First slot of a channel."""
    return of.PLAYER_CHANNELS + number * of.CHANNEL_SLOTS


@njit(**COMPILED)
def moment(player: np.ndarray, number: int) -> np.ndarray:
    """Room for a string, for a moment."""
    return player[of.PLAYER_STRINGS + number * of.STRING : of.PLAYER_STRINGS + (number + 1) * of.STRING]


@njit(**COMPILED)
def frames(player: np.ndarray, seconds: float) -> int:
    return max(1, round(seconds * player[of.PLAYER_RATE]))


@njit(**COMPILED)
def quanta(player: np.ndarray, seconds: float) -> int:
    return max(1, round(seconds * player[of.PLAYER_RATE] / at.QUANTUM))


@njit(**COMPILED)
def voice_over(address: int) -> bool:
    state = wholes(address)[at.STATE]
    return state == at.OVER or state == at.RUNAWAY


@njit(**COMPILED)
def over(players: np.ndarray, note: int) -> bool:
    """Whether all voices of a note are."""
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address != 0 and not voice_over(address):
            return False
    return True


@njit(**COMPILED)
def sounds(players: np.ndarray, note: int) -> bool:
    """Whether a note has its place and rings."""
    return (
        players[note + of.NOTE_STATE] == of.RINGS
        and players[note + of.NOTE_HAS_PLACE] == 1
        and not over(players, note)
    )
