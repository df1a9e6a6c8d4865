"""What macros change of a sound beyond its strings: the mix of body and room, and the level of each key."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.instrument.effects import effects_of
from app.instrument.loud_keys import LoudKeys
from app.patches.patch import Patch
from engine.effects.impulse import convolved, noise_powers
from engine.kernels.playing_layout import KEYS
from engine.presets import PresetInfo
from engine.voices import Ear

MIXES = ("body.mix", "room.mix")
STEPS = 5  # positions of a macro at which levels are known


@dataclass(frozen=True, eq=False)
class Parts:
    """Body and room apart, at one rate.

    Attributes:
        body, room: responses (frames, 1 or 2); of what is not there, without frames.
        powers: (4, 4), of noise through two of: nothing, the body, the room, and both.
    """

    body: NDArray[np.float64]
    room: NDArray[np.float64]
    powers: NDArray[np.float64]


def mixed(patch: Patch) -> tuple[str, ...]:
    """The mixes that are above 0, or that a macro or the modulation wheel moves."""
    moved = {target.field for macro in patch.macros for target in macro.targets} | {patch.mod_wheel}
    there = {"body.mix": bool(patch.body.name), "room.mix": True}
    return tuple(each for each in MIXES if there[each] and (each in moved or patch.value(each) > 0))


def parts_of(patch: Patch, rate_hz: int) -> Parts | None:
    """None: neither body nor room is ever heard."""
    effects = effects_of(patch.with_values(dict.fromkeys(mixed(patch), 1.0)))
    if effects is None:
        return None
    none = np.zeros((0, 1))
    body, room = (none if part is None else part.response(rate_hz) for part in (effects.body, effects.room))
    both = convolved(body, room) if len(body) and len(room) else none
    return Parts(body, room, noise_powers((np.ones((1, 1)), body, room, both), rate_hz))


def levels(patch: Patch, preset: PresetInfo) -> NDArray[np.float32]:
    """How levels of keys change as each macro moves alone, in dB: (macros, STEPS, KEYS)."""
    found, now = np.zeros((len(patch.macros), STEPS, KEYS), np.float32), _levels(patch, preset)
    for number, macro in enumerate(patch.macros):
        if all(target.field == "room.mix" for target in macro.targets):
            continue  # no level depends on the room
        for step in range(STEPS):
            found[number, step] = _levels(patch.turned(number, step / (STEPS - 1)), preset) - now
    return found


def _levels(patch: Patch, preset: PresetInfo) -> NDArray[np.float64]:
    """Of all keys, in dB; of silent ones, that of their neighbours."""
    loud = LoudKeys(patch, Ear(tuple(patch.pickup.points), patch.pickup.kind), preset)
    known = dict(_known(loud, patch))
    keys = sorted(known) or [0]
    return np.interp(np.arange(KEYS), keys, [known.get(key, 0.0) for key in keys])


def _known(loud: LoudKeys, patch: Patch) -> Iterator[tuple[int, float]]:
    low, high = patch.range
    for key in range(low, high + 1):
        with contextlib.suppress(ValueError):  # it has no possible string
            if (found := loud.of_key(key)) is not None:
                yield key, 20 * math.log10(found.gain)
