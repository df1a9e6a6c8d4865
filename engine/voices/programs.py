"""Programs: what all voices of one source share, at one sample rate.

A model whose decoder is linear becomes a bank of latents, and the string itself a solver; both are compiled and
sound at once, at the device's own rate. Any other model is rendered ahead at its own rate, and converted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.bounds import SUBSTEPS_IN_A_PERIOD
from engine.kernels import layout as at
from engine.kernels.modes import TOO_HIGH
from engine.kernels.scheme import KICKS, ROTATIONS
from engine.models._tension_arrays import CURVES
from engine.models.configurations import KoopmanTensionConfiguration
from engine.pluck import FULL_SCALE_M
from engine.presets import Preset, PresetInfo
from engine.resonators.base import Array, Resonator
from engine.voices.ear import Ear

HEARD_SILENCE = 4e-6  # of a mode, of all: what the truth leaves out where it is heard is 108 dB down
# Drums radiate high modes better than low ones: at 4e-6 they would leave with audible steps.
DRUM_SILENCE = 2e-7
# Of the model's drums: shares of the sound, below which a mode rests if it hardly stretches the drum, and of all
# amplitudes, below which it is laid to rest for good.
DRUM_UNHEARD, DRUM_STILL = 1e-7, 1e-8
STRING_SILENT_DB = 120.0  # its slowest mode, below its start
HEARD_COARSER = 15  # times fewer sub-steps than data are made with: 1e-5 off after a second, far below audibility
FILTER_TAPS, FILTER_PHASES, FILTER_BETA = 32, 512, 10.0

Strike = Callable[[Array], tuple[Array, Array]]
KEPT_WEIGHTS = 32  # listening points of a program


@dataclass(frozen=True, eq=False)
class Program:
    """See the module; the kernels read `memory`.

    Attributes:
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
    _known: dict[Ear, tuple[Array, Array]] = field(default_factory=dict)

    def weights(self, ear: Ear) -> tuple[Array, Array]:
        """As `read`, of a pair of listening points; remembered. Any thread may ask."""
        found = self._known.get(ear)
        if found is None:
            found = self.read(self.grid_weights(ear))
            if len(self._known) >= KEPT_WEIGHTS:
                self._known.clear()
            self._known[ear] = found
        return found

    def grid_weights(self, ear: Ear) -> Array:
        """As `Ear.weights`, for its string; displacement @ weights is the signal."""
        return ear.weights(self.grid_points, self.force)

    @property
    def rendered(self) -> bool:
        """Whether somebody renders the samples of its voices."""
        return self.kind == at.RENDERED

    @property
    def address(self) -> int:
        return int(self.memory.ctypes.data)


def voice_ends_s(info: PresetInfo) -> float:
    """When a pluck of a preset's model has ended for certain, in s; inf where its string has no losses.

    The string itself is silent by then. A model need not be: one that was trained on a part of a second may settle to
    a hum of its own, and nothing it has learned makes it end. Latents that share a tension need no such end: their
    energy is held below that of the slowest mode.
    """
    return max(info.horizon_s, info.resonator.falls_s(STRING_SILENT_DB))


def tension_program(
    weights: Mapping[str, Array], c: KoopmanTensionConfiguration, resonator: Resonator, rate_hz: int
) -> Program:
    """What the model of many strings learned (its curves), for a resonator of any kind at any rate."""
    return _with_modes(at.TENSION, tension_memory(weights, c, rate_hz), resonator, rate_hz)


def tension_memory(
    weights: Mapping[str, Array],
    c: KoopmanTensionConfiguration,
    rate_hz: int,
    silence: float = HEARD_SILENCE,
    unheard: float = 0.0,
) -> Array:
    """What the kernels read of the model, whatever the resonator.

    Args:
        silence: of a mode, of all together, from which on the highest are laid to rest.
        unheard: see `DRUM_UNHEARD`; 0: all modes move.
    """
    reals = {
        at.S_NODE_PHASE: c.node_phase,
        at.S_HIGHEST_PHASE: c.highest_phase,
        at.S_SILENCE: silence,
        at.S_LOUDNESS: -math.log(FULL_SCALE_M),
        at.S_RATE: float(rate_hz),
        at.S_UNHEARD: unheard,
    }
    curves = [weights[name] for name in CURVES]
    return np.concatenate([header(at.S_HEADER, reals, {at.S_COEFFICIENTS: c.degree + 1}), *curves])


def truth_program(info: PresetInfo, rate_hz: int, coarser: int = HEARD_COARSER) -> Program:
    """The physics of a preset's string, with its modes, at any rate.

    Args:
        coarser: how many times fewer sub-steps than `default_substeps`.
    """
    return solver_program(info.resonator, rate_hz, coarser, aliased=rate_hz == info.rate_hz)


def solver_program(
    resonator: Resonator, rate_hz: int, coarser: int = HEARD_COARSER, aliased: bool = False
) -> Program:
    """The physics of a resonator at any rate.

    Args:
        aliased: modes that are too high for the rate are heard as others, as they are in data of that rate.
    """
    return _with_modes(at.TRUTH, solver_memory(rate_hz, coarser), resonator, rate_hz, aliased)


def solver_memory(rate_hz: int, coarser: int = HEARD_COARSER, silence: float = HEARD_SILENCE) -> Array:
    """What the kernels read of the solver, as `tension_memory`."""
    reals = {
        at.T_SUBSTEPS: SUBSTEPS_IN_A_PERIOD / coarser,
        at.T_SILENCE: silence,
        at.T_LOUDNESS: -math.log(FULL_SCALE_M),
        at.T_RATE: float(rate_hz),
        **{at.T_ROTATIONS + stage: share for stage, share in enumerate(ROTATIONS[: at.STAGES // 2])},
        **{at.T_KICKS + stage: share for stage, share in enumerate(KICKS)},
    }
    return header(at.T_HEADER, reals, {})


def fits(omega: Array) -> Array:
    """1 where a mode turns by so few rad a frame, ω (modes,), that it sounds as itself, else 0."""
    return (np.abs(omega) <= TOO_HIGH).astype(np.float64)


def _with_modes(kind: int, memory: Array, resonator: Resonator, rate_hz: int, aliased: bool = False) -> Program:
    """Of a kind whose voices move amplitudes of the resonator's modes."""
    omega = resonator.eigenvalues().imag  # it swings
    shapes, n = resonator.shapes, resonator.modes
    if not aliased:
        shapes = shapes * fits(omega / rate_hz)[:, None]

    def start(displacement_m: Array) -> tuple[Array, Array]:
        return resonator.to_modes(displacement_m), np.zeros(n)

    def read(weights: Array) -> tuple[Array, Array]:
        found = weights.T @ shapes.T / FULL_SCALE_M
        return np.concatenate([found, np.zeros_like(found)], axis=1), np.zeros(len(found))

    return Program(kind, memory, n, rate_hz, resonator.points, start, read, resonator, force=resonator.force_weights)


def model_program(preset: Preset, rate_hz: int) -> Program:
    """The compiled voice of a model where it has one, otherwise for samples that are rendered ahead."""
    if preset.info.of_many_strings:
        return tension_program(preset.weights, preset.configuration, preset.info.resonator, rate_hz)
    if preset.info.model in ("dmd", "koopman_integrated"):
        from engine.voices.banks import bank_program  # and torch, which a preset of many strings plays without

        if (bank := bank_program(preset.model, preset.info, rate_hz)) is not None:
            return bank
    return rendered_program(preset.info, rate_hz)


def rendered_program(info: PresetInfo, rate_hz: int) -> Program:
    """For samples that are rendered ahead at the preset's own rate."""
    force = info.resonator.force_weights
    return _samples_program(info.rate_hz, rate_hz, info.grid_points, voice_ends_s(info), force)


@lru_cache(maxsize=4)
def plain_program(rate_hz: int) -> Program:
    """For samples of the device's own rate, which are played as they are."""
    return _samples_program(rate_hz, rate_hz, 0, math.inf)


def _samples_program(
    source_rate_hz: int, rate_hz: int, grid_points: int, ends_s: float, force: Array | None = None
) -> Program:
    """Converts by a Kaiser-windowed sinc in `FILTER_PHASES` phases; equal rates leave every sample as it is."""
    ratio = source_rate_hz / rate_hz
    cutoff = min(1.0, 1 / ratio)
    phase = np.arange(FILTER_PHASES + 1)[:, None] / FILTER_PHASES
    place = np.arange(-FILTER_TAPS + 1, FILTER_TAPS + 1)[None] - phase
    window = np.i0(FILTER_BETA * np.sqrt(np.clip(1 - (place / FILTER_TAPS) ** 2, 0, 1))) / np.i0(FILTER_BETA)
    sinc = np.sinc(cutoff * place)
    table = cutoff * np.where(np.abs(sinc) < 1e-15, 0.0, sinc) * window
    memory = packed(
        at.R_HEADER,
        {at.R_RATIO: ratio},
        {at.R_TAPS: FILTER_TAPS, at.R_PHASES: FILTER_PHASES},
        {at.R_FILTER: np.concatenate([table, table[-1:]])},
    )

    def start(_displacement_m: Array) -> tuple[Array, Array]:
        return np.zeros(0), np.zeros(0)

    def read(weights: Array) -> tuple[Array, Array]:
        return np.zeros((weights.shape[1], 0)), np.zeros(weights.shape[1])

    return Program(at.RENDERED, memory, 0, rate_hz, grid_points, start, read, None, ends_s, force)


def packed(
    header_slots: int, reals: dict[int, float], wholes: dict[int, int], parts: dict[int, NDArray[np.generic]]
) -> Array:
    """One array of a header and its parts, whose places the header gives."""
    arrays: Sequence[NDArray[np.generic]] = [np.asarray(part).ravel() for part in parts.values()]
    first = header(header_slots, reals, wholes)
    memory = np.concatenate([first, np.zeros(sum(len(array) for array in arrays))])
    counts = memory.view(np.int64)
    place = header_slots
    for slot, array in zip(parts, arrays, strict=True):
        counts[slot] = place
        target = counts if array.dtype == np.int64 else memory
        target[place : place + len(array)] = array
        place += len(array)
    return memory


def header(slots: int, reals: dict[int, float], wholes: dict[int, int]) -> Array:
    memory = np.zeros(slots)
    for slot, real in reals.items():
        memory[slot] = real
    for slot, whole in wholes.items():
        memory.view(np.int64)[slot] = whole
    return memory
