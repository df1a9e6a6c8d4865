"""What the shell computes sounds from beyond the table of strings: body and room, and drums."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.instrument.drum_keys import DrumKeys
from app.instrument.effects import effects_of
from app.patches.drums import PlayedDrum
from app.patches.patch import Patch
from app.shared.parameters import OF_PATCHES
from engine.bounds import BODY_SIZE
from engine.effects import BODIES
from engine.effects.body import HIGHEST_HZ, SUBSONIC, modes_of
from engine.kernels import playing_layout as of
from engine.resonators.air import EXACT, SPEED_M_S, reactance, resistance
from engine.resonators.base import Array
from engine.resonators.surface import Circle, Rectangle, Surface

EFFECTS = ("body.mix", "room.mix", "body.size", "room.t60_s")  # in the shell's order
MORE, LEAST = 1.05, 0.1  # of modes than the keys need; of sizes in m, and of κ times size
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


@dataclass(frozen=True, eq=False)
class DrumPart:
    """What the shell computes the modes of a drum from.

    Attributes:
        surface: (3, modes) by rising wavenumber: κ times size, m, and n or whether it is a sine.
        air_reach: k times size up to which `air` goes.
        air: (2, modes, terms): mass, and resistance by ka, both in sizes: Chebyshev polynomials of the square of ka.
    """

    played: PlayedDrum
    surface: Array
    air_reach: float
    air: Array


@dataclass(frozen=True, eq=False)
class DrumParts:
    """Attributes:
    drums: of the instrument.
    keys: by key: which drum, its ratio, and its mallet's softest and hardest speeds.
    most_modes: of a key at any modulus.
    """

    drums: tuple[DrumPart, ...]
    keys: dict[int, tuple[int, float, float, float]]
    most_modes: int


def drum_parts(own: DrumKeys) -> DrumParts:
    """Of the keys of an instrument of drums; keys that are silent at any modulus have none."""
    patch, drums = own.patch, own.drums.drums
    slack = DrumKeys(patch.with_value("knobs.modulus", OF_PATCHES["knobs.modulus"].limits[0]), own.ear, own)
    reach, keys, most, largest_m = [LEAST] * len(drums), dict[int, tuple[int, float, float, float]](), 1, LEAST
    for key in range(patch.range[0], patch.range[1] + 1):
        if (tuned := own.tuned_to(key)) is None:
            continue
        played, ratio = tuned
        number = [each.note for each in drums].index(played.note)
        keys[key] = number, ratio, played.softest_m_s, played.hardest_m_s
        for each in (slack, own):  # the softer its material, the more modes are below a frequency
            with contextlib.suppress(ValueError):
                if (found := each.of_key(key)) is not None:
                    drum, size_m = found.modes.drum, _size_m(found.modes.surface)
                    highest = drum.highest_wavenumber(own.drums.highest_hz, of.MOST_DRUM_MODES)
                    reach[number], largest_m = max(reach[number], highest * size_m), max(largest_m, size_m)
                    most = max(most, len(found.modes))
    air_reach = 2 * math.tau * own.drums.highest_hz / SPEED_M_S * largest_m
    round_reach = max(
        each if played.drum.shape == "circle" else 0.0 for each, played in zip(reach, drums, strict=True)
    )
    circle, parts, known = Circle.below(1.0, MORE * round_reach), list[DrumPart](), dict[Surface, Array]()
    for played, needed in zip(drums, reach, strict=True):
        drum = played.drum.parameters
        wanted = MORE * needed / _size_m(drum.surface(needed))
        surface = circle if drum.shape == "circle" else drum.surface(wanted)
        assert isinstance(surface, Circle | Rectangle)
        if surface not in known and drum.air_kg_m3:
            known[surface] = _air(surface, air_reach)
        second = surface.sine if isinstance(surface, Circle) else surface.n
        rows = np.stack([surface.wavenumber * _size_m(surface), surface.m, second]).astype(np.float64)
        parts.append(DrumPart(played, rows, air_reach, known.get(surface, np.zeros((2, 0, 0)))))
    return DrumParts(tuple(parts), keys, min(of.MOST_DRUM_MODES, round(MORE * most) + 1))


def _size_m(surface: Surface) -> float:
    """The radius of a circle of the same area."""
    return math.sqrt(surface.area_m2 / math.pi)


def _air(surface: Circle | Rectangle, reach: float) -> Array:
    """What the air adds to its low modes, for ka from 0 to `reach`, which it gives to a part in 10¹²."""
    size_m = _size_m(surface)
    low = surface.picked(np.flatnonzero(surface.wavenumber * size_m < EXACT))
    across = 1.0 if isinstance(surface, Circle) else math.hypot(surface.length_m, surface.width_m) / (2 * size_m)
    turns = reach * across
    terms = math.ceil(turns + 6 * (2 * turns) ** (1 / 3)) + 12  # as a Bessel function's square needs
    angles = (np.arange(terms) + 0.5) * math.pi / terms
    each = low.picked(np.tile(low.distinct[0], terms))
    k = np.repeat(reach * np.sqrt((1 + np.cos(angles)) / 2) / size_m, len(each.wavenumber) // terms)
    values = reactance(each, k, size_m) / size_m, resistance(each, k) / (k * size_m**2)  # even functions of k
    basis = np.cos(np.outer(np.arange(terms), angles)) * (2 / terms)
    basis[0] /= 2
    found: Array = np.ascontiguousarray(np.stack(values).reshape(2, terms, -1).transpose(0, 2, 1) @ basis.T)
    return found
