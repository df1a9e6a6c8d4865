"""What macros change of a sound beyond its strings: the mix of body and room, and the decay of drums."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.instrument.drum_keys import DrumKey, DrumKeys
from app.instrument.effects import effects_of
from app.patches.patch import Patch
from engine.effects import BODIES
from engine.effects.body import HIGHEST_HZ, SUBSONIC, modes_of
from engine.voices import Ear

MIXES = ("body.mix", "room.mix")
AMP = ("amp.drive_db", "amp.tone_db")


@dataclass(frozen=True, eq=False)
class Parts:
    """What the shell computes responses of body and room from.

    Attributes:
        modes: of the body, (4, modes): Hz, decay in 1/s, amplitudes left and right; None: it has no modes.
        body_s: how long they ring.
        subsonic_hz: below it the body radiates next to nothing.
        impulse: a body that is a response, at `impulse_hz` (frames, 1 or 2); None: it is not.
        room_t60_s: 0: there is no room.
    """

    modes: NDArray[np.float64] | None = None
    body_s: float = 0.0
    subsonic_hz: float = 0.0
    impulse: NDArray[np.float64] | None = None
    impulse_hz: float = 0.0
    room_t60_s: float = 0.0

    @property
    def seconds(self) -> float:
        """How long body and room ring, at most."""
        heard_s = 0.0 if self.impulse is None else len(self.impulse) / self.impulse_hz
        return self.body_s + heard_s + self.room_t60_s


def driven(patch: Patch) -> tuple[str, ...]:
    """The parameters of the amplifier, where it is on or a macro drives it."""
    return AMP if patch.amp.drive_db > 0 or AMP[0] in _moved(patch) else ()


def _moved(patch: Patch) -> set[str]:
    return {target.field for macro in patch.macros for target in macro.targets}


def mixed(patch: Patch) -> tuple[str, ...]:
    """The mixes that are above 0, or that a macro or the modulation wheel moves."""
    moved = _moved(patch) | {patch.mod_wheel}
    there = {"body.mix": bool(patch.body.name), "room.mix": True}
    return tuple(each for each in MIXES if there[each] and (each in moved or patch.value(each) > 0))


def parts_of(patch: Patch) -> Parts:
    """Of a patch's body and room, as far as either is ever heard."""
    effects = effects_of(patch.with_values(dict.fromkeys(mixed(patch), 1.0)))
    if effects is None:
        return Parts()
    found = Parts(room_t60_s=0.0 if effects.room is None else effects.room.t60_s)
    body = effects.body
    if body is None:
        return found
    if body.impulse is not None:
        hz = body.impulse.rate_hz / body.size
        return replace(found, impulse=body.impulse.samples, impulse_hz=hz)
    wood = BODIES[body.name]
    modes = np.vstack([part.T for part in modes_of(wood, body.size, HIGHEST_HZ)])
    subsonic_hz = SUBSONIC * wood.lowest[0].frequency_hz / body.size
    return replace(found, modes=modes, body_s=wood.seconds * body.size, subsonic_hz=subsonic_hz)


def drum_keys(patch: Patch) -> Iterator[tuple[int, DrumKey]]:
    """The drums of an instrument by their keys, as far as they are possible."""
    drums = DrumKeys(patch, Ear(tuple(patch.pickup.points), patch.pickup.kind))
    low, high = patch.range
    for key in range(low, high + 1):
        with contextlib.suppress(ValueError):
            if (found := drums.of_key(key)) is not None:
                yield key, found


def losses(patch: Patch, key: DrumKey) -> NDArray[np.float64]:
    """What a knob of decay, and one of brightness decay, at 1 add to decay rates, in 1/s: (2, modes)."""
    drum, knobs = key.modes.drum, patch.knobs
    added = (
        key.modes.damped(drum.damping_d1_kg_m2_s + drum.damping_d1_kg_m2_s / knobs.decay, drum.damping_d3_kg_s),
        key.modes.damped(drum.damping_d1_kg_m2_s, drum.damping_d3_kg_s * (1 + 1 / knobs.brightness_decay)),
    )
    return np.stack([each.sigma - key.modes.sigma for each in added])
