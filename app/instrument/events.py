"""What a player does, as values. Keys are MIDI keys, 0 … 127."""

from __future__ import annotations

from dataclasses import dataclass

from app.patches.patch import Patch

SUSTAIN, MOD_WHEEL, SLIDE, SOUND_OFF, RESET, NOTES_OFF = 64, 1, 74, 120, 121, 123  # numbers of MIDI controllers
PEDAL_DOWN = 64  # from this value on


@dataclass(frozen=True)
class NoteOn:
    """A key is struck; velocity 1 … 127 (0 is a release)."""

    key: int
    velocity: int
    channel: int = 0


@dataclass(frozen=True)
class NoteOff:
    """A key is let go."""

    key: int
    channel: int = 0


@dataclass(frozen=True)
class Bend:
    """The pitch wheel moves to -1 … 1, in ranges of the patch."""

    value: float
    channel: int = 0


@dataclass(frozen=True)
class Controller:
    """A controller moves to 0 … 127."""

    number: int
    value: int
    channel: int = 0


@dataclass(frozen=True)
class PatchTurned:
    """A knob was turned, or another patch chosen."""

    patch: Patch


def moves_effects(event: object, patch: Patch) -> bool:
    """Whether it changes the body or the room of what is heard of a patch."""
    if isinstance(event, Controller):
        return event.number in (MOD_WHEEL, RESET) and patch.mod_wheel.startswith(("body.", "room."))
    return isinstance(event, PatchTurned)


Event = NoteOn | NoteOff | Bend | Controller | PatchTurned


@dataclass(frozen=True)
class TimedEvent:
    """An event and its time from the beginning."""

    time_s: float
    event: Event
