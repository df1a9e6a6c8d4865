"""What parameters change of a sound beyond its strings: body and room, and the decay of drums."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.instrument.drum_keys import DrumKey, DrumKeys
from app.instrument.effects import effects_of
from app.patches.patch import Patch
from engine.bounds import BODY_SIZE
from engine.effects import BODIES
from engine.effects.body import HIGHEST_HZ, SUBSONIC, modes_of
from engine.voices import Ear

EFFECTS = ("body.mix", "room.mix", "body.size", "room.t60_s")  # in the shell's order
AMP = ("amp.drive_db", "amp.tone_db")


@dataclass(frozen=True, eq=False)
class Parts:
    """What the shell computes responses of the body from, at a size of 1.

    Attributes:
        modes: (4, modes): Hz, decay in 1/s, amplitudes left and right; None: it has no modes.
        seconds: how long they ring.
        subsonic_hz: below it the body radiates next to nothing.
        impulse: a body that is a response, at `impulse_hz` (frames, 1 or 2); None: it is not.
    """

    modes: NDArray[np.float64] | None = None
    seconds: float = 0.0
    subsonic_hz: float = 0.0
    impulse: NDArray[np.float64] | None = None
    impulse_hz: float = 0.0


def parts_of(patch: Patch) -> Parts:
    """Of a patch's body, as far as it has one."""
    effects = effects_of(patch.with_value("body.mix", 1.0))
    body = None if effects is None else effects.body
    if body is None:
        return Parts()
    if body.impulse is not None:
        return Parts(impulse=body.impulse.samples, impulse_hz=body.impulse.rate_hz)
    wood = BODIES[body.name]
    modes = np.vstack([part.T for part in modes_of(wood, 1.0, HIGHEST_HZ * BODY_SIZE[1])])
    return Parts(modes, wood.seconds, SUBSONIC * wood.lowest[0].frequency_hz)


def effects_there(patch: Patch) -> tuple[str, ...]:
    """The parameters of body and room that change an instrument's sound."""
    return tuple(each for each in EFFECTS if patch.body.name or not each.startswith("body."))


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
