"""Amplifier, then body and room together as one impulse response."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.effects.body import Body
from engine.effects.room import room_response
from engine.values.effects import Amp, Room


@dataclass(frozen=True)
class Effects:
    """The strings sound through the amplifier, that through the body, and that in the room.

    What is None, or has a mix or a drive of 0, is not there.

    Attributes:
        level_db: of what the amplifier is given, which does not count as drive.
    """

    body: Body | None = None
    room: Room | None = None
    amp: Amp | None = None
    level_db: float = 0.0

    @property
    def rings(self) -> bool:
        """Return True if there is a body or a room."""
        return any(part is not None and part.mix > 0 for part in (self.body, self.room))

    def impulse(self, rate_hz: int) -> NDArray[np.float64]:
        """The impulse response of body and room, (frames, 1 or 2): the level of pink noise stays, at any mix.

        It is remembered, and not to be written.
        """
        return _impulse(replace(self, amp=None, level_db=0.0), rate_hz)

    def tail_s(self, rate_hz: int) -> float:
        """The longest time for which it sounds on after its input."""
        return (len(self.impulse(rate_hz)) - 1) / rate_hz


@lru_cache(maxsize=4)
def _impulse(effects: Effects, rate_hz: int) -> NDArray[np.float64]:
    """The response (frames, 1 or 2) of `Effects.impulse`: one frame of 1 where there is neither body nor room."""
    body = effects.body if effects.body and effects.body.mix > 0 else None
    room = effects.room if effects.room and effects.room.mix > 0 else None
    impulse = np.ones((1, 1))
    if body or room:
        from engine.effects.responses import weights_of  # brings the compiler

        parts, powers = _parts(body and replace(body, mix=1.0), room and replace(room, mix=1.0), rate_hz)
        mono = room is None and body is not None and body.channels == 1
        impulse = np.zeros((max(map(len, parts)), 1 if mono else 2))
        weights = weights_of(powers, body.mix if body else 0.0, room.mix if room else 0.0)
        impulse[0] = weights[0]
        for weight, part in zip(weights[1:], parts, strict=True):
            impulse[: len(part)] += weight * part[:, : impulse.shape[1]]
    impulse.setflags(write=False)
    return impulse


@lru_cache(maxsize=4)
def _parts(
    body: Body | None, room: Room | None, rate_hz: int
) -> tuple[tuple[NDArray[np.float64], ...], NDArray[np.float64]]:
    """The responses (frames, 2) of body, room, and both in series, and the powers (4, 4, 4) of `powers_of`.

    What is not there has no frames.
    """
    from engine.effects.responses import in_series, powers_of

    nothing = np.zeros((0, 2))
    one = body.response(rate_hz) if body else nothing
    other = room_response(room.t60_s, rate_hz) if room else nothing
    both = in_series(one, other) if body and room else nothing
    return (one, other, both), powers_of(one, other, rate_hz)
