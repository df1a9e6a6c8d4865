"""Times in frames; the voices of a player's notes, and whether they are over.

A *source* is one of the models or solvers of an instrument's table, by its number: a note has one voice of each, in
the player's memory, which is known by its address (0: none).
"""

from __future__ import annotations

import math

from engine.kernels import constants as of
from engine.kernels import voice_records as at
from engine.kernels.compiled import kernel
from engine.kernels.memory import clear, voice_at
from engine.kernels.modes import rows
from engine.kernels.records import PLAYER, Note, Player, Table

VOICES_AT = PLAYER.itemsize
voice_bytes = kernel(at.voice_bytes)


@kernel
def frames(player: Player, seconds: float) -> int:
    """The nearest number of frames, 1 at least, in a time."""
    return max(1, round(seconds * player.rate_hz))


@kernel
def quanta(player: Player, seconds: float) -> int:
    """The nearest number of quanta, 1 at least, in a time."""
    return max(1, round(seconds * player.rate_hz / of.QUANTUM))


@kernel
def voice_over(address: int) -> bool:
    """Return True if there is no voice, or one that has ended."""
    return address == 0 or voice_at(address).state in (at.OVER, at.RUNAWAY)


@kernel
def over(note: Note) -> bool:
    """Return True if all voices of a note are over."""
    rings = False
    for address in note.voices:
        rings = rings or not voice_over(address)
    return not rings


@kernel
def sounds(note: Note) -> bool:
    """Return True if a note has its place and rings."""
    return note.state == of.RINGS and note.has_place == 1 and not over(note)


@kernel
def address_of_voice(player: Player, number: int, source: int) -> int:
    """The address of the player's own voice for one of its notes, by its number, and a source."""
    return player.here + VOICES_AT + (number * of.MOST_SOURCES + source) * voice_bytes(player.modes)


@kernel
def set_gain(address: int, gain: float) -> None:
    """Set the gain of a voice that begins."""
    voice = voice_at(address)
    voice.wanted_gain = voice.gain = voice.gain_from = voice.gain_to = gain


@kernel
def blank_voice(player: Player, table: Table, address: int, source: int, modes: int, used: int) -> at.Voice:
    """Clear the voice at an address and set it up for a source; return it, at rest.

    Args:
        modes: that it has.
        used: rows (modes,) behind its weights that are set to 0, as the weights are.
    """
    voice, rate_hz = voice_at(address), player.rate_hz
    clear(voice)
    voice.kind = table.kinds[source]
    voice.program = table.programs[source]
    voice.modes = modes
    voice.points = table.points
    voice.began_frame = -1
    voice.moving = modes
    voice.fade_frames = round(at.FADE_S * rate_hz)
    voice.ends_at, voice.ends_in = round(at.LONGEST_S * rate_hz), round(at.END_FADE_S * rate_hz)
    voice.silent = at.SILENT_DB * math.log(10.0) / 20
    rows(voice, -at.WEIGHT_ROWS, at.WEIGHT_ROWS + used)[:] = 0.0
    return voice
