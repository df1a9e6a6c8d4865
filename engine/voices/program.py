"""A program: what all voices of one source share, at one sample rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.kernels.fields import record_of, slots
from engine.kernels.modes import TOO_HIGH
from engine.kernels.voice_records import RENDERED
from engine.presets import PresetInfo
from engine.resonators.base import Array, Resonator
from engine.values.ear import Ear
from engine.voices.ear import weights_of
from engine.voices.memory import KernelMemory

STRING_SILENT_DB = 120.0  # its slowest mode, below its start
KEPT_WEIGHTS = 32  # listening points of a program

Strike = Callable[[Array], tuple[Array, Array]]  # displacement to the two rows that a voice sets out from


@dataclass(frozen=True, eq=False)
class Program(KernelMemory):
    """See the module; the kernels read `memory`.

    Attributes:
        kind: BANK, TRUTH, RENDERED or TENSION of `voice_records`.
        memory: the kind's record, and the arrays to which it points.
        modes: latents of a bank, modes of a solver, 0 where samples are rendered.
        start: initial displacement (grid_points,) in m to the two rows (modes,) that a voice sets out from.
        read: weights (grid_points, points) of displacement to weights (points, 2 modes) and bias (points,), of full
            scale.
        resonator: whose modes its voices begin with, and may leave; None: its kind has none of its own.
        ends_s: since the pluck, when a voice ends whatever its model still gives.
        force: `Resonator.force_weights` of the string that is played; None: it cannot be heard at a bridge.
    """

    kind: int
    memory: Array
    modes: int
    rate_hz: int
    grid_points: int
    start: Strike
    read: Callable[[Array], tuple[Array, Array]]
    resonator: Resonator | None = None
    ends_s: float = math.inf
    force: Array | None = None
    _known: dict[Ear, tuple[Array, Array]] = field(default_factory=dict)  # results of `weights`

    def weights(self, ear: Ear) -> tuple[Array, Array]:
        """The weights of a pair of listening points, as `read`; remembered. Any thread may ask."""
        known = self._known.get(ear)
        if known is None:
            known = self.read(self.grid_weights(ear))
            if len(self._known) >= KEPT_WEIGHTS:
                self._known.clear()
            self._known[ear] = known
        return known

    def grid_weights(self, ear: Ear) -> Array:
        """The weights on the grid for its string, as `weights_of`; displacement @ weights is the signal."""
        return weights_of(ear, self.grid_points, self.force)

    @property
    def rendered(self) -> bool:
        """Return True if somebody renders the samples of its voices."""
        return self.kind == RENDERED


def voice_ends_s(info: PresetInfo) -> float:
    """The time in s until a pluck of a preset's model has ended for certain.

    It is inf where its string has no losses.

    The string itself is silent by then. A model need not be: one that was trained on a part of a second may settle to
    a hum of its own. Nothing it has learned makes it end. Latents that share a tension need no such end: their energy
    is held below that of the slowest mode.
    """
    return max(info.horizon_s, info.resonator.falls_s(STRING_SILENT_DB))


def fits(omega: Array) -> Array:
    """1 where a mode turns by so few rad a frame, ω (modes,), that it sounds as itself, else 0."""
    return (np.abs(omega) <= TOO_HIGH).astype(np.float64)


def packed(
    kind: np.dtype[np.void], values: Mapping[str, Any], *parts: NDArray[np.generic], names: Sequence[str] = ()
) -> Array:
    """A program's record with these values, and the parts that follow it, in one array of float64.

    Args:
        kind: type of the record.
        names: the fields that are to have the slots of the parts, in their order; a slot is a place in that array.
    """
    arrays = [np.asarray(part, np.float64).ravel() for part in parts]
    memory = np.concatenate([np.zeros(slots(kind)), *arrays])
    record = record_of(memory, kind)
    for name, value in values.items():
        record[name] = value
    places = np.cumsum([slots(kind), *(len(array) for array in arrays)])
    for name, place in zip(names, places.tolist(), strict=False):
        record[name] = place
    return memory
