"""Amplifier, then body and room together as one impulse response, for the mixer and for arrays alike."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.effects.amp import Amp, amplified
from engine.effects.body import Body
from engine.effects.impulse import as_loud, convolved
from engine.effects.room import Room
from engine.kernels.mixer_records import LARGEST, SMALLEST


@dataclass(frozen=True)
class Effects:
    """The strings sound through the amplifier, that through the body, and that in the room.

    What is None, or has a mix or a drive of 0, is not there.
    """

    body: Body | None = None
    room: Room | None = None
    amp: Amp | None = None

    @property
    def neutral(self) -> bool:
        """Return True if nothing is changed at all."""
        return not self.rings and self.factors[0] == 0.0

    @property
    def rings(self) -> bool:
        """Return True if there is a body or a room."""
        return any(part is not None and part.mix > 0 for part in (self.body, self.room))

    @property
    def factors(self) -> tuple[float, float, float]:
        """The factors of the amplifier, see `Amp.factors`."""
        return Amp().factors if self.amp is None else self.amp.factors

    def impulse(self, rate_hz: int) -> NDArray[np.float64]:
        """The impulse response of body and room, (frames, 1 or 2): the level of pink noise stays, at any mix.

        It is remembered, and not to be written.
        """
        return _impulse(replace(self, amp=None), rate_hz)

    def tail_s(self, rate_hz: int) -> float:
        """The longest time for which it sounds on after its input."""
        return (len(self.impulse(rate_hz)) - 1) / rate_hz


@lru_cache(maxsize=4)
def _impulse(effects: Effects, rate_hz: int) -> NDArray[np.float64]:
    found: NDArray[np.float64] | None = None
    for part in (effects.body, effects.room):
        if part is not None and part.mix > 0:
            wet = part.mix * part.response(rate_hz)
            wet[0] += 1 - part.mix
            found = wet if found is None else convolved(found, wet)
    found = np.ones((1, 1)) if found is None else as_loud(found, rate_hz)
    found.setflags(write=False)
    return found


def apply(effects: Effects | None, sound: NDArray[np.floating], rate_hz: int) -> NDArray[np.float64]:
    """Apply these effects to sound (frames, 1 or 2) as a mixer does: its first frames, as many, (frames, 2).

    Give silence after the sound where the end shall ring out, `Effects.tail_s`. Samples that are no numbers, and
    those too large or too small to be sound, are taken as silence, as the mixer does.
    """
    from scipy.signal import oaconvolve  # which takes the better part of a second to load, as Numba does

    stereo = np.broadcast_to(sound, (len(sound), 2)).astype(np.float64)
    if effects is None or effects.neutral or not len(stereo):
        return stereo
    wild = ~(np.abs(stereo) < LARGEST).all(1)
    stereo[wild] = 0.0
    stereo[np.abs(stereo) < SMALLEST] = 0.0
    if effects.amp is not None:
        stereo = amplified(effects.amp, stereo, rate_hz)
    if not effects.rings:
        return stereo
    found: NDArray[np.float64] = oaconvolve(stereo, effects.impulse(rate_hz), axes=0)[: len(stereo)]
    return found
